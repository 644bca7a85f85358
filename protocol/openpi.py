"""openpi's dialect at our server: its clients' observations, and the conversation with one.

A client that offers no subprotocol is openpi's. It sends `images` by the names of `CAMERA_NAMES`,
uint8 (3, H, W) RGB (read too: (H, W, 3), or 0..1), `state` (14,) float64, and the `prompt`.
"""

import logging
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from robospa.observation import Observation
from robospa.protocol.codec import Limits, decode, encode
from robospa.protocol.connection_limits import MonitoredConnection
from robospa.protocol.errors import DecodeError, error_sentence, policy_traceback
from robospa.protocol.messages import VERSION
from robospa.protocol.policy import (
    PolicySpec,
    TrialInfo,
    check_chunk,
    check_observation,
    joints_of,
    robot_of,
)
from robospa.protocol.policy_host import PolicySession

log = logging.getLogger("robospa.server")

CAMERA_NAMES = {
    "head": "cam_high",
    "left_wrist": "cam_left_wrist",
    "right_wrist": "cam_right_wrist",
    "front": "cam_low",
}
"""Our camera names and those of openpi's Aloha configurations."""


def from_openpi(value: object, step: int, spec: PolicySpec) -> Observation:
    """An openpi Aloha observation as ours, with what `spec` asks for; `step` is counted by the
    server. Raises DecodeError."""
    if not isinstance(value, dict):
        raise DecodeError("an openpi observation must be a map")
    sent, prompt = value.get("images", {}), value.get("prompt", "")
    if not isinstance(sent, dict):
        raise DecodeError("openpi observation: 'images' must be a map")
    if not isinstance(prompt, str):
        raise DecodeError("openpi observation: 'prompt' must be text")
    ours = {theirs: name for name, theirs in CAMERA_NAMES.items()}
    images = {
        ours.get(str(name), str(name)): _to_hwc(str(name), image) for name, image in sent.items()
    }
    _check_sizes(images, spec)
    observation: dict[str, object] = {"images": images, "instruction": prompt, "step": step}
    if "state" in value:
        state = value["state"]
        if not isinstance(state, np.ndarray) or state.ndim != 1:
            raise DecodeError("openpi observation: 'state' must be an array of one axis")
        with np.errstate(over="ignore"):
            observation["state"] = state.astype(np.float32)
    return check_observation(observation, spec)


def _check_sizes(images: Mapping[str, NDArray[np.uint8]], spec: PolicySpec) -> None:
    """Raises DecodeError for an image of another size than `spec` has, under the client's name."""
    for camera in spec.cameras:
        image, wanted = images.get(camera.name), (camera.height, camera.width)
        if image is not None and image.shape[:2] != wanted:
            height, width = image.shape[:2]
            raise DecodeError(
                f"image {CAMERA_NAMES.get(camera.name, camera.name)} is {width}x{height}, but this "
                f"policy reads {camera.width}x{camera.height}: send it in that size, or serve the "
                f"policy with CameraSpec({camera.name!r}, {width}, {height})"
            )


def _to_hwc(name: str, image: object) -> NDArray[np.uint8]:
    """(C, H, W) or (H, W, C), uint8 or float 0..1, to contiguous uint8 (H, W, C)."""
    if not isinstance(image, np.ndarray) or image.ndim != 3:
        raise DecodeError(f"openpi observation: image {name!r} must be an array of three axes")
    if image.shape[0] in (1, 3) and image.shape[-1] not in (1, 3):
        image = np.moveaxis(image, 0, -1)
    if image.dtype.kind == "f":
        image = np.clip(np.round(image * 255.0), 0, 255)
    return np.ascontiguousarray(image, dtype=np.uint8)


async def serve_openpi(
    socket: MonitoredConnection, policy: PolicySession, spec: PolicySpec, name: str, limits: Limits
) -> None:
    """Serve a client of openpi until it closes (ConnectionClosed): metadata, then an answer with
    `actions` per observation. `name` is the server's."""
    about = {"version": VERSION, "server": name, "spec": spec.to_json()}
    await socket.send(encode({"robospa": about}, limits))
    prompt, step = None, 0
    while True:
        data = await socket.next_message()
        try:
            if isinstance(data, str):
                raise DecodeError("an observation must be a binary frame")
            observation = from_openpi(decode(data, limits), step, spec)
            if observation["instruction"] != prompt:
                prompt, step = observation["instruction"], 0
                observation["step"] = 0
                trial = TrialInfo("", robot_of(spec), prompt, joints=joints_of(spec))
                await policy.reset(trial)
            answer, timing = await policy.infer(observation)
            chunk = check_chunk(answer, spec)
        except DecodeError as error:  # the client's mistake: nobody needs to see our code
            log.warning("an observation in openpi's dialect was refused: %s", error)
            return await _give_up(socket, error_sentence(error))
        except Exception as error:
            said, trace = error_sentence(error), policy_traceback(error)
            log.error("the policy failed in openpi's dialect: %s\n%s", said, trace)
            return await _give_up(socket, f"{said}\n\n{trace}")
        step += min(len(chunk), spec.execute or len(chunk))
        times = {"infer_ms": timing["infer_ms"]}
        reply = {"actions": chunk, "policy_timing": times, "server_timing": times}
        await socket.send(encode(reply, limits))


async def _give_up(socket: MonitoredConnection, text: str) -> None:
    await socket.send(text)
    await socket.close(1011, "internal error, see the text frame before")
