"""Our own protocol, `robospa.v1`; a server that does not know it is taken for openpi's."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from robospa.clients.openpi import client as openpi
from robospa.protocol.client import websocket_opener
from robospa.protocol.options import plain_options

if TYPE_CHECKING:
    from robospa.clients import Line
    from robospa.protocol.client import WireClient


@dataclass(frozen=True)
class Options(openpi.Options):
    """Used only if the server turns out to speak openpi's dialect; ours tells everything."""


def open_session(line: Line, options: Options) -> WireClient:
    """A session in the dialect that the server selects."""
    opener = websocket_opener(
        openpi.websocket_address(line), line.timeouts, line.limits, options.convention()
    )
    session = opener()
    if session.hello["dialect"] == "openpi":
        session.hello["options"] = plain_options(options)
        session.hello["warnings"] = list(openpi.WARNINGS)
        session.hello["text_budget"] = options.text_budget
    return session
