"""What is shown of a trial at which time."""

from __future__ import annotations

from dataclasses import replace

from fake_runs import trial_record

from robospa.geometry import Pose
from robospa.harness.viewer.playback import Moment, Playback, moments, playback_of
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

NAMES = {"object_0": "the red block", "object_1": "the blue block"}
SUBTASKS = {"object_0": (0,), "object_1": (1, 2)}
TIMES = (0.0, 0.1, 0.2, 0.3)
FRAMES = tuple({"object_0": Pose((0.0, 0.0, t))} for t in TIMES)
EVENTS = (
    {"time": 0.05, "kind": "approached", "object": "object_0", "index": -1, "note": ""},
    {"time": 0.1, "kind": "closed", "object": "object_0", "index": -1, "note": "touching"},
    {"time": 0.1, "kind": "subtask_done", "object": "object_0", "index": 0, "note": ""},
    {"time": 0.2, "kind": "subtask_done", "object": "object_1", "index": 1, "note": ""},
    {"time": 0.3, "kind": "subtask_undone", "object": "object_0", "index": 0, "note": ""},
)


def record(success: bool, **changes: object) -> TrialRecord:
    made = trial_record(TrialKey("Stack_Two", 2, 7), success, total=3, done=1, events=EVENTS)
    return replace(made, **changes)  # type: ignore[arg-type]


def played(success: bool = True) -> Playback:
    return playback_of(record(success), TIMES, FRAMES, NAMES, SUBTASKS)


def test_a_time_shows_the_last_frame_at_or_before_it() -> None:
    heights = {t: played().shown(t).poses["object_0"].position[2] for t in (-1, 0.05, 0.1, 0.25, 9)}
    assert heights == {-1: 0.0, 0.05: 0.0, 0.1: 0.1, 0.25: 0.2, 9: 0.3}


def test_an_object_is_wanted_until_all_its_subtasks_are_done() -> None:
    trial = played()
    assert trial.shown(0.0).wanted == {"object_0", "object_1"}
    assert trial.shown(0.1).wanted == {"object_1"}
    assert trial.shown(0.2).wanted == {"object_1"}, "its other subtask is still to be done"
    assert trial.shown(0.3).wanted == {"object_0", "object_1"}, "undone again"


def test_events_are_words_with_the_objects_names_and_approaches_are_left_out() -> None:
    assert [moment.text for moment in played().moments] == [
        "closed, touching the red block",
        "subtask 1 done: the red block",
        "subtask 2 done: the blue block",
        "subtask 1 undone: the red block",
    ]
    assert [played().shown(t).happened for t in (0.0, 0.1, 0.2, 5.0)] == [0, 2, 3, 4]


def test_a_failure_stands_at_its_moment_and_one_without_at_the_end() -> None:
    wrong = {"time": 0.2, "kind": "wrong_object", "object": "object_1", "index": -1, "note": ""}
    found = moments(record(False, events=(wrong,), category="GAC"), NAMES, 0.3)
    assert [(m.time, m.failure) for m in found] == [(0.2, False), (0.2, True)]
    assert found[1].text == "failure: target grounding"
    (idle,) = moments(record(False, events=(), category="GAC"), NAMES, 0.3)
    assert idle == Moment(idle.time, "failure: no attempt", failure=True)


def test_it_says_which_trial_it_is_and_how_it_ended() -> None:
    wrong = {"time": 0.2, "kind": "wrong_object", "object": "object_1", "index": -1, "note": ""}
    lost = playback_of(
        record(False, events=(wrong,), category="GAC"), TIMES, FRAMES, NAMES, SUBTASKS
    )
    assert lost.failure.startswith("target grounding: ")
    assert "the blue block" in lost.failure
    trial = played()
    assert trial.failure == ""
    assert trial.title == "Stack Two, level 2, seed 7"
    assert trial.outcome == "success, 1 of 3 subtasks done"
    assert trial.end == 0.3
