"""Videos: playable everywhere, one frame every fifth of a simulated second."""

import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from run_fakes import FakePolicy, FakeStill, FakeWorld, parts

from robospa.baselines.random import Random
from robospa.harness.pictures.video import FPS, FilmRecorder, film
from robospa.harness.running.record_store import ActionRecorder, write_actions
from robospa.harness.sim.sapien_world import SapienWorld
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


# ---------- in the simulator a film made afterwards shows, to the pixel, what the trial looked like


REAL = TrialKey("Pick_Blocks_Size", 1, 100000)


class Both(FilmRecorder):
    """Films the trial itself while its actions are kept."""

    def __init__(self) -> None:
        super().__init__()
        self.kept = ActionRecorder()

    def executed(self, *what: Any) -> None:
        self.kept.executed(*what)


@pytest.mark.sim
def test_the_pictures_are_those_of_the_trial(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Any] = []
    monkeypatch.setattr(FilmRecorder, "add", lambda self, image: seen.append(image.copy()))
    world, both = SapienWorld(render=True), Both()
    record = run_trial(world, Random(), REAL, policy_seed=3, recorder=both, step_scale=0.02)
    write_actions(tmp_path, REAL, both.kept.actions, "joint")
    during, seen[:] = list(seen), []
    film(world, record, tmp_path, step_scale=0.02)
    world.close()
    assert len(during) == len(seen) > 6
    assert np.ptp([image.mean() for image in during]) > 0.1  # something moves
    assert all(np.array_equal(a, b) for a, b in zip(during, seen, strict=True))
