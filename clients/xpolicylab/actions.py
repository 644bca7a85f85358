"""What policies of XPolicyLab answer, as our chunk: read as RoboTwin's client of it reads them.

    joint      left_arm_joint_state (6,), left_ee_joint_state (1,), and the same for the right arm
    ee         left_ee_pose (7,) x y z qw qx qy qz, left_ee_joint_state (1,), and for the right arm

An answer is a list of maps, one an action; a single map; rows of numbers (T, D); or one row. A map
has the names above or others in `NAMES`, the first of which wins; names of the space that was not
asked for are ignored, as there. Any other name is refused, because what it holds would be lost. An
arm or a gripper that an action does not name stays as it was commanded last.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ARMS
from robospa.clients.chunks import NAMED, as_chunk, refuse_unread
from robospa.protocol.errors import PolicyAnswerError, printable
from robospa.registry import did_you_mean

BODIES = {"joint": "arm_joint_state", "ee": "ee_pose"}
"""What moves an arm in each space, under its usual name without the arm."""
NAMES = {
    "left_arm_joint_state": (
        "left_arm_joint",
        "left_joint_state",
        "arm_joint_state",
        "joint_state",
    ),
    "right_arm_joint_state": ("right_arm_joint", "right_joint_state"),
    "left_ee_pose": ("left_endpose", "ee_pose"),
    "right_ee_pose": ("right_endpose",),
    "left_ee_joint_state": ("left_gripper", "left_gripper_pos", "ee_joint_state"),
    "right_ee_joint_state": ("right_gripper", "right_gripper_pos"),
}
"""Other names of each part of an action, in the order in which they are looked for."""
SPACES = {"joint": "joint", "qpos": "joint", "ee": "ee", "endpose": "ee"}
"""The space that an `action_type` names."""
KNOWN = {"action_type", *NAMES, *(other for others in NAMES.values() for other in others)}


def read_actions(answer: object, seen: Mapping[str, NDArray[np.float32]], space: str) -> object:
    """The chunk (T, D) in an answer; anything that is none is returned, to be refused as one.

    `seen`: joints, grippers and poses at the query, by their usual names. Raises PolicyAnswerError
    for an action that cannot be read whole.
    """
    if isinstance(answer, Mapping) and "actions" in answer:
        refuse_unread(answer, ("actions", "latency_ms"))
        return read_actions(answer["actions"], seen, space)
    if isinstance(answer, Mapping):
        answer = [answer]
    if isinstance(answer, list) and any(isinstance(item, Mapping) for item in answer):
        return _from_maps(answer, dict(seen), space)
    chunk = as_chunk(answer)
    if isinstance(chunk, np.ndarray) and chunk.ndim == 1 and len(chunk):
        chunk = chunk[None]  # one action
    return chunk


def _from_maps(
    actions: list[object], last: dict[str, NDArray[np.float32]], space: str
) -> NDArray[np.float32]:
    parts = [f"{arm}_{part}" for arm in ARMS for part in (BODIES[space], "ee_joint_state")]
    rows = []
    for action in actions:
        found = _named(action, space)
        for part in parts:
            if part in found:
                last[part] = _numbers(part, found[part], len(last[part]))
        rows.append(np.concatenate([last[part] for part in parts]))
    return np.stack(rows)


def _named(action: object, space: str) -> dict[str, object]:
    """The parts of one action by their usual names."""
    if not isinstance(action, Mapping):
        raise PolicyAnswerError(
            f"the policy answered a list of maps and a {type(action).__name__} among them"
        )
    unknown = sorted(str(name) for name in action if name not in KNOWN)
    if unknown:
        near = did_you_mean(unknown[0][:NAMED], KNOWN)
        raise PolicyAnswerError(
            f"the policy answered an action with {printable(', '.join(unknown), NAMED)}, which "
            f"XPolicyLab's RoboTwin client does not read either; {near}the usual names are "
            f"{', '.join(NAMES)}"
        )
    stated = str(action.get("action_type", space)).lower()
    if SPACES.get(stated) != space:
        remedy = f"; write ?space={SPACES[stated]}" if stated in SPACES else ""
        raise PolicyAnswerError(
            f"the policy answered an action of action_type {stated[:40]!r}, not {space}{remedy}"
        )
    found = {}
    for name, others in NAMES.items():
        first = next((one for one in (name, *others) if one in action), None)
        if first is not None and action[first] is not None:
            found[name] = action[first]
    bodies = [f"{arm}_{BODIES[space]}" for arm in ARMS]
    if not any(body in found for body in bodies):
        names = ", ".join(sorted(map(str, action))) or "nothing"
        raise PolicyAnswerError(
            f"the policy answered an action of {names}, without {' or '.join(bodies)}; is option "
            "space its action_type?"
        )
    return found


def _numbers(name: str, value: object, count: int) -> NDArray[np.float32]:
    try:
        numbers = np.ravel(np.asarray(value))
    except ValueError as error:
        raise PolicyAnswerError(f"the policy answered a {name} of uneven lists") from error
    if numbers.dtype.kind not in "iuf" or len(numbers) != count:
        raise PolicyAnswerError(
            f"the policy answered {len(numbers)} values of {numbers.dtype} as {name}, not {count} "
            "numbers"
        )
    with np.errstate(over="ignore"):
        return numbers.astype(np.float32)
