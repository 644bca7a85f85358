"""The scripts in examples/ run, each with its smallest settings, and the plugins there in other
projects' commands, where these are installed."""

import importlib
import json
import re
import runpy
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from collect_fakes import FakePool, fake_pack
from fake_runs import make_run, shown
from PIL import Image

from robospa.harness.datasets import collect
from robospa.tasks import catalog

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


def run(name: str, *words: str) -> None:
    """`python examples/NAME.py WORDS...`, in this process."""
    with patch.multiple(sys, argv=[name, *words], path=list(sys.path)):
        runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")


def test_the_page_names_every_script_and_no_other() -> None:
    named = re.findall(r"\]\((\w+\.(?:py|ipynb))\)", (EXAMPLES / "README.md").read_text())
    assert sorted(named) == sorted(p.name for p in EXAMPLES.glob("*.*") if p.suffix != ".md")


@pytest.mark.sim
def test_the_cells_of_the_notebook_run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    cells = json.loads((EXAMPLES / "first_evaluation.ipynb").read_text())["cells"]
    names: dict[str, object] = {}
    for cell in cells:
        if cell["cell_type"] == "code":
            exec(cell["source"], names)  # in this process, as a kernel does it
    assert len(names["run"].keys) == len(names["expert"].keys) == 6


@pytest.mark.sim
def test_evaluate_my_policy(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run("evaluate_my_policy", "--trials=1", "--workers=1", f"--out={tmp_path}")
    out = capsys.readouterr().out
    assert "GAC Pick Blocks Size" in out and "SR [95 %]" in out
    assert "Pick_Blocks_Size L1 seed 100" in out and f"robospa report {tmp_path}" in out


@pytest.mark.sim
def test_look_at_a_scene(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    run("look_at_a_scene", "--cameras=head", f"--out={tmp_path}")
    out = capsys.readouterr().out
    assert "Pick_Blocks_Size, level 3, seed 100000: " in out and "object_3: block at x" in out
    with Image.open(tmp_path / "scene.png") as picture:
        assert picture.size == (320, 240) and len(picture.getcolors(1 << 20) or ()) > 100


def test_collect_data(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    @contextmanager
    def opener(*_: object) -> Iterator[type[FakePool]]:
        yield FakePool

    monkeypatch.setattr(collect, "pool_opener", opener)
    monkeypatch.setattr(collect, "versions", dict)
    monkeypatch.setattr(collect, "pack", fake_pack)
    run("collect_data", str(tmp_path / "data"), "--episodes=2", "--cameras=head")
    assert f"2 episodes in {tmp_path / 'data'}" in capsys.readouterr().out


def test_compare_two_runs(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name, won in (("good", 30), ("poor", 3)):
        make_run(tmp_path / name, [shown("Pick_It", 1, n, n < won) for n in range(30)])
    run("compare_two_runs", str(tmp_path / "good"), str(tmp_path / "poor"))
    out = capsys.readouterr().out
    assert "good and poor differ: [+" in out and "100.0" in out and "90.0" in out
    run("compare_two_runs", str(tmp_path / "good"), str(tmp_path / "good"))
    assert "cannot be told apart" in capsys.readouterr().out


@pytest.mark.sim
def test_make_my_own_task(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    catalog.extensions.cache_clear()
    try:
        run("make_my_own_task", "--seeds=1", f"--out={tmp_path / 'task.png'}")
    finally:
        catalog.extensions.cache_clear()
        for name in ("leftmost_block", "leftmost_block.task"):
            sys.modules.pop(name, None)
    assert "Pick_Leftmost_Block level 3: the expert solves 1 of 1 seeds" in capsys.readouterr().out
    assert (tmp_path / "task.png").stat().st_size > 10_000


def test_a_task_with_a_name_of_the_benchmark_is_not_offered() -> None:
    with pytest.raises(ValueError, match="the benchmark has a task Pick_Blocks_Size"):
        catalog.offer(catalog.task("Pick_Blocks_Size"))


@pytest.mark.sim
def test_gymnasium_rollout(capsys: pytest.CaptureFixture[str]) -> None:
    pytest.importorskip("gymnasium", reason="Gymnasium comes with the extra gym")
    run("gymnasium_rollout", "--steps=2")
    assert "2 actions, 0 of 1 subtasks" in capsys.readouterr().out


# --- what other projects' commands run of ours


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
