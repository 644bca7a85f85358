"""Every mistake of convention is named; right policies are not accused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from replay_fakes import (
    CHUNK,
    EE,
    FRAMES,
    SPEC,
    Change,
    Learned,
    all_images,
    columns,
    episode,
    grippers,
    joints,
    state,
    swapped_wrists,
)

from robospa.action_space import ActionSpace
from robospa.geometry import Pose
from robospa.harness.convention_check.check import Findings, absolute, check_conventions
from robospa.harness.convention_check.episodes import EpisodeError

MADE = episode()


def found(policy: Learned, made: Any = MADE) -> Findings:
    return check_conventions(policy, made)


SWAP = columns([*range(7, 14), *range(7)])


def both(*changes: Change) -> Change:
    def changed(chunk: Any, now: Any) -> Any:
        for change in changes:
            chunk = change(chunk, now)
        return chunk

    return changed


def per_step(chunk: Any, now: Any) -> Any:
    return np.diff(np.vstack([now, chunk]), axis=0)


def flip_motion(chunk: Any, now: Any) -> Any:
    out = chunk.copy()
    out[:, [1, 2, 8, 9]] = 2 * now[[1, 2, 8, 9]] - out[:, [1, 2, 8, 9]]
    return out


ANSWERS: dict[str, Change] = {
    "arms swapped": SWAP,
    "grippers last": columns([*range(6), *range(7, 13), 6, 13]),
    "grippers first": columns([6, *range(6), 13, *range(7, 13)]),
    "arms interleaved": columns([i + 7 * arm for i in range(7) for arm in (0, 1)]),
    "joints reversed": columns([5, 4, 3, 2, 1, 0, 6, 12, 11, 10, 9, 8, 7, 13]),
    "joint order": columns([1, 0, 2, 3, 5, 4, 6, 8, 7, 9, 10, 12, 11, 13]),
    "degrees": joints(np.degrees),
    "gripper inverted": grippers(lambda g: 1 - g),
    "gripper 0..0.1": grippers(lambda g: 0.1 * g),
    "gripper 0..100": grippers(lambda g: 100 * g),
    "gripper 0..255": grippers(lambda g: 255 * g),
    "gripper -1..1": grippers(lambda g: 2 * g - 1),
    "gripper 1..-1": grippers(lambda g: 1 - 2 * g),
    "delta from the start": lambda chunk, now: joints(lambda c: c - now)(chunk, now),
    "delta from the last": lambda chunk, now: joints(lambda c: per_step(c, now))(chunk, now),
    "joint signs": joints(lambda c: c * np.where(np.isin(np.arange(14), [1, 2, 8, 9]), -1, 1)),
    "signs of motion": flip_motion,
    "a frame late": lambda chunk, now: np.vstack([now, chunk[:-1]]),
}


@pytest.mark.parametrize("name", ANSWERS)
def test_a_mistake_in_the_answer_is_named(name: str) -> None:
    findings = found(Learned(MADE, ANSWERS[name]))
    assert findings.kind == "mistaken" and findings.best is not None
    assert findings.best.names == (name,)
    assert findings.best.phrase in findings.sentence


@pytest.mark.parametrize("name", ["arms swapped", "degrees", "gripper inverted", "joint order"])
def test_and_through_noise(name: str) -> None:
    findings = found(Learned(MADE, ANSWERS[name], noise=0.02))
    assert findings.best is not None and findings.best.names == (name,)


def test_openpi_is_named_with_its_signs() -> None:
    findings = found(Learned(MADE, ANSWERS["joint signs"]))
    assert "adapt_to_pi" in findings.sentence


LOOKS = {
    "wrist images swapped": swapped_wrists,
    "blue for red": all_images(lambda image: image[..., ::-1]),
    "images upside down": all_images(lambda image: image[::-1, ::-1]),
    "arms of the state swapped": state(lambda rows: rows[::-1]),
    "grippers of the state inverted": state(lambda rows: np.hstack([rows[:, :6], 1 - rows[:, 6:]])),
    "state in degrees": state(lambda rows: np.hstack([np.radians(rows[:, :6]), rows[:, 6:]])),
}


@pytest.mark.parametrize("name", LOOKS)
def test_a_mistake_in_what_is_shown_is_named(name: str) -> None:
    findings = found(Learned(MADE, look=LOOKS[name]))
    assert findings.kind == "mistaken" and findings.best is not None
    assert findings.best.names == (name,)


@pytest.mark.parametrize("name", ["quaternion x y z w", "millimetres", "tool centre", "origin"])
def test_mistakes_in_poses_are_named(name: str) -> None:
    def ahead(chunk: Any, now: Any) -> Any:
        out = chunk.copy()
        for row in out.reshape(-1, 8):
            row[:3] = Pose(tuple(row[:3]), tuple(row[3:7])).apply((0.12, 0.0, 0.0))
        return out

    xyzw = columns([0, 1, 2, 4, 5, 6, 3, 7, 8, 9, 10, 12, 13, 14, 11, 15])
    metres = np.where(np.arange(16) % 8 < 3, 1000.0, 1.0)
    changes: dict[str, Change] = {
        "quaternion x y z w": xyzw,
        "millimetres": lambda chunk, now: chunk * metres,
        "tool centre": ahead,
        "origin": lambda chunk, now: chunk + np.where(np.arange(16) % 8 < 3, 0.4, 0.0),
    }
    findings = found(Learned(MADE, changes[name], spec=EE))
    assert findings.best is not None
    assert findings.best.names == ("another origin" if name == "origin" else name,)


def test_two_mistakes_together_are_both_named() -> None:
    change = both(SWAP, grippers(lambda g: 1 - g))
    findings = found(Learned(MADE, change))
    assert findings.best is not None
    assert set(findings.best.names) == {"arms swapped", "gripper inverted"}


def test_swapped_arms_in_state_and_actions_are_both_named() -> None:
    findings = found(Learned(MADE, SWAP, look=LOOKS["arms of the state swapped"]))
    assert findings.best is not None
    assert findings.best.names == ("arms of the state swapped", "arms swapped")


def test_a_policy_of_measured_joints_is_told_from_one_of_commands() -> None:
    assert MADE.measured is not None
    made = replace(MADE, commanded=MADE.measured)  # what it learned to follow
    late = replace(MADE, measured=MADE.measured)
    findings = found(Learned(made, look=lambda seen: {**seen, "state": _at(seen, made)}), late)
    assert findings.best is not None and findings.best.names == ("measured joints",)


def _at(seen: dict[str, Any], made: Any) -> Any:
    return made.commanded[seen["step"]]


@pytest.mark.parametrize("noise", [0.0, 0.01, 0.03, 0.08])
@pytest.mark.parametrize("spec", [SPEC, EE], ids=["joint", "ee"])
def test_a_right_policy_fits_however_noisy(spec: Any, noise: float) -> None:
    small = 0.2 if spec is EE else 1.0
    findings = found(Learned(MADE, spec=spec, noise=small * noise))
    assert findings.kind == "fits", findings.sentence
    assert findings.best is None


def test_differences_of_pose_are_added_up_before_they_are_compared() -> None:
    now = MADE.ee[10].reshape(-1)
    recorded = MADE.ee[11:31].reshape(-1, 16)
    deltas = []
    for before, after in zip(np.vstack([now, recorded[:-1]]), recorded, strict=True):
        row: list[float] = []
        for a, b in zip(before.reshape(2, 8), after.reshape(2, 8), strict=True):
            one, two = (Pose(tuple(p[:3]), tuple(p[3:7])) for p in (a, b))
            step = one.inverse() * two
            row += [*step.position, *step.rotation, b[7]]
        deltas.append(row)
    assert np.allclose(absolute(np.array(deltas), now, ActionSpace("ee")), recorded, atol=1e-9)


def test_a_policy_that_learned_nothing_is_accused_of_nothing() -> None:
    rng = np.random.default_rng(0)
    lost = Learned(MADE, lambda chunk, now: now + rng.normal(0, 0.6, chunk.shape))
    findings = found(lost)
    assert findings.kind == "unclear" and "does not fit" in findings.sentence


def test_holding_still_does_not_fit() -> None:
    findings = found(Learned(MADE, lambda chunk, now: np.tile(now, (len(chunk), 1))))
    assert findings.kind == "unclear"


def test_what_was_not_recorded_is_said_not_to_be_tried() -> None:
    findings = found(Learned(MADE), episode(measured=False))
    assert any("measured" in text for text in findings.untried)


def test_every_frame_is_asked_in_a_trial_of_its_own() -> None:
    policy = Learned(MADE)
    findings = found(policy)
    assert len(findings.frames) == 8 and findings.frames[0] == 0
    assert max(findings.frames) < FRAMES - CHUNK // 2
    assert policy.trial is not None and policy.trial.instruction == "Pick it up."


@pytest.mark.parametrize(
    ("change", "told"),
    [
        ({"privileged": True}, "exact state"),
        ({"environment_state": True}, "exact state"),
        ({"action_dim": 16}, "numbers an action"),
        ({"state": "measured"}, "robospa collect --record"),
    ],
)
def test_what_cannot_be_compared_is_one_sentence(change: dict[str, Any], told: str) -> None:
    wide = Learned(MADE, spec=replace(SPEC, **change))
    if "action_dim" in change:
        wide.answer = lambda chunk, now: np.hstack([chunk, chunk[:, :2]])
    with pytest.raises(EpisodeError, match=told):
        check_conventions(wide, episode(measured=False))
