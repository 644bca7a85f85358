"""Keeps a trial's actions and, if asked, one head-camera frame per executed action.

Frames wait in memory as JPEG (a few kilobytes each) because only the end tells whether a video is
wanted; they are then written as H.264 in yuv420p, which every browser plays.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.harness.store import VIDEOS, replace_file
from robospa.harness.world import World
from robospa.protocol.policy import CameraSpec
from robospa.results.records import TrialKey

FPS = 10
"""Frames per second of a video: one frame an action, as in the official recordings."""
CAMERA = CameraSpec("head")


class TrialRecorder:
    """A `Recorder` of actions, and of frames if `frames`."""

    def __init__(self, frames: bool = False) -> None:
        self._wanted = frames
        self._frames: list[bytes] = []
        self._actions: list[NDArray[np.float32]] = []

    @property
    def actions(self) -> NDArray[np.float32]:
        """All executed actions, float32 (steps, D); (0, 0) if there was none."""
        return np.stack(self._actions) if self._actions else np.zeros((0, 0), np.float32)

    def started(self, world: World) -> None:
        """Keep the first view."""
        self._keep(world)

    def executed(self, world: World, action: NDArray[np.float32]) -> None:
        """Keep `action` and the view after it."""
        self._actions.append(action)
        self._keep(world)

    def _keep(self, world: World) -> None:
        if self._wanted:
            self._frames.append(encode_jpeg(world.render(CAMERA)))

    def write_video(self, folder: Path, key: TrialKey) -> str:
        """Write the frames and return the video's path inside `folder` ("" if there are none)."""
        if not self._frames:
            return ""
        path = Path(VIDEOS) / f"{key.slug}.mp4"
        replace_file(folder / path, encode_mp4([decode_jpeg(f) for f in self._frames]))
        return str(path)


def encode_jpeg(image: NDArray[np.uint8], quality: int = 92) -> bytes:
    """`image` uint8 (height, width, 3) as JPEG."""
    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(image).save(buffer, "JPEG", quality=quality)
    return buffer.getvalue()


def decode_jpeg(data: bytes) -> NDArray[np.uint8]:
    """The image that `encode_jpeg` wrote."""
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"), dtype=np.uint8)


def encode_mp4(frames: list[NDArray[np.uint8]], fps: int = FPS) -> bytes:
    """`frames`, uint8 (height, width, 3) of one even size, as an H.264 file."""
    import av

    buffer = io.BytesIO()
    options = {"movflags": "faststart"}
    with av.open(buffer, "w", format="mp4", options=options) as container:
        stream: Any = container.add_stream("libx264", rate=fps)
        stream.height, stream.width = frames[0].shape[:2]
        stream.pix_fmt = "yuv420p"
        stream.options = {"crf": "23", "preset": "veryfast"}
        stream.codec_context.thread_count = 1
        for frame in frames:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(frame, format="rgb24")))
        container.mux(stream.encode())
    return buffer.getvalue()
