"""LeRobot's own evaluation, with a tiny policy, on our tasks. `make test-models` runs it."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import pytest
from installed import installed
from outside import HERE, ROOT, environment, ran

RENAMED = {"observation.images.head": "observation.images.head_camera"}
"""Of the tiny policy, which has RoboTwin's names."""

pytestmark = [pytest.mark.models, pytest.mark.timeout(600)]


def test_lerobot_eval_runs_its_policy_on_two_levels(tmp_path: Path) -> None:
    ran(HERE / "tiny.py", "make", "act", tmp_path / "act")
    site = tmp_path / "site"  # robospa is not installed there: its robots are found by these notes
    site.mkdir()
    groups = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["entry-points"]
    installed(site, groups)
    ran(
        *("-m", "lerobot.scripts.lerobot_eval", f"--policy.path={tmp_path / 'act'}"),
        *("--policy.device=cpu", "--env.discover_packages_path=robospa.harness.gym"),
        *("--env.type=robospa", "--env.task=Pick_Blocks_Size", "--env.levels=1,2"),
        *("--env.cameras=head", "--env.world=run_fakes:FakeWorld", "--env.parts=run_fakes:parts"),
        *("--env.step_scale=0.05", "--eval.n_episodes=2", "--eval.batch_size=1", "--seed=0"),
        *(f"--output_dir={tmp_path / 'out'}", f"--rename_map={json.dumps(RENAMED)}"),
        given=environment(tmp_path / "home", ROOT / "tests" / "helpers", site),
        cwd=tmp_path,
    )
    found = json.loads((tmp_path / "out" / "eval_info.json").read_text())
    tasks = [(one["task_group"], one["task_id"]) for one in found["per_task"]]
    assert tasks == [("Pick_Blocks_Size", 1), ("Pick_Blocks_Size", 2)]
    assert all(len(one["metrics"]["successes"]) == 2 for one in found["per_task"])
    assert found["overall"]["n_episodes"] == 4
    assert list((tmp_path / "out" / "videos").rglob("*.mp4"))
