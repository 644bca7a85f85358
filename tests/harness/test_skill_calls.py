"""Calls of skills in a real trial: what is solved, what is told, what is kept and replayed."""

import runpy
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robospa.harness.replay import ENDED, replay
from robospa.harness.running.record_store import ActionRecorder
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.trial import run_trial
from robospa.observation import CameraSpec
from robospa.protocol.policy import PolicySpec
from robospa.results.records.trial_record import TrialRecord
from robospa.tasks.catalog import build_scene, task
from robospa.tasks.plan import Place
from robospa.tasks.seeds import accepted
from robospa.trial import TrialKey

pytestmark = pytest.mark.sim

HEAD = CameraSpec("head", 160, 120)
CORNER = [0.01, 0.01]


class Says:
    """Answers `script`, one entry a query, with names in the place of points looked up in the
    picture of the moment; then it is done."""

    spec = PolicySpec("says", (HEAD,), "none", "skill")

    def __init__(self, world: SapienWorld, names: list[str], script: list[list[dict[str, Any]]]):
        self.world, self.names, self.script = world, names, list(script)
        self.told: list[Any] = []

    def reset(self, trial: object) -> None: ...

    def infer(self, observation: Any) -> Any:
        assert observation["images"]["head"].shape == (120, 160, 3)
        self.told = observation["calls"]
        shown = self.world.identify(HEAD)

        def point(value: object) -> object:
            if value not in self.names:
                return value
            rows, columns = np.nonzero(shown == self.names.index(str(value)))
            return [(np.median(columns) + 0.5) / 160, (np.median(rows) + 0.5) / 120]

        answer = self.script.pop(0) if self.script else [{"skill": "done"}]
        return [{k: v if isinstance(v, list) else point(v) for k, v in c.items()} for c in answer]


def run(
    world: SapienWorld, name: str, level: int, script: Any, scale: float = 1.0
) -> tuple[TrialRecord, list[Any]]:
    """The record of a trial, which comes again to the bit, and what the policy was told last."""
    key = TrialKey(name, level, accepted(name, level)[0])
    scene = build_scene(key.task, key.level, key.seed, key.embodiment, key.mode)
    names = [one.name for one in scene.everything]
    policy, recorder = Says(world, names, script(scene)), ActionRecorder()
    record = run_trial(world, policy, key, policy_seed=0, recorder=recorder, step_scale=scale)
    assert recorder.actions.shape == (record.steps, 14)
    again = replay(world, key, recorder.actions, "joint", step_scale=scale)
    assert (again.digest, again.success) == (record.digest, record.success)
    assert again.end == record.end or (record.end, again.message) == ("done", ENDED)
    return record, policy.told


def tower(scene: Any) -> list[list[dict[str, Any]]]:
    """The plan of a tower with all but its first block said as objects."""
    answers, calls = [], list(task(scene.task).plan(scene))
    for take, put in zip(calls[::2], calls[1::2], strict=True):
        assert isinstance(put, Place)
        where = {"at": put.on} if put.on else {"at": take.object, "offset": [0.0, -0.08]}
        answers.append([{"skill": "pick", "at": take.object}, {"skill": "place", **where}])
    return answers


def test_a_tower_is_built_from_what_the_picture_shows(world: SapienWorld) -> None:
    record, told = run(world, "Stack_Blocks_Color_Order", 3, tower)
    kept = record.diagnostics["calls"]
    assert [call["skill"] for call in kept] == ["pick", "place"] * 3
    assert record.success and record.policy_calls == 3
    assert [call["feedback"] for call in kept] == ["done"] * 4 + ["the goal was met"] * 2
    assert told == kept[:4] and kept[2]["step"] > 0


def wrong(scene: Any) -> list[list[dict[str, Any]]]:
    """Calls of which none can be done."""
    block = scene.objects[0].name
    here = {"at": block, "to": block}
    return [
        [{"skill": "pick", "at": CORNER}, {"skill": "place", "at": block}],
        [{"skill": "drop", "at": block}, {"skill": "handover"}, {"skill": "open", "at": block}],
        [{"skill": "hang", **here}, {"skill": "hit", "at": block, "to": [CORNER]}],
        [{"skill": "home"}, {"skill": "wait", "seconds": 0.4}],
    ]


def test_what_cannot_be_done_is_told_in_sentences(world: SapienWorld) -> None:
    record, told = run(world, "Basic_Color_Blocks", 1, wrong)
    assert [call["feedback"] for call in record.diagnostics["calls"]] == [
        "nothing there",
        "not held",
        "not held",
        "not held",
        "it has no door with a handle",
        "not possible with what is there",
        "nothing there",
        "done",
        "done",
        "done",
    ]
    assert record.end == "done" and not record.success
    assert record.steps == 8 + 2 + 1  # a still action each, the wait, and before the end
    assert not any(one in str(told) for one in ("block", "object"))


def test_the_limit_of_actions_bounds_calls(world: SapienWorld) -> None:
    record, _ = run(world, "Stack_Blocks_Color_Order", 3, tower, scale=0.02)
    assert record.end == "step_limit"
    assert record.diagnostics["calls"][-1]["feedback"] == "the trial ended meanwhile"


def test_the_example_solves_its_task_and_stands_on_its_page(world: SapienWorld) -> None:
    docs = Path(__file__).resolve().parents[2] / "docs"
    code = (docs / "examples" / "by_colour.py").read_text()
    assert code[code.index("HUES =") :].strip() in (docs / "skills.md").read_text()
    policy = runpy.run_path(str(docs / "examples" / "by_colour.py"))["ByColour"]()
    key = TrialKey("Basic_Color_Blocks", 2, accepted("Basic_Color_Blocks", 2)[0])
    assert run_trial(world, policy, key, policy_seed=0).success
