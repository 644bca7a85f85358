"""openpi's dialect: pi0, pi0.5 and whatever else runs behind `serve_policy`.

The translation itself is `robospa.protocol.openpi`, because our server speaks this dialect too.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import TYPE_CHECKING

from robospa.clients.token_budget import check_budget
from robospa.protocol.errors import DecodeError
from robospa.protocol.openpi import CAMERA_NAMES, OpenPiOptions, OpenPiSession
from robospa.protocol.options import option, plain_options
from robospa.protocol.policy import CameraSpec, PolicySpec
from robospa.protocol.transport import Address, Transport

if TYPE_CHECKING:
    from robospa.clients import Line
    from robospa.protocol.client import WireClient

WARNINGS = (
    "adapt_to_pi is invisible on the wire: the served config must have adapt_to_pi=False for "
    "data in RoboTwin's conventions, or joint signs and grippers will be wrong",
    "openpi's sampling noise depends on the order of requests and cannot be seeded from here: two "
    "runs will differ",
)


@dataclass(frozen=True)
class Options:
    """What `serve_policy` does not say."""

    cameras: str = option("head,left_wrist,right_wrist", "our cameras to send, comma separated")
    names: str = option("", "other camera names at the server, such as head:cam_top,front:cam_low")
    state: str = option("commanded", "which joints to send", ("commanded", "measured"))
    horizon: int = option(50, "actions in a chunk, at most")
    execute: int | None = option(None, "actions executed before the next query; none for all")
    action_dim: int = option(14, "columns of a chunk")
    text_budget: int | None = option(
        150,
        "tokens that the model keeps of an instruction: pi0.5 has 200 for it and the state "
        "together, pi0 fewer",
    )
    extra: str = option("{}", "JSON map sent along at the top level of every observation")

    def __post_init__(self) -> None:
        """ValueError for options that cannot be."""
        check_budget(self.text_budget)
        try:
            self.convention()
        except DecodeError as error:
            raise ValueError(f"options that cannot be: {error}") from error

    def convention(self) -> OpenPiOptions:
        """The same as the translation wants it."""
        try:
            extra = json.loads(self.extra)
        except (ValueError, RecursionError):
            extra = None
        if not isinstance(extra, dict):
            raise ValueError(f"option extra={self.extra[:80]!r} is not a JSON map")
        spec = PolicySpec(
            name="openpi",
            cameras=tuple(CameraSpec(name) for name in self.cameras.split(",") if name),
            state=self.state,
            horizon=self.horizon,
            execute=self.execute,
            action_dim=self.action_dim,
        )
        names = dict(CAMERA_NAMES)
        for pair in filter(None, self.names.split(",")):
            ours, colon, theirs = pair.partition(":")
            if ours not in CAMERA_NAMES or not colon or not theirs:
                raise ValueError(f"option names: {pair!r} is not of the form camera:name")
            names[ours] = theirs
        return OpenPiOptions(PolicySpec.from_json(spec.to_json()), names, extra)


def open_session(line: Line, options: Options) -> WireClient:
    """A session with the server at `line.target`."""
    convention = options.convention()
    transport = Transport(websocket_address(line), line.timeouts, line.limits, None)
    try:
        session = OpenPiSession(transport, convention, line.timeouts, line.limits)
    except BaseException:
        transport.close()
        raise
    session.hello["options"] = plain_options(options)
    session.hello["warnings"] = list(WARNINGS)
    session.hello["text_budget"] = options.text_budget
    return session


def websocket_address(line: Line) -> Address:
    """The ws:// or wss:// address behind any WebSocket dialect's URL."""
    target = line.target
    host = f"[{target.host}]" if ":" in target.host else target.host
    scheme = "wss" if target.secure else "ws"
    return Address(f"{scheme}://{host}:{target.port}{target.path}", line.token, line.ssl)
