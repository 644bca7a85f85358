"""XPolicyLab's policy server: one WebSocket protocol in front of some forty policies.

Answered is a list of maps, one an action; a single map; rows of numbers (T, D); or one row. A map
has the names of `NAMES`; those of the space that was not asked for are ignored, as by RoboTwin's
client of it; any other name is refused, because what it holds would be lost. An arm or a gripper
that an action does not name stays as it was commanded last.

Every message has an id, which its answer must repeat, and which no other message ever had: since
August 2026 the server answers a known id as before, without asking the model. Failures and unknown
types are answered, a message that cannot be decoded is not: then the deadline is the only news.
"""

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timezone
from typing import Annotated
from uuid import uuid4

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from robospa.action_space import ARMS, POSE, SIX_JOINT_ARMS, ActionSpace
from robospa.clients.chunks import NAMED, AnyModelOptions, as_chunk, invert_grippers, refuse_unread
from robospa.clients.dialect import Answer, ConnectionParams, Dialect, Probe, StatelessSession
from robospa.clients.numpy_msgpack import MsgpackSocket, binary_form
from robospa.geometry import quaternion_to_matrix
from robospa.observation import Observation
from robospa.protocol.errors import HandshakeError, PolicyAnswerError, ServerError, printable
from robospa.protocol.options import option
from robospa.protocol.policy import TrialInfo
from robospa.registry import did_you_mean

BODIES = {"joint": "arm_joint_state", "ee": "ee_pose"}
"""What moves an arm in each space, under its usual name without the arm."""
LEFT_ARM = ("left_arm_joint", "left_joint_state", "arm_joint_state", "joint_state")
NAMES = {
    "left_arm_joint_state": LEFT_ARM,
    "right_arm_joint_state": ("right_arm_joint", "right_joint_state"),
    "left_ee_pose": ("left_endpose", "ee_pose"),
    "right_ee_pose": ("right_endpose",),
    "left_ee_joint_state": ("left_gripper", "left_gripper_pos", "ee_joint_state"),
    "right_ee_joint_state": ("right_gripper", "right_gripper_pos"),
}
"""Other names of each part of an action, in the order in which they are looked for; joints (6,),
poses (7,) x y z qw qx qy qz, grippers (1,)."""
SPACES = {"joint": "joint", "qpos": "joint", "ee": "ee", "endpose": "ee"}
"""The space that an `action_type` names."""
PART_NAMES = {"action_type", *NAMES, *(other for others in NAMES.values() for other in others)}


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
        parts = [f"{arm}_{part}" for arm in ARMS for part in (BODIES[space], "ee_joint_state")]
        last, rows = dict(seen), []
        for action in answer:
            found = _named(action, space)
            for part in parts:
                if part in found:
                    last[part] = _numbers(part, found[part], len(last[part]))
            rows.append(np.concatenate([last[part] for part in parts]))
        return np.stack(rows)
    chunk = as_chunk(answer)
    if isinstance(chunk, np.ndarray) and chunk.ndim == 1 and len(chunk):
        chunk = chunk[None]  # one action
    return chunk


def _named(action: object, space: str) -> dict[str, object]:
    """The parts of one action by their usual names."""
    if not isinstance(action, Mapping):
        raise PolicyAnswerError(
            f"the policy answered a list of maps and a {type(action).__name__} among them"
        )
    unknown = sorted(str(name) for name in action if name not in PART_NAMES)
    if unknown:
        near = did_you_mean(unknown[0][:NAMED], PART_NAMES)
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


CAMERAS = {"head": "cam_head", "left_wrist": "cam_left_wrist", "right_wrist": "cam_right_wrist"}
TCP_AHEAD = 0.12
"""The tool centre point is this far [m] along the x axis of the end-effector frame."""

UNKNOWN_TYPE = "unknown_message_type"
"""Code of an error that means another version of the protocol."""
KNOWN = {"actions", "latency_ms", "ok", "result", "action_type"}
"""What an answer may have: the actions, and remarks about them."""

WARNINGS = (
    "a model behind XPolicyLab's server is shared by all connections, so that it is given one "
    "trial at a time: start several servers for several workers",
    "XPolicyLab's protocol shows a policy only the observations at which it is asked: one that "
    "wants the frame before (RDT) gets that of its previous query instead",
    "whether a policy answers joints or poses is invisible on the wire: `space` must be the "
    "action_type it was configured with",
    "some adapters (X_VLA) answer 1 for a closed gripper: `grippers=closed` turns it round",
)


@dataclass(frozen=True)
class XPolicyLabClientOptions(AnyModelOptions):
    """What XPolicyLab's server does not say."""

    space: str = option(
        "joint", "the action_type that the policy is configured with", ("joint", "ee")
    )
    grippers: str = option("open", "what 1 means in an answered gripper", ("open", "closed"))
    frequency: Annotated[int, Meta(ge=1, le=10_000)] = option(
        30, "control frequency [Hz] sent in additional_info"
    )
    evaluation_id: str = option("robospa", "name of the evaluation in every message")


def encode(
    observation: Observation,
    options: XPolicyLabClientOptions,
    joints: tuple[int, int] = SIX_JOINT_ARMS,
) -> dict[str, object]:
    """`payload.observation` of one query."""
    instruction = observation.get("instruction", "")
    images = observation["images"]
    return {
        "data_format_version": "v1.0",
        "instruction": instruction,
        "instructions": [instruction] if instruction else [],
        "env_idx": 0,
        "vision": {
            theirs: {"color": images[ours], "shape": list(images[ours].shape[:2])}
            for ours, theirs in CAMERAS.items()
        },
        "state": robot_state(observation, joints),
        "additional_info": {"frequency": options.frequency},
    }


def robot_state(
    observation: Observation, joints: tuple[int, int] = SIX_JOINT_ARMS
) -> dict[str, NDArray[np.float32]]:
    """Joints, grippers and poses of both arms under XPolicyLab's names, float32."""
    state = np.asarray(observation["state"], np.float32)
    poses = np.asarray(observation["ee"], np.float32)[:, : len(POSE)]
    found: dict[str, NDArray[np.float32]] = {}
    for arm, columns in enumerate(ActionSpace("joint", joints).arms):
        name = columns.name
        found[f"{name}_arm_joint_state"] = state[columns.body]
        found[f"{name}_ee_joint_state"] = state[[columns.gripper]]
        found[f"{name}_ee_pose"] = poses[arm]
        axis = quaternion_to_matrix(poses[arm, 3:].astype(float))[:, 0]
        tcp = poses[arm, :3] + TCP_AHEAD * axis
        found[f"{name}_tcp_pose"] = np.concatenate([tcp, poses[arm, 3:]]).astype(np.float32)
    return found


def decode(
    answer: Mapping[str, object],
    observation: Observation,
    options: XPolicyLabClientOptions,
    joints: tuple[int, int] = SIX_JOINT_ARMS,
) -> object:
    """The chunk in the payload of an answer; raises PolicyAnswerError for what cannot be read."""
    refuse_unread(answer, KNOWN)
    seen, space = robot_state(observation, joints), ActionSpace(options.space, joints)
    if options.grippers == "open":
        return read_actions(answer.get("actions"), seen, options.space)
    for arm in ARMS:  # as the answer says them, so that a gripper that is not named stays
        seen[f"{arm}_ee_joint_state"] = 1 - seen[f"{arm}_ee_joint_state"]
    return invert_grippers(read_actions(answer.get("actions"), seen, options.space), space)


class XPolicyLabSession(StatelessSession):
    """One WebSocket."""

    def __init__(self, params: ConnectionParams, options: XPolicyLabClientOptions) -> None:
        self._options, self._timeouts = options, params.timeouts
        self._trial: dict[str, object] = {}
        self._joints = SIX_JOINT_ARMS
        self._ids: dict[str, object] = {}
        self._unique = uuid4().hex
        spec = options.spec_of("xpolicylab")
        self._socket = MsgpackSocket(params, binary_form)
        greeting = self._call(0, "hello", "hello_ack", {}, params.timeouts.hello)
        server = printable(str(greeting.get("server", "")), 200)
        super().__init__("xpolicylab", spec, options, WARNINGS, server=server)

    def reset(self, id: int, trial: TrialInfo) -> None:
        case, self._joints = trial.task, trial.joints
        self._trial = {
            "task_name": trial.task,
            "seed": trial.policy_seed,
            "instruction": trial.instruction,
            "action_type": self._options.space,
        }
        self._ids = {"action_case_id": case, "trial_id": trial.id}
        limit = self._timeouts.reset
        payload = {"action_case_id": case, **self._trial}
        with contextlib.suppress(ServerError):  # a hook that few models have; its own client too
            self._call(id, "prepare_case", "prepare_case_ack", payload, limit)
        payload = {"trial_id": self._ids["trial_id"], **self._trial}
        self._call(id, "reset", "reset_result", payload, limit)

    def infer(self, id: int, observation: Observation, timeout: float) -> Answer:
        payload = {"observation": encode(observation, self._options, self._joints)}
        step = int(observation["step"])
        answer = self._call(id, "infer", "infer_result", payload, timeout, step)
        spent = answer.get("latency_ms")
        timing = {"infer_ms": float(spent)} if isinstance(spent, int | float) else {}
        return decode(answer, observation, self._options, self._joints), timing

    def end(self, id: int, outcome: Mapping[str, object]) -> None:
        payload = {**self._ids, **self._trial, "success": bool(outcome.get("success", False))}
        self._call(id, "trial_end", "trial_end_ack", payload, self._timeouts.end)

    def close(self) -> None:
        self._socket.close()

    def _call(
        self, id: int, kind: str, expected: str, payload: object, timeout: float, step: int = 0
    ) -> Mapping[str, object]:
        """The payload of the answer of type `expected` to this message."""
        name = f"{self._unique}-{id}-{kind}"
        message = {
            "message_type": kind,
            "message_id": name,
            "evaluation_id": self._options.evaluation_id,
            **self._ids,
            "step": step,
            "sent_at": datetime.now(timezone.utc).isoformat(),
            "payload": payload,
        }
        self._socket.send(message)
        answer = self._socket.receive(timeout, expected)
        body = answer.get("payload")
        if not isinstance(body, Mapping) or "message_type" not in answer:
            raise self._socket.violation("its answer is no message of XPolicyLab")
        if answer.get("message_id") != name:
            raise self._socket.violation(f"answer {answer.get('message_id')!r} came to {name!r}")
        if answer["message_type"] == "error":
            text = str(body.get("message", "no reason given"))
            if str(body.get("code")).lower() == UNKNOWN_TYPE:
                raise HandshakeError(
                    f"{self._socket.url} runs another version of XPolicyLab, which does not know "
                    f"{kind} ({printable(text, NAMED)}): update it"
                )
            raise ServerError(str(body.get("code", "an error")), text, True, self._socket.url)
        if answer["message_type"] != expected:
            raise self._socket.violation(
                f"it answered {answer['message_type']} instead of {expected}"
            )
        return body


def recognise(probe: Probe) -> bool:
    """It answers a greeting."""
    XPolicyLabSession(probe.params, XPolicyLabClientOptions()).close()
    return True


DIALECT = Dialect(
    server="an XPolicyLab policy server",
    scheme="xpolicylab",
    wire="websocket",
    port=19000,
    options=XPolicyLabClientOptions,
    open_session=XPolicyLabSession,
    recognise=recognise,
    sign="it answers XPolicyLab's hello",
    shared_state=True,
    deciding_options={"measured state": "state", "gripper inverted": "grippers"},
)
