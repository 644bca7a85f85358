"""Acme's policy server: POST /predict, JSON.

    ours                 sent
    images.head          camera     (240, 320, 3) uint8 RGB, as json_numpy writes an array
    state (14,)          joints     list; grippers in per cent, 100 = open
    instruction          text

Answered is {"joints": (T, 14)} in the same units.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from robospa.clients.chunks import ChunkOptions, as_chunk
from robospa.clients.dialect import ConnectionParams, Dialect, Probe
from robospa.clients.http import HttpSession, dumps
from robospa.observation import CameraSpec, Observation
from robospa.protocol.errors import ProtocolViolation
from robospa.protocol.options import option

SCALE = np.where(np.isin(np.arange(14), [6, 13]), 100, 1).astype(np.float32)
"""Their numbers are ours times this."""


@dataclass(frozen=True)
class AcmeOptions(ChunkOptions):
    """What Acme's server does not say."""

    camera: str = option("head", "our camera to send", ("head", "front"))


class AcmeSession(HttpSession):
    """One connection."""

    path = "/predict"

    def __init__(self, params: ConnectionParams, options: AcmeOptions) -> None:
        self._camera = options.camera
        spec = options.spec_of("acme", cameras=(CameraSpec(options.camera),))
        warning = "Acme's server does not say which tasks its model was trained on"
        super().__init__(params, "acme", spec, options, [warning])

    def infer(
        self, id: int, observation: Observation, timeout: float
    ) -> tuple[object, Mapping[str, float]]:
        sent = {
            "camera": observation["images"][self._camera],
            "joints": (observation["state"] * SCALE).tolist(),
            "text": observation["instruction"],
        }
        answer = self.ask(dumps(sent).encode(), timeout)
        if not isinstance(answer, Mapping) or "joints" not in answer:
            raise ProtocolViolation("Acme's server did not answer 'joints'")
        chunk = as_chunk(answer["joints"])
        fits = isinstance(chunk, np.ndarray) and chunk.shape[-1:] == SCALE.shape
        return chunk / SCALE if fits else chunk, {}  # what does not fit is refused by the caller


def recognise(probe: Probe) -> bool:
    """Its start page gives its name."""
    return (probe.http("GET", "/").json() or {}).get("server") == "acme"


DIALECT = Dialect(
    server="Acme's server",
    scheme="acme+http",
    secure_scheme="acme+https",
    wire="http",
    port=7000,
    options=AcmeOptions,
    open_session=AcmeSession,
    recognise=recognise,
)
