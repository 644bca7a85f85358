"""openpi's dialect, in both directions: its client is served by us, its server evaluated by us.

The server sends one metadata map, then answers each observation map with a map that has
`actions`. A text frame is an error with the server's traceback. There is no reset, no request id
and no spec on the wire: the spec must be chosen at our side (`OpenPiOptions`), a new connection or
a new prompt begins a trial, and frames are counted to keep answer and question together.

    ours                        openpi (Aloha)
    images.head        HWC u8   images.cam_high         CHW u8
    images.left_wrist           images.cam_left_wrist
    images.right_wrist          images.cam_right_wrist
    state              (14,)    state
    instruction                 prompt
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.protocol.codec import Limits, decode, encode
from robospa.protocol.errors import DecodeError, EncodeError, ProtocolViolation, ServerError
from robospa.protocol.policy import Observation, PolicySpec, TrialInfo
from robospa.protocol.transport import Timeouts, Transport
from robospa.protocol.validate import as_said

CAMERA_NAMES = {
    "head": "cam_high",
    "left_wrist": "cam_left_wrist",
    "right_wrist": "cam_right_wrist",
    "front": "cam_low",
}
"""Our camera names and those of openpi's Aloha configurations."""


@dataclass(frozen=True)
class OpenPiOptions:
    """What an openpi server does not say about itself.

    `spec` defaults to three 320x240 cameras, 14 commanded joints, chunks of at most 50 joint
    actions, all executed. `cameras` maps our names to the server's; `extra` is sent along at the
    top level of every observation.
    """

    spec: PolicySpec = field(default_factory=lambda: PolicySpec(name="openpi", action_dim=14))
    cameras: Mapping[str, str] = field(default_factory=lambda: dict(CAMERA_NAMES))
    extra: Mapping[str, Any] = field(default_factory=dict)


class OpenPiSession:
    """One connection to an openpi server (client side)."""

    def __init__(
        self, transport: Transport, options: OpenPiOptions, timeouts: Timeouts, limits: Limits
    ) -> None:
        self._transport, self._options, self._limits = transport, options, limits
        metadata = self._receive(timeouts.hello, "metadata")
        self.spec = options.spec
        self.hello = {
            "dialect": "openpi",
            "metadata": as_said(metadata),
            "spec": self.spec.to_json(),
        }

    def reset(self, id: int, trial: TrialInfo) -> None:
        """Nothing to send: openpi policies keep no state between calls."""

    def infer(
        self, id: int, observation: Observation, timeout: float
    ) -> tuple[Any, Mapping[str, float]]:
        if self._transport.has_more():
            self.close()
            raise ProtocolViolation(f"{self._transport.url} sent what nobody asked for")
        self._transport.send(encode(to_openpi(observation, self._options), self._limits))
        answer = self._receive(timeout, "actions")
        actions = answer.get("actions")
        if isinstance(actions, np.ndarray) and actions.dtype.kind == "f":
            with np.errstate(over="ignore"):
                actions = actions.astype(np.float32)
        return actions, _timing(answer)

    def end(self, id: int, outcome: Mapping[str, Any]) -> None:
        """Nothing to send."""

    def close(self) -> None:
        self._transport.close()

    def _receive(self, timeout: float, what: str) -> dict[str, Any]:
        data = self._transport.receive(timeout, what)
        if isinstance(data, str):
            self.close()
            lines = data.strip().splitlines() or ["no text"]
            error = ServerError("openpi", lines[-1], True, self._transport.url)
            error.add_note(data)
            raise error
        try:
            value = decode(data, self._limits)
        except DecodeError as error:
            self.close()
            raise ProtocolViolation(f"{self._transport.url}: unreadable {what}: {error}") from error
        if not isinstance(value, dict):
            self.close()
            raise ProtocolViolation(f"{self._transport.url}: {what} is no map")
        return value


def _timing(answer: Mapping[str, Any]) -> dict[str, float]:
    for name in ("policy_timing", "server_timing"):
        times = answer.get(name)
        if isinstance(times, dict) and isinstance(times.get("infer_ms"), (int, float)):
            return {"infer_ms": float(times["infer_ms"])}
    return {}


def to_openpi(observation: Observation, options: OpenPiOptions) -> dict[str, Any]:
    """Our observation as an openpi Aloha observation. Raises EncodeError for unmapped cameras."""
    images = {}
    for name, image in observation.get("images", {}).items():
        if name not in options.cameras:
            raise EncodeError(f"camera {name!r} has no openpi name; known: {list(options.cameras)}")
        images[options.cameras[name]] = np.moveaxis(image, -1, 0)
    sent = {**options.extra, "images": images, "prompt": observation.get("instruction", "")}
    if "state" in observation:
        sent["state"] = observation["state"]
    return sent


def from_openpi(value: Any, step: int) -> dict[str, Any]:
    """An openpi Aloha observation as ours; `step` is counted by the server. Raises DecodeError."""
    if not isinstance(value, dict):
        raise DecodeError("an openpi observation must be a map")
    sent = value.get("images", {})
    if not isinstance(sent, dict):
        raise DecodeError("openpi observation: 'images' must be a map")
    ours = {theirs: name for name, theirs in CAMERA_NAMES.items()}
    observation: dict[str, Any] = {
        "images": {ours.get(name, name): _to_hwc(name, image) for name, image in sent.items()},
        "instruction": value.get("prompt", ""),
        "step": step,
    }
    if "state" in value:
        state = value["state"]
        if not isinstance(state, np.ndarray) or state.ndim != 1:
            raise DecodeError("openpi observation: 'state' must be an array of one axis")
        observation["state"] = state.astype(np.float32)
    if not isinstance(observation["instruction"], str):
        raise DecodeError("openpi observation: 'prompt' must be text")
    return observation


def _to_hwc(name: str, image: Any) -> NDArray[np.uint8]:
    """(C, H, W) or (H, W, C), uint8 or float 0..1, to contiguous uint8 (H, W, C)."""
    if not isinstance(image, np.ndarray) or image.ndim != 3:
        raise DecodeError(f"openpi observation: image {name!r} must be an array of three axes")
    if image.shape[0] in (1, 3) and image.shape[-1] not in (1, 3):
        image = np.moveaxis(image, 0, -1)
    if image.dtype.kind == "f":
        image = np.clip(np.round(image * 255.0), 0, 255)
    return np.ascontiguousarray(image, dtype=np.uint8)
