"""Videos: playable everywhere, one frame every fifth of a simulated second."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pytest
from run_fakes import FakePolicy, FakeWorld, parts

from robospa.harness.pictures.video import FPS, TrialRecorder, VideoBuffer
from robospa.harness.trial import run_trial
from robospa.trial import TrialKey

av = pytest.importorskip("av")
KEY = TrialKey("Pick_Fake", 2, 100009)


def test_frames_come_back_in_yuv420p() -> None:
    buffer = VideoBuffer()
    for shade in (0, 120, 240):
        buffer.add(np.full((240, 320, 3), shade, np.uint8))
    with av.open(io.BytesIO(buffer.finish())) as file:
        frames = [frame.to_ndarray(format="rgb24") for frame in file.decode(video=0)]
        assert file.streams.video[0].codec_context.pix_fmt == "yuv420p"
    assert [round(float(f.mean()) / 10) for f in frames] == [0, 12, 24]


def test_a_trial_is_filmed_from_its_start_to_its_end(tmp_path: Path) -> None:
    recorder = TrialRecorder(video=True)
    run_trial(FakeWorld(), FakePolicy(), KEY, policy_seed=0, recorder=recorder, parts=parts)
    path = tmp_path / recorder.write_video(tmp_path, KEY)
    assert path.name == f"{KEY.slug}.mp4"
    with av.open(str(path)) as file:
        frames = sum(1 for _ in file.decode(video=0))
    assert frames == 1 + 1 + FPS // 2  # ten actions of 20 ms make one frame between the two ends


def test_without_a_film_nothing_is_written(tmp_path: Path) -> None:
    assert TrialRecorder().write_video(tmp_path, KEY) == ""
    assert list(tmp_path.iterdir()) == []
