"""vla-eval's model servers (AllenAI's evaluation harness), as its RoboTwin benchmark talks to them.

Messages are msgpack, arrays in them with text keys; `encode` writes one observation.

The server keeps the chunk and answers one action an observation, or a whole chunk if it was
configured without chunking; both are understood. A trial begins with `episode_start`, which has no
answer: an error in it comes later, in place of an action. So an error or an action with another
number than the observation's ends the connection here, and every trial begins on the safe side.
"""

import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from robospa.action_space import SIX_JOINT_ARMS, ActionSpace
from robospa.clients.chunks import (
    AnyModelOptions,
    Count,
    as_chunk,
    camera_names,
    invert_grippers,
    refuse_unread,
)
from robospa.clients.dialect import Answer, ConnectionParams, Dialect, Probe, StatelessSession
from robospa.clients.numpy_msgpack import MsgpackSocket, text_form
from robospa.observation import CameraSpec, Observation
from robospa.protocol.errors import HandshakeError, ServerError, json_values, printable
from robospa.protocol.options import option
from robospa.protocol.policy import TrialInfo

CAMERAS = {"head": "head_camera", "left_wrist": "left_camera", "right_wrist": "right_camera"}
PROTOCOL = 1

WARNINGS = (
    "most vla-eval servers answer one action an observation: then every action needs rendering and "
    "sending; a server started without chunk_size answers whole chunks, of which the first action "
    "alone is executed, as vla-eval's own runner does (`execute=none` for all)",
    "joints are sent as joint_state alone, as vla-eval's own runner does; its pi0, LeRobot, OFT, "
    "GR00T and starVLA servers look for `state` and take zeros without it: give them "
    "`state_keys=joint_state,state,states`; its X-VLA server takes joints of that name for a pose",
    "models of vla-eval take images in the order they come, whatever their names: `cameras` must "
    "be the order of training",
    "whether 1 is an open or a closed gripper is invisible on the wire: see `grippers`",
)


@dataclass(frozen=True)
class VlaEvalClientOptions(AnyModelOptions):
    """What a vla-eval server does not say."""

    grippers: str = option("open", "what 1 means in an answered gripper", ("open", "closed"))
    cameras: str = option("head,left_wrist,right_wrist", "our cameras to send, in this order")
    state_keys: str = option("joint_state", "names under which the joints are sent")
    execute: Count | None = option(
        1,
        "actions executed before the next query; none for all. vla-eval's own runner executes one",
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        self.views  # noqa: B018

    @property
    def views(self) -> tuple[str, ...]:
        """Our cameras in the order they are sent."""
        return camera_names(self.cameras)


def encode(observation: Observation, options: VlaEvalClientOptions) -> dict[str, object]:
    """The payload of one `observation`."""
    images = observation["images"]
    sent: dict[str, object] = {
        "images": {CAMERAS[name]: images[name] for name in options.views},
        "task_description": observation.get("instruction", ""),
    }
    state = np.asarray(observation["state"], np.float64)
    return {**sent, **{key: state for key in options.state_keys.split(",") if key}}


class VlaEvalSession(StatelessSession):
    """One WebSocket, which is one session of the server."""

    def __init__(self, params: ConnectionParams, options: VlaEvalClientOptions) -> None:
        self._options, self._joints = options, SIX_JOINT_ARMS
        self._number = 0
        self._socket = MsgpackSocket(params, text_form)
        cameras = tuple(CameraSpec(name) for name in options.views)
        spec = options.spec_of("vla-eval", cameras=cameras)
        number = self._send("hello", {"harness_version": "robospa", "protocol_version": PROTOCOL})
        greeting = self._answer("hello", number, params.timeouts.hello)
        theirs = greeting.get("protocol_version")
        if theirs != PROTOCOL:
            self.close()
            raise HandshakeError(
                f"{params.endpoint.url} speaks version {str(theirs)[:40]} of vla-eval's protocol, "
                f"not {PROTOCOL}"
            )
        name = str(greeting.get("model_server", ""))
        announced = {key: json_values(greeting[key]) for key in ANNOUNCED if key in greeting}
        server = printable(f"{name} {greeting.get('harness_version', '')}", 200)
        warnings = (*WARNINGS, *_doubts(announced, options))
        super().__init__("vla-eval", spec, options, warnings, server=server, said=announced)

    def reset(self, id: int, trial: TrialInfo) -> None:
        self._joints = trial.joints
        task = {
            "name": trial.task,
            "suite": "robotwin",  # servers choose settings by it
            "seed": trial.policy_seed,
            "episode_idx": 0,
            "instruction": trial.instruction,
        }
        self._send("episode_start", {"task": task})

    def infer(self, id: int, observation: Observation, timeout: float) -> Answer:
        number = self._send("observation", encode(observation, self._options))
        answer = self._answer("action", number, timeout)
        refuse_unread(answer, ("actions", "action"))
        chunk = as_chunk(answer.get("actions", answer.get("action")))
        if isinstance(chunk, np.ndarray) and chunk.ndim == 1:
            chunk = chunk[None]
        if self._options.grippers == "closed":
            chunk = invert_grippers(chunk, ActionSpace(self._options.space, self._joints))
        return chunk, {}

    def end(self, id: int, outcome: Mapping[str, object]) -> None:
        self._send("episode_end", {"metrics": {"success": bool(outcome.get("success"))}})

    def close(self) -> None:
        self._socket.close()

    def _send(self, kind: str, payload: dict[str, object]) -> int:
        self._number += 1
        message = {"type": kind, "payload": payload, "seq": self._number, "timestamp": time.time()}
        self._socket.send(message)
        return self._number

    def _answer(self, expected: str, number: int, timeout: float) -> Mapping[str, object]:
        """The payload of the answer of type `expected` to message `number`."""
        answer = self._socket.receive(timeout, expected)
        kind, body = answer.get("type"), answer.get("payload")
        if not isinstance(body, Mapping):
            raise self._socket.violation("its answer is no message of vla-eval")
        if kind == "error":
            text = str(body.get("error", "no reason given"))
            what = "an error"
            if (
                answer.get("seq") != number
            ):  # of `episode_start`: the observation's is still to come
                self.close()
                what = "an error of an earlier message"
            raise ServerError(what, text, True, self._socket.url)
        if answer.get("seq") != number:
            raise self._socket.violation(f"answer {answer.get('seq')} came to message {number}")
        if kind != expected:
            raise self._socket.violation(f"it answered {kind} instead of {expected}")
        return body


STATE_NAMES = ("state", "states")
"""Names of a state that its model servers look for and its RoboTwin benchmark does not send."""
ANNOUNCED = ("observation_params", "action_spec", "observation_spec", "capabilities")


def _doubts(announced: Mapping[str, object], options: VlaEvalClientOptions) -> Iterator[str]:
    """What the server announces of its state and actions and these options do not fit."""
    read, parts = announced.get("observation_spec"), announced.get("action_spec")
    reads = [name for name in STATE_NAMES if isinstance(read, Mapping) and name in read]
    for name in reads:
        if name not in options.state_keys.split(","):
            yield (
                f"the server announces that it reads {name!r}, which is not sent: give it the "
                f"joints by state_keys={options.state_keys},{name} if it was trained with them"
            )
    named = parts if isinstance(parts, Mapping) else {}
    sizes = {name: part.get("dims") for name, part in named.items() if isinstance(part, Mapping)}
    known = [size for size in sizes.values() if isinstance(size, int)]
    width = options.columns(options.space)
    if known and all(known) and width not in (None, sum(known)):
        listed = ", ".join(f"{name} {size}" for name, size in sizes.items())
        yield (
            f"the server announces {sum(known)} numbers an action ({listed}), but {options.space} "
            f"actions have {width}"
        )


def recognise(probe: Probe) -> bool:
    """Its health page is like no other's."""
    answer = probe.http("GET", "/health")
    return answer.status == 200 and answer.json() == {"status": "ok"}


DIALECT = Dialect(
    server="a vla-eval model server",
    scheme="vla-eval",
    wire="websocket",
    options=VlaEvalClientOptions,
    open_session=VlaEvalSession,
    recognise=recognise,
    sign="its /health answers status ok",
    deciding_options={"gripper inverted": "grippers"},
)
