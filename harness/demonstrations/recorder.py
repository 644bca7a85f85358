"""Which instants of a trial become frames of its recording.

Officially a frame is kept at the start of every motion, every so many physics steps after that,
and at the motion's end. So here; a motion is an action. So a replay from frame to frame passes
through every corner of the recorded way, and closes the gripper where it was closed.

A frame is an action of whoever learns from it, so frames have to fit three quarters of the task's
step limit; none is longer than the 50 steps that an action takes in which nothing moves
(`benchmarks/demonstrations.py`). Nothing is drawn while a recording is made: a frame keeps a still
of a few kilobytes, to be drawn afterwards.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from robospa.harness.sim.motion import RATE
from robospa.harness.trial import Recorder
from robospa.harness.world import RenderableState, StepResult, World
from robospa.observation import CameraSpec
from robospa.protocol.policy import PolicySpec

STRIDE = 15
"""Physics steps (of 1/250 s) from one frame to the next: 16.67 Hz, as officially."""
KEYFRAMES = 0
"""In the place of a stride: frames only where the expert's own actions begin and end."""
STRIDES: Mapping[str, int] = {
    "Press_Stapler_Memory": 20,
    "Remember_Orientation_Restore": 20,
}
"""Of the tasks that need another: physics steps, a multiple of 5 (frames are taken at polls)."""


def frame_steps(task: str) -> int:
    """Physics steps from one frame to the next in recordings of `task`."""
    return STRIDES.get(task, STRIDE)


COMMANDED = PolicySpec("recorder", ())
MEASURED = PolicySpec("recorder", (), state="measured")
NOTHING = np.zeros(0, np.float32)


@dataclass(frozen=True)
class RecordedFrame:
    """One instant: the physics step since the trial's start, `commanded` and `measured` float32
    (D,) and `ee` (2, 8) as in an observation, what it looks like, and the objects as numbers (E,),
    of which there are none unless they were asked for."""

    step: int
    commanded: NDArray[np.float32]
    measured: NDArray[np.float32]
    ee: NDArray[np.float32]
    still: RenderableState
    environment_state: NDArray[np.float32]

    @property
    def time(self) -> float:
        """Simulated time since the trial's start [s]."""
        return self.step / RATE


class FrameRecorder(Recorder):
    """Keeps a frame every `stride` physics steps of an action, and at its end.

    A frame less than half a stride before an action's end is replaced by that one. `stride` is
    counted in polls: a multiple of 5. With `KEYFRAMES` for it, frames are kept only where actions
    begin and end.
    """

    def __init__(self, stride: int = STRIDE, environment_state: bool = False) -> None:
        self.stride = stride
        self._commanded = replace(COMMANDED, environment_state=environment_state)
        self.frames: list[RecordedFrame] = []
        """Those until now."""
        self._ended = 0
        """Physics step at which the last action ended."""

    def __len__(self) -> int:
        return len(self.frames)

    @property
    def commanded(self) -> NDArray[np.float32]:
        """(T, D): joints [rad] and grippers as last commanded at every frame."""
        return np.stack([frame.commanded for frame in self.frames])

    def columns(self) -> tuple[NDArray[np.float32], ...]:
        """`commanded`, `measured`, `ee` and `environment_state` of all frames."""
        rows = ((f.commanded, f.measured, f.ee, f.environment_state) for f in self.frames)
        return tuple(np.stack(of).astype(np.float32) for of in zip(*rows, strict=True))

    def started(self, world: World) -> None:
        """Keep the first frame, which need not be the trial's."""
        self._ended = round(world.snapshot().time * RATE)
        self._keep(world, self._ended)

    def polled(self, world: World, time: float) -> None:
        if self.stride == KEYFRAMES:
            return
        step = round(time * RATE)
        last = self.frames[-1]
        if step - last.step < self.stride:
            return
        # A rest is one frame, the one at its end: it is an action that lasts as long when replayed.
        if not np.array_equal(world.observe(COMMANDED)["state"], last.commanded):
            self._keep(world, step)

    def executed(self, world: World, action: NDArray[np.float32], done: StepResult) -> None:
        """Keep the action's last frame. Commands are read from the robot, as officially."""
        began, self._ended = self._ended, self._ended + done.physics_steps
        kept = self.frames[-1].step
        if began < kept and self._ended - kept < self.stride / 2:
            self.frames.pop()
        self._keep(world, self._ended)

    def _keep(self, world: World, step: int) -> None:
        seen, measured = world.observe(self._commanded), world.observe(MEASURED)["state"]
        objects = seen.get("environment_state", NOTHING)
        frame = RecordedFrame(step, seen["state"], measured, seen["ee"], world.still(), objects)
        self.frames.append(frame)


def drawn(
    frames: Sequence[RecordedFrame], cameras: Sequence[CameraSpec]
) -> Iterator[list[NDArray[np.uint8]]]:
    """The pictures (height, width, 3) of every frame, one a camera; nothing without cameras.

    A frame that looks like the one before has its pictures. Their world must not have loaded
    another scene.
    """
    if not cameras:
        return
    last: RenderableState | None = None
    images: list[NDArray[np.uint8]] = []
    for frame in frames:
        if frame.still != last:
            last, images = frame.still, frame.still.draw(cameras)
        yield images
