"""A model's encoding of state and actions: joints, poses, or the 20 numbers of X-VLA.

Shared by the servers of X-VLA, whose poses have conventions that no shape shows: which quaternion
order was read in training, how the rotation's six numbers are laid out, and that after the first
query the last command executed stands for what is measured.

The 20 are, per arm, position, six of a rotation (the first two columns of its matrix), gripper.
RoboTwin's checkpoints have the six interleaved (r00 r01 r10 r11 r20 r21), LIBERO's one column after
the other. RoboTwin's quaternions are w x y z, but its X-VLA scripts read them as x y z w, in
training as in evaluation; for such checkpoints the same slip, once on the way in and once on the
way out, must be kept (`order="xyzw"`). It cancels exactly.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ActionSpace
from robospa.clients.chunks import last_executed
from robospa.clients.model_policy import Chunk, Query
from robospa.geometry import Array, matrix_to_quaternion, quaternion_to_matrix
from robospa.protocol.errors import PolicyAnswerError

ORDERS = ("xyzw", "wxyz")
LAYOUTS = ("interleaved", "columns")
ARM = 10
"""Numbers per arm in the 20: position 3, rotation 6, gripper 1."""

PARALLEL = 1e-6
"""Sine of the angle between two columns below which they name no rotation."""


def encode_rotation(quaternion: Array, order: str, layout: str) -> Array:
    """(..., 4) w x y z to the six numbers (..., 6)."""
    read = quaternion if order == "wxyz" else np.roll(quaternion, 1, axis=-1)
    columns = quaternion_to_matrix(np.asarray(read, dtype=float))[..., :2]
    flat = columns if layout == "interleaved" else np.swapaxes(columns, -1, -2)
    return flat.reshape(*columns.shape[:-2], 6)


def decode_rotation(six: Array, order: str, layout: str) -> Array:
    """The six numbers (..., 6) of any length to (..., 4) w x y z, made orthonormal first.

    Not finite where the six name no rotation (a zero or two parallel columns).
    """
    shape = six.shape[:-1]
    if layout == "interleaved":
        first, second = six.reshape(*shape, 3, 2)[..., 0], six.reshape(*shape, 3, 2)[..., 1]
    else:
        first, second = six[..., :3], six[..., 3:]
    with np.errstate(divide="ignore", invalid="ignore"):
        a = first / np.linalg.norm(first, axis=-1, keepdims=True)
        rest = second - np.sum(a * second, axis=-1, keepdims=True) * a
        length = np.linalg.norm(rest, axis=-1, keepdims=True)
        # What rounding leaves of two parallel columns points anywhere.
        real = length > PARALLEL * np.linalg.norm(second, axis=-1, keepdims=True)
        b = np.where(real, rest / length, np.nan)
        matrix = np.stack([a, b, np.cross(a, b)], axis=-1)
        read = matrix_to_quaternion(matrix)
    return read if order == "wxyz" else np.roll(read, -1, axis=-1)


def poses_to_ee6d(poses: NDArray[np.floating[Any]], order: str, layout: str) -> Array:
    """(2, 8) poses with gripper 0..1 open, to the 20 numbers; grippers become 1 - 2 g."""
    pose = np.asarray(poses, dtype=float)
    rotation = encode_rotation(pose[:, 3:7], order, layout)
    return np.concatenate([pose[:, :3], rotation, 1 - 2 * pose[:, 7:]], axis=1).reshape(2 * ARM)


def ee6d_to_actions(
    chunk: NDArray[np.floating[Any]], order: str, layout: str, closed_above: float
) -> NDArray[np.float32]:
    """(T, 20) to our `ee` actions (T, 16), grippers open (1) or closed (0).

    Raises PolicyAnswerError if six numbers name no rotation.
    """
    arms = np.asarray(chunk, dtype=float).reshape(len(chunk), 2, ARM)
    rotation = decode_rotation(arms[..., 3:9], order, layout)
    if np.isfinite(arms).all() and not np.isfinite(rotation).all():
        raise PolicyAnswerError(
            "the policy answered a rotation of zero or parallel columns, which is none; check "
            "option rotation and what the model was trained on"
        )
    closed = arms[..., 9:] > closed_above
    grippers = np.where(np.isnan(arms[..., 9:]), np.nan, 1.0 - closed)
    poses = np.concatenate([arms[..., :3], rotation, grippers], axis=-1)
    with np.errstate(over="ignore"):
        return poses.reshape(len(chunk), ActionSpace("ee").width).astype(np.float32)


SPACES = {"joint": ActionSpace("joint").width, "ee": ActionSpace("ee").width, "ee6d": 2 * ARM}
"""Numbers per action, by space; of joints those of six-joint arms."""


@dataclass(frozen=True)
class StateEncoding:
    """How a model writes poses and grippers; the fields are those of its server's options."""

    space: str
    quaternions: str = "xyzw"
    rotation: str = "interleaved"
    proprio: str = "commanded"
    grippers: str = "open"
    closed_above: float = 0.7

    def state(self, query: Query, space: str | None = None) -> NDArray[np.float32]:
        """The state in `space` (that of the actions unless given), float32 (D,), (16,), (20,)."""
        space, last = space or self.space, None
        if space == self.space and self.proprio != "measured":  # the last command stands for it
            done = int(query.observation["step"]) - int(query.memory.get("asked_at", 0))
            last = last_executed(query.memory.get("chunk"), done)
        if space == "joint":
            joints = np.array(query.observation["state"] if last is None else last, np.float32)
            if self.grippers == "closed":
                grippers = ActionSpace("joint", query.trial.joints).grippers
                joints[grippers] = 1 - 2 * joints[grippers]
            return joints
        poses = np.asarray(query.observation["ee"] if last is None else last.reshape(2, 8))
        if space == "ee":
            return poses.astype(np.float32).reshape(-1)
        return poses_to_ee6d(poses, self.quaternions, self.rotation).astype(np.float32)

    def actions(self, query: Query, answer: NDArray[Any]) -> Chunk:
        """Our actions from a model's (T, D), which are remembered as the last command."""
        joint = self.space == "joint"
        width = ActionSpace("joint", query.trial.joints).width if joint else SPACES[self.space]
        if answer.ndim != 2 or answer.shape[1] != width:
            raise PolicyAnswerError(
                f"the model answered {answer.shape}, but space {self.space} has {width} numbers "
                "per action; is it a fine-tune in another space?"
            )
        if self.space == "ee6d":
            chunk = ee6d_to_actions(answer, self.quaternions, self.rotation, self.closed_above)
        else:
            chunk = np.array(answer, np.float32)
            if joint and self.grippers == "closed":  # where ours say open
                columns = ActionSpace("joint", query.trial.joints).grippers
                closed = chunk[:, columns]
                chunk[:, columns] = np.where(np.isnan(closed), np.nan, closed <= self.closed_above)
        query.memory["chunk"], query.memory["asked_at"] = chunk, int(query.observation["step"])
        return chunk
