"""Frames of a recording: at a motion's start, every stride after it, and at its end."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from robospa.harness.demonstrations.recorder import (
    KEYFRAMES,
    STRIDE,
    STRIDES,
    FrameRecorder,
    frame_steps,
)
from robospa.harness.sim.motion import HOLD_STEPS, RATE
from robospa.harness.sim.sapien_world import POLL_STEPS
from robospa.harness.world import StepResult
from robospa.protocol.policy import PolicySpec
from robospa.tasks.catalog import tasks


class Clock:
    """A world in which every command is the number of physics steps until then, or one for all."""

    def __init__(self, rests: bool = False) -> None:
        self.step = 0
        self.rests = rests

    def observe(self, spec: PolicySpec) -> dict[str, Any]:
        value = -1.0 if spec.state == "measured" else 0.0 if self.rests else float(self.step)
        state = np.full(14, value, np.float32)
        return {"state": state, "ee": np.zeros((2, 8), np.float32)}

    def snapshot(self) -> SimpleNamespace:
        return SimpleNamespace(time=self.step / RATE)

    def still(self) -> int:
        return self.step


def recorded(lengths: list[int], stride: int = 15, rests: bool = False) -> FrameRecorder:
    """The frames of actions that take so many physics steps."""
    recorder, world = FrameRecorder(stride), Clock(rests)
    recorder.started(world)  # type: ignore[arg-type]
    for length in lengths:
        for _ in range(length):
            world.step += 1
            if world.step % POLL_STEPS == 0:
                recorder.polled(world, world.step / RATE)  # type: ignore[arg-type]
        recorder.executed(world, np.zeros(14, np.float32), StepResult(length, False))  # type: ignore[arg-type]
    assert [frame.still for frame in recorder.frames] == [frame.step for frame in recorder.frames]
    commanded, measured, _, objects = recorder.columns()
    assert measured.max() == -1 and objects.shape == (len(recorder), 0)
    assert np.array_equal(commanded, recorder.commanded)
    return recorder


@pytest.mark.parametrize(
    ("lengths", "stride", "frames"),
    [
        ([40], 15, [0, 15, 30, 40]),
        ([40], 20, [0, 20, 40]),
        ([12, 8, 24], 15, [0, 12, 20, 35, 44]),
        ([35], 15, [0, 15, 35]),  # a frame just before an action's end is replaced by that
        ([3, 3, 50], 15, [0, 3, 6, 25, 40, 56]),
        ([40, 12, 3, 500], KEYFRAMES, [0, 40, 52, 55, 555]),
    ],
)
def test_a_frame_every_stride_and_one_at_every_action_s_end(
    lengths: list[int], stride: int, frames: list[int]
) -> None:
    assert [int(row) for row in recorded(lengths, stride).commanded[:, 0]] == frames


def test_a_recording_may_begin_in_the_midst_of_a_trial() -> None:
    recorder, world = FrameRecorder(), Clock()
    world.step = 60
    recorder.started(world)  # type: ignore[arg-type]
    world.step = 68
    recorder.executed(world, np.zeros(14, np.float32), StepResult(8, False))  # type: ignore[arg-type]
    assert [frame.step for frame in recorder.frames] == [60, 68]


def test_a_rest_is_one_frame_however_long_the_action() -> None:
    assert len(recorded([HOLD_STEPS, HOLD_STEPS], rests=True)) == 1 + 2


def test_strides_are_those_of_polls_and_no_wait_gets_shorter() -> None:
    assert set(STRIDES) <= set(tasks())
    for stride in (STRIDE, *STRIDES.values()):
        assert STRIDE <= stride <= HOLD_STEPS and stride % POLL_STEPS == 0
    assert frame_steps("Press_Stapler_Memory") == 20 and frame_steps("Pick_Blocks_Size") == STRIDE
