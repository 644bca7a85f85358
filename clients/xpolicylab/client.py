"""XPolicyLab's policy server: one WebSocket protocol in front of some forty policies.

    ours                       payload.observation (msgpack, arrays as msgpack-numpy writes them)
    images.head                vision.cam_head.color           (240, 320, 3) uint8 RGB
    images.left_wrist          vision.cam_left_wrist.color
    images.right_wrist         vision.cam_right_wrist.color
    state (14,)                state.left_arm_joint_state (6,), left_ee_joint_state (1,), right..
    ee (2, 8)                  state.left_ee_pose (7,) x y z qw qx qy qz, left_tcp_pose, right..
    instruction                instruction, instructions

Answered is a list of maps, one an action (`robospa.clients.xpolicylab.actions`). Every message has
an id, which its answer must repeat. A message that the server cannot read is never answered: then
the deadline is the only news.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timezone

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ARMS, POSE, SIX_JOINT_ARMS, ActionSpace
from robospa.clients.chunks import HORIZON, check_horizon, invert_grippers, refuse_unread
from robospa.clients.dialect import ConnectionParams, Dialect
from robospa.clients.msgpack_socket import MsgpackSocket
from robospa.clients.numpy_msgpack import binary_form
from robospa.clients.probe import Probe
from robospa.clients.robot_option import RobotOption
from robospa.clients.token_budget import BUDGET, check_budget
from robospa.clients.xpolicylab.actions import read_actions
from robospa.observation import Observation
from robospa.protocol.errors import ServerError, printable
from robospa.protocol.options import option, plain_options
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.rotations import quaternion_to_matrix

CAMERAS = {"head": "cam_head", "left_wrist": "cam_left_wrist", "right_wrist": "cam_right_wrist"}
TCP_AHEAD = 0.12
"""The tool centre point is this far [m] along the x axis of the end-effector frame."""

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
class XPolicyLabClientOptions(RobotOption):
    """What XPolicyLab's server does not say."""

    space: str = option(
        "joint", "the action_type that the policy is configured with", ("joint", "ee")
    )
    grippers: str = option("open", "what 1 means in an answered gripper", ("open", "closed"))
    frequency: int = option(30, "control frequency [Hz] sent in additional_info")
    state: str = option("commanded", "which joints to send", ("commanded", "measured"))
    horizon: int | None = option(None, HORIZON)
    execute: int | None = option(None, "actions executed before the next query; none for all")
    evaluation_id: str = option("robospa", "name of the evaluation in every message")
    text_budget: int | None = option(None, BUDGET)

    def __post_init__(self) -> None:
        """ValueError for options that cannot be."""
        check_horizon(self.horizon, self.execute)
        check_budget(self.text_budget)
        if not 0 < self.frequency < 10_000:
            raise ValueError(f"option frequency={self.frequency} is no frequency in Hz")


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


class XPolicyLabSession:
    """One WebSocket."""

    def __init__(self, params: ConnectionParams, options: XPolicyLabClientOptions) -> None:
        self._options, self._timeouts = options, params.timeouts
        self._trial: dict[str, object] = {}
        self._joints = SIX_JOINT_ARMS
        self._ids: dict[str, object] = {}
        self.spec = PolicySpec(
            name="xpolicylab",
            state=options.state,
            action=options.space,
            horizon=options.horizon,
            execute=options.execute,
            embodiments=(options.embodiment,),
            action_dim=options.columns(options.space),
            text_budget=options.text_budget,
        )
        self._socket = MsgpackSocket(params, binary_form)
        greeting = self._call(0, "hello", "hello_ack", {}, params.timeouts.hello)
        self.hello: dict[str, object] = {
            "dialect": "xpolicylab",
            "server": printable(str(greeting.get("server", "")), 200),
            "spec": self.spec.to_json(),
            "options": plain_options(options),
            "warnings": list(WARNINGS),
        }

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

    def infer(
        self, id: int, observation: Observation, timeout: float
    ) -> tuple[object, Mapping[str, float]]:
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
        name = f"{id}-{kind}"
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
    shared_state=True,
    deciding_options={
        "measured state": "state",
        "gripper inverted": "grippers",
    },
)
