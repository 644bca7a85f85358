"""OpenVLA-OFT behind its own `deploy.py`: POST /act, JSON with arrays as json_numpy writes them.

Answered is a list of T actions, each an array of 14 joint targets. Images of any size are brought
to 224x224 by the server, as in its training. It says nothing of itself, has no reset, and answers
every failure with HTTP 200 and the text "error".
"""

from dataclasses import dataclass

import numpy as np

from robospa.clients.chunks import ChunkOptions, Targets, as_chunk
from robospa.clients.dialect import Answer, ConnectionParams, Dialect, Probe
from robospa.clients.http import TEXT, HttpSession, chunk_of, dumps
from robospa.observation import Observation
from robospa.protocol.errors import PolicyAnswerError
from robospa.protocol.options import option
from robospa.protocol.policy import TrialInfo

SILENT = (
    "OpenVLA-OFT's server gives no reason: its log has it (a state of another size than it takes, "
    "because its command line names no 'aloha', looks like this)"
)
ONE_ARM = 7
"""Numbers of an action where the server took itself for LIBERO or Bridge."""

WARNINGS = (
    "whether the model answers absolute joints or changes of them (use_relative_actions) is "
    "invisible on the wire: `actions` must be what it was trained with",
    "unnorm_key and center_crop are options of the server: a wrong one makes no error",
)


@dataclass(frozen=True)
class OftClientOptions(ChunkOptions):
    """What OpenVLA-OFT's server does not say."""

    state: str = option("commanded", "which joints to send", ("commanded", "measured"))
    actions: str = option(
        "absolute",
        "`relative`: each action is added to the previous target, the first to the joints at the "
        "trial's start, as with use_relative_actions",
        ("absolute", "relative"),
    )


class OftSession(HttpSession):
    """One kept-alive HTTP connection, and with relative actions the targets of the trial."""

    def __init__(self, params: ConnectionParams, options: OftClientOptions) -> None:
        self._targets = Targets("last" if options.actions == "relative" else "none")
        spec = options.spec_of(
            "openvla-oft", state=options.state, action_dim=options.columns("joint")
        )
        super().__init__(params, "openvla-oft", spec, options, WARNINGS, (TEXT, SILENT))

    def reset(self, id: int, trial: TrialInfo) -> None:
        self._targets.begin()

    def infer(self, id: int, observation: Observation, timeout: float) -> Answer:
        answer = self.ask(dumps(body(observation)).encode(), timeout)
        return self._targets.of(read_chunk(answer), observation), {}


def body(observation: Observation) -> dict[str, object]:
    """One query, arrays as they are; the server takes every name with "wrist" in their order."""
    images = observation["images"]
    return {
        "full_image": images["head"],
        "left_wrist_image": images["left_wrist"],
        "right_wrist_image": images["right_wrist"],
        "state": np.asarray(observation["state"], np.float64),
        "instruction": observation.get("instruction", ""),
    }


def read_chunk(answer: object) -> object:
    """The chunk (T, D) in a list of arrays or of rows; anything else is returned, to be refused.

    Raises PolicyAnswerError for the seven numbers of one arm.
    """
    rows = [chunk_of(row) for row in answer] if isinstance(answer, list) else None
    chunk = chunk_of(answer) if rows is None else as_chunk(rows)
    if isinstance(chunk, np.ndarray) and chunk.ndim == 2 and chunk.shape[1] == ONE_ARM:
        raise PolicyAnswerError(
            f"the policy answered {ONE_ARM} numbers per action, those of one arm: OpenVLA-OFT "
            "takes the robot from the server's command line, so start deploy.py with 'aloha' in "
            "the checkpoint's path and without 'libero'"
        )
    return chunk


def recognise(probe: Probe) -> bool:
    """A request without an instruction fails before the model, and is answered 200 and "error"."""
    answer = probe.http("POST", "/act", b"{}")
    return answer.status == 200 and answer.body.strip() == b'"error"'


DIALECT = Dialect(
    server="OpenVLA-OFT's server",
    scheme="oft+http",
    secure_scheme="oft+https",
    wire="http",
    port=8777,
    options=OftClientOptions,
    open_session=OftSession,
    recognise=recognise,
    sign='it answers an empty question with 200 and "error"',
    deciding_options={"measured state": "state"},
)
