"""Videos: playable everywhere, one frame every fifth of a simulated second."""

import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from run_fakes import FakePolicy, FakeStill, FakeWorld, parts

from robospa.harness.pictures.video import FPS, FilmRecorder
from robospa.harness.trial import run_trial
from robospa.observation import CameraSpec
from robospa.trial import TrialKey

av = pytest.importorskip("av")
KEY = TrialKey("Pick_Fake", 2, 100009)


def test_frames_come_back_in_yuv420p() -> None:
    buffer = FilmRecorder()
    for shade in (0, 120, 240):
        buffer.add(np.full((240, 320, 3), shade, np.uint8))
    assert [round(float(f.mean()) / 10) for f in decoded(buffer.finish())] == [0, 12, 24]


def decoded(data: bytes) -> list[Any]:
    with av.open(io.BytesIO(data)) as file:
        assert file.streams.video[0].codec_context.pix_fmt == "yuv420p"
        return [frame.to_ndarray(format="rgb24") for frame in file.decode(video=0)]


def test_a_trial_is_filmed_from_its_start_to_its_end() -> None:
    recorder = FilmRecorder()
    run_trial(FakeWorld(), FakePolicy(), KEY, policy_seed=0, recorder=recorder, parts=parts)
    # Ten actions of 20 ms make one frame between the two ends.
    assert len(decoded(recorder.finish())) == 1 + 1 + FPS // 2


@dataclass(frozen=True)
class Watched(FakeStill):
    """Notes in `drawn` that it is drawn."""

    drawn: list[int] = field(compare=False)

    def draw(self, cameras: Sequence[CameraSpec]) -> Any:
        self.drawn.append(self.steps)
        return super().draw(cameras)


class Counting(FakeWorld):
    """Counts what is drawn; after the fifth action nothing moves any more."""

    def __init__(self) -> None:
        super().__init__()
        self.drawn: list[int] = []

    def still(self) -> Watched:
        return Watched(min(self.steps, 5), self.drawn)


def test_a_world_at_rest_is_drawn_once() -> None:
    world, recorder = Counting(), FilmRecorder(("head",))
    recorder.started(world)
    for step in range(1, 101):
        world.steps = step
        recorder.polled(world, 0.2 * step)
    recorder.ended(world)
    frames = [frame.mean() for frame in decoded(recorder.finish())]
    assert world.drawn == [0, 1, 2, 3, 4, 5]
    assert len(frames) == 101 + FPS // 2 and frames[-1] == pytest.approx(5, abs=2)
