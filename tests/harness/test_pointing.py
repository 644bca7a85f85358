"""Questions of pointing: what a point means, and a run of a policy that answers one."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from robospa.harness.pointing import box_of, meant, point_on
from robospa.harness.replay import replay
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.trial import run_trial, task_parts
from robospa.harness.world import OTHER, TABLE
from robospa.observation import CameraSpec
from robospa.protocol.calls import check_calls
from robospa.protocol.errors import PolicyAnswerError
from robospa.protocol.policy import PolicySpec
from robospa.results.records.runs import differences
from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.grounding import choices_of
from robospa.tasks.catalog import tasks
from robospa.trial import TrialKey

HEAD = CameraSpec("head")
SPEC = PolicySpec("pointer", cameras=(HEAD,), state="none", action="point")
KEY = TrialKey("Pick_Blocks_Size", 3, 100_003, split="heldout")


def test_a_point_means_what_is_there_or_near() -> None:
    shown = np.full((240, 320), TABLE, np.int16)
    shown[100:110, 200:220], shown[:20] = 1, OTHER
    assert [meant(shown, at) for at in ((0.64, 0.42), (0.5, 0.5), (0, 0), (1, 1))] == [
        1,
        -1,
        -2,
        -1,
    ]
    assert meant(shown, (195.5 / 320, 105 / 240)) == 1  # 5 px beside
    assert meant(shown, (192.5 / 320, 105 / 240)) == TABLE
    ring = np.zeros((240, 320), bool)
    ring[50:80, 60:90], ring[55:75, 65:85] = True, False
    u, v = point_on(ring)
    assert ring[int(v * 240), int(u * 320)] and box_of(ring) == [60, 50, 90, 80]


@pytest.mark.parametrize(
    ("answer", "sentence"),
    [
        ("the left one", "str, not a list of calls"),
        ([{"skill": "pick", "at": [0.5, 0.5]}], "'skill' is one of point, not 'pick'"),
        ([{"skill": "point"}], "lacks the field 'at'"),
        ([{"skill": "point", "at": [160, 120]}], "must be a number <= 1.0"),
        ([{"skill": "point", "at": [0.5, 0.5], "camera": "front"}], "sees no camera 'front'"),
    ],
)
def test_what_is_no_point_is_refused_in_a_sentence(answer: object, sentence: str) -> None:
    with pytest.raises(PolicyAnswerError, match=re.escape(sentence)):
        check_calls(answer, SPEC)
    with pytest.raises(PolicyAnswerError, match="one of pick"):
        check_calls([{"skill": "point", "at": [0.5, 0.5]}], replace(SPEC, action="skill"))


class Pointer:
    """Points at what `choose` says of the objects of the question, as it sees through the world."""

    def __init__(self, world: SapienWorld, choose: Any) -> None:
        self.spec, self.world, self.choose = SPEC, world, choose

    def reset(self, trial: Any) -> None:
        assert trial.key is None

    def infer(self, observation: Any) -> Any:
        assert observation["images"]["head"].shape == (240, 320, 3) and observation["calls"] == []
        at = self.choose(self.world.identify(HEAD))
        return [{"skill": "point", "at": at}]


def ask(world: SapienWorld, key: TrialKey, index: int) -> TrialRecord:
    """The record of a policy that points at object number `index`, or at the table (-1)."""
    pointer = Pointer(world, lambda shown: point_on(shown == index))
    return run_trial(world, pointer, key, policy_seed=1)


@pytest.mark.sim
def test_answers_are_records_like_others(world: SapienWorld) -> None:
    setup = task_parts(KEY)
    names = [item.name for item in setup.scene.objects]
    target = names.index(setup.scene.facts["target"])
    right = ask(world, KEY, target)
    assert (right.success, right.end, right.done, right.total) == (True, "success", 1, 1)
    assert right.steps == right.physics_steps == 0 and right.policy_calls == 1
    (call,) = right.diagnostics["calls"]
    assert call["skill"] == "point" and call["camera"] == "head" and call["feedback"] == "done"
    assert choices_of(right)[0].done and choices_of(right)[0].object == names[target]
    other = ask(world, KEY, 1 - min(target, 1))
    assert (other.success, other.end, other.done) == (False, "done", 0)
    assert not choices_of(other)[0].right
    for record in (right, other):
        again = replay(world, KEY, np.zeros((0, 0), np.float32), "joint", of=record)
        assert differences(record, again) == []
    empty = ask(world, KEY, TABLE)
    assert not empty.success and choices_of(empty) == []
    assert empty.diagnostics["calls"][0]["feedback"] == "nothing there"


@pytest.mark.sim
def test_every_question_can_be_answered(world: SapienWorld) -> None:
    asked = [name for name, task in tasks().items() if task.dimension != "procedural"]
    assert len(asked) == 39
    for number, name in enumerate(asked):
        key = TrialKey(name, 1 + number % 5, 100_010, split="heldout")
        scene = task_parts(key).scene
        index = [item.name for item in scene.objects].index(scene.facts["target"])
        assert ask(world, key, index).success, key
