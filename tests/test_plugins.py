"""What other projects' commands run of ours: each test needs that project's package."""

import importlib
from pathlib import Path
from typing import Any

import pytest

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


def plugin(folder: str, module: str, needs: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    pytest.importorskip(needs, reason=f"{needs} is not installed here: pip install it to run this")
    monkeypatch.syspath_prepend(str(EXAMPLES / folder))
    return importlib.import_module(module)


@pytest.mark.sim
def test_inspect_robots(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ours = plugin("inspect_robots", "inspect_robots_robospa", "inspect_robots", monkeypatch)
    names = ours.ir.registered("task")
    assert sum(name.startswith("robospa/") for name in names) == 355
    robot, policy = ours.RoboSPA(out=str(tmp_path)), ours.Served("hold")
    (log,) = ours.ir.eval(names["robospa/pick_blocks_size_l1"](1), policy, robot, log_dir=tmp_path)
    assert log.results.metrics == {"success_at_end": 0.0, "sr1": 0.0, "onta": -1.0}
    assert (tmp_path / "actions/Pick_Blocks_Size-L1-100000-aloha-agilex-clean-heldout.npz").exists()


@pytest.mark.sim
def test_vla_eval(monkeypatch: pytest.MonkeyPatch) -> None:
    ours = plugin("vla_eval", "robospa_benchmark", "vla_eval", monkeypatch)
    benchmark = ours.RoboSPABenchmark("GAC", "1")
    task = {**benchmark.get_tasks()[0], "episode_idx": 0}
    seen = benchmark.make_obs(benchmark.reset(task), task)
    assert set(seen["images"]) == {"head_camera", "left_camera", "right_camera"}
    ended = benchmark.step({"actions": seen["joint_state"][:3]})
    assert ended.done and benchmark.get_step_result(ended)["end"] == "policy_error"
    benchmark.cleanup()


def test_envhub(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBOSPA_TASKS", "Pick_Blocks_Size")
    envs = plugin("envhub", "env", "lerobot", monkeypatch).make_env(n_envs=2)
    assert list(envs) == ["Pick_Blocks_Size"] and list(envs["Pick_Blocks_Size"]) == [1, 2, 3, 4, 5]
