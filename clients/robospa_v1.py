"""Our own protocol, `robospa.v1`; a server that does not know it is taken for openpi's."""

from __future__ import annotations

from dataclasses import dataclass

from robospa.clients.detect import Probe
from robospa.clients.dialect import ConnectionParams, Dialect
from robospa.clients.openpi.client import (
    DECIDING_OPTIONS,
    OpenPiClientOptions,
    OpenPiSession,
)
from robospa.protocol.client import WireClient, open_wire
from robospa.protocol.transport import Transport


@dataclass(frozen=True)
class RobospaClientOptions(OpenPiClientOptions):
    """Used only if the server turns out to speak openpi's dialect; ours tells everything."""


def open_session(params: ConnectionParams, options: RobospaClientOptions) -> WireClient:
    """A connection in the dialect that the server selects."""
    return open_wire(
        params.websocket_address(),
        params.timeouts,
        params.limits,
        lambda transport: OpenPiSession(transport, options, params.timeouts, params.limits),
    )


def recognise(probe: Probe) -> bool:
    """It selects our subprotocol."""
    params = probe.params
    transport = Transport(params.websocket_address(), params.timeouts, params.limits)
    transport.close()
    return transport.subprotocol is not None


DIALECT = Dialect(
    server="a robospa.v1 server",
    scheme="ws",
    secure_scheme="wss",
    wire="websocket",
    options=RobospaClientOptions,
    open_session=open_session,
    recognise=recognise,
    also_reaches=("openpi",),
    deciding_options=DECIDING_OPTIONS,
)
