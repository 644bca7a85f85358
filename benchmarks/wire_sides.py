"""Servers and clients of the wire benchmarks, ours and the peers': one process each.

    python wire_sides.py serve KIND            prints the URL it listens on, serves until killed
    python wire_sides.py call KIND URL FRAMES  for every line N of input: N round trips, their
                                               milliseconds as one line of JSON

Every process runs in the environment of what it measures, so this file needs numpy and what KIND
needs, nothing else. Answers are a 50 x 14 float32 chunk, at once.

    bare          sync client and asyncio server of `websockets`, compression off, our bytes
    robospa       our client and server, robospa.v1
    openpi        openpi-client, and a server of openpi's form (its own is in no package)
    vla-eval      its client and server as shipped: images as PNG
    vla-eval raw  the same with set_image_format("raw"), which none of its options reaches
    xpolicylab    a client and a server of XPolicyLab's form, written here: msgpack-numpy in an
                  envelope, websockets' defaults (compression on), inference in a thread

"vla-eval steps" and "vla-eval raw steps" are its server with chunk_size=50, "openpi steps" openpi's
chunk broker: one call is one step of the environment. "robospa batch" and "vla-eval batch" have a
model that takes 50 ms for up to eight observations and writes batch sizes to the file in FILL.
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
import time
from collections.abc import Awaitable, Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from websockets.asyncio.server import ServerConnection

CAMERAS = ("head", "left_wrist", "right_wrist")
Chunk = NDArray[np.float32]
Handler = Callable[["ServerConnection"], Awaitable[None]]
CHUNK: Chunk = np.zeros((50, 14), np.float32)
WORDS = " ".join(["word"] * 20)
Call = Callable[[], object]


def observation(path: str) -> dict[str, Any]:
    """The observation that we send: three frames, 14 joints, 16 numbers of poses, 20 words."""
    rng = np.random.default_rng(0)
    return {
        "images": dict(zip(CAMERAS, np.load(path), strict=True)),
        "state": rng.random(14, dtype=np.float32),
        "ee": rng.random((2, 8), dtype=np.float32),
        "instruction": WORDS,
        "step": 0,
    }


def plain(path: str) -> dict[str, Any]:
    """The same for a peer that names things its own way."""
    seen = observation(path)
    return {"images": seen["images"], "states": seen["state"], "task_description": WORDS}


# ---------------------------------------------------------------- servers


async def _listen(handler: Handler, **settings: object) -> None:
    from websockets.asyncio.server import serve

    async with serve(handler, "127.0.0.1", 0, max_size=None, **settings) as server:
        print(f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}", flush=True)
        await server.serve_forever()


def serve_bare() -> None:
    answer = bytes(CHUNK.nbytes)

    async def handler(socket: ServerConnection) -> None:
        async for _ in socket:
            await socket.send(answer)

    asyncio.run(_listen(handler, compression=None))


def serve_openpi() -> None:
    from openpi_client import msgpack_numpy

    async def handler(socket: ServerConnection) -> None:
        packer = msgpack_numpy.Packer()
        await socket.send(packer.pack({"reset_pose": [0.0] * 6}))
        async for data in socket:
            start = time.monotonic()
            msgpack_numpy.unpackb(data)
            timing = {"infer_ms": (time.monotonic() - start) * 1e3}
            await socket.send(packer.pack({"actions": CHUNK, "server_timing": timing}))

    asyncio.run(_listen(handler, compression=None))


def _robospa_model(batch: int) -> type:
    from robospa.protocol.policy import PolicySpec

    class Model:
        spec = PolicySpec("echo", action_dim=14, batch=batch)

        def reset(self, trial: object) -> None:
            return None

        def infer(self, observation: object) -> Chunk:
            return CHUNK

        def infer_batch(self, observations: Sequence[object], sessions: object) -> list[Chunk]:
            slow(len(observations))
            return [CHUNK] * len(observations)

    return Model


def slow(size: int) -> None:
    """A model of 50 ms, whatever the batch."""
    with open(os.environ["FILL"], "a", encoding="utf-8") as file:
        file.write(f"{size}\n")
    time.sleep(0.05)


def serve_robospa(batch: int = 1) -> None:
    from robospa.protocol.server import serve

    def ready(url: str) -> None:
        print(url, flush=True)

    model = _robospa_model(batch)
    if batch > 1:
        serve(model(), port=0, on_ready=ready)
    else:
        serve(policy_factory=model, port=0, on_ready=ready)


def serve_vla_eval(chunk_size: int | None = None, batch: int = 1) -> None:
    import anyio
    from vla_eval.model_servers.predict import PredictModelServer
    from vla_eval.model_servers.serve import serve_async

    class Model(PredictModelServer):
        def predict(self, obs: object, ctx: object) -> dict[str, Chunk]:
            return {"actions": CHUNK}

        def predict_batch(
            self, obs_batch: Sequence[object], ctx_batch: object
        ) -> list[dict[str, Chunk]]:
            slow(len(obs_batch))
            return [{"actions": CHUNK}] * len(obs_batch)

    async def run() -> None:
        model = Model(chunk_size=chunk_size, max_batch_size=batch)
        async with anyio.create_task_group() as group:
            port = await group.start(serve_async, model, "127.0.0.1", 0)
            print(f"ws://127.0.0.1:{port}", flush=True)

    anyio.run(run)


def serve_xpolicylab() -> None:
    import msgpack
    import msgpack_numpy

    async def handler(socket: ServerConnection) -> None:
        async for data in socket:
            asked = msgpack.unpackb(data, object_hook=msgpack_numpy.decode, raw=False)
            start = time.perf_counter()
            chunk = await asyncio.to_thread(lambda: CHUNK)
            spent = (time.perf_counter() - start) * 1e3
            answer = {**asked, "message_type": "infer_result"}
            answer["payload"] = {"actions": chunk, "latency_ms": spent}
            await socket.send(msgpack.packb(answer, default=msgpack_numpy.encode))

    asyncio.run(_listen(handler, ping_interval=60, ping_timeout=300))


SERVERS: dict[str, Callable[[], None]] = {
    "bare": serve_bare,
    "robospa": serve_robospa,
    "openpi": serve_openpi,
    "vla-eval": serve_vla_eval,
    "xpolicylab": serve_xpolicylab,
    "vla-eval steps": lambda: serve_vla_eval(chunk_size=50),
    "robospa batch": lambda: serve_robospa(8),
    "vla-eval batch": lambda: serve_vla_eval(batch=8),
}


# ---------------------------------------------------------------- clients: a call is a round trip


def call_bare(url: str, path: str) -> Call:
    from websockets.sync.client import connect

    socket = connect(url, compression=None, max_size=None).__enter__()
    with open(os.environ["MESSAGE"], "rb") as file:
        message = file.read()

    def call() -> None:
        socket.send(message)
        socket.recv()

    return call


def call_robospa(url: str, path: str) -> Call:
    from robospa.clients import connect
    from robospa.protocol.policy import TrialInfo

    policy, seen = connect(url), observation(path)
    policy.reset(TrialInfo("wire", "aloha-agilex", "nothing"))
    return lambda: policy.infer(seen)


def call_openpi(url: str, path: str) -> Call:
    from openpi_client.websocket_client_policy import WebsocketClientPolicy

    policy, sent = WebsocketClientPolicy(url), plain(path)
    sent["images"] = {
        name: np.ascontiguousarray(image.transpose(2, 0, 1))
        for name, image in sent["images"].items()
    }
    return lambda: policy.infer(sent)


def call_openpi_steps(url: str, path: str) -> Call:
    from openpi_client.action_chunk_broker import ActionChunkBroker
    from openpi_client.websocket_client_policy import WebsocketClientPolicy

    policy, sent = ActionChunkBroker(WebsocketClientPolicy(url), len(CHUNK)), plain(path)
    return lambda: policy.infer(sent)


def call_vla_eval(url: str, path: str, images: str = "png") -> Call:
    from vla_eval.connection import Connection
    from vla_eval.protocol.numpy_codec import set_image_format

    set_image_format(images)
    connection, sent, loop = Connection(url), plain(path), asyncio.new_event_loop()
    loop.run_until_complete(connection.connect())
    loop.run_until_complete(connection.start_episode({"task": {"name": WORDS}}))
    return lambda: loop.run_until_complete(connection.act(sent))


def call_xpolicylab(url: str, path: str) -> Call:
    import uuid

    import msgpack
    import msgpack_numpy
    import websockets

    seen, loop = observation(path), asyncio.new_event_loop()
    socket = loop.run_until_complete(
        websockets.connect(url, max_size=None, ping_interval=20, ping_timeout=20)
    )
    sent = {
        "data_format_version": "v1.0",
        "instruction": WORDS,
        "vision": {f"cam_{name}": {"color": image} for name, image in seen["images"].items()},
        "state": {"left_arm_joint_state": seen["state"][:7], "right": seen["state"][7:]},
    }

    async def ask() -> object:
        envelope = {
            "message_type": "infer",
            "message_id": str(uuid.uuid4()),
            "evaluation_id": "wire",
            "step": 0,
            "sent_at": time.time(),
            "payload": {"observation": sent},
        }
        await socket.send(msgpack.packb(envelope, default=msgpack_numpy.encode))
        answer = await asyncio.wait_for(socket.recv(), timeout=120)
        return msgpack.unpackb(answer, object_hook=msgpack_numpy.decode, raw=False)

    return lambda: loop.run_until_complete(ask())


CLIENTS: dict[str, Callable[[str, str], Call]] = {
    "bare": call_bare,
    "robospa": call_robospa,
    "openpi": call_openpi,
    "openpi steps": call_openpi_steps,
    "vla-eval": call_vla_eval,
    "vla-eval raw": lambda url, path: call_vla_eval(url, path, "raw"),
    "xpolicylab": call_xpolicylab,
}


def answer_calls(call: Call) -> None:
    """N round trips a line of input; with a second number, pauses of 5 to 15 ms in between."""
    rng = np.random.default_rng(os.getpid())
    for line in sys.stdin:
        count, _, pause = line.partition(" ")
        spent = []
        for _ in range(int(count)):
            start = time.perf_counter()
            call()
            spent.append((time.perf_counter() - start) * 1e3)
            if pause.strip():
                time.sleep(rng.uniform(0.005, 0.015))
        print(json.dumps(spent), flush=True)


def main() -> None:
    """A server or a client."""
    if sys.argv[1] == "serve":
        return SERVERS[sys.argv[2]]()
    call = CLIENTS[sys.argv[2]](*sys.argv[3:5])
    call()
    print("ready", flush=True)
    return answer_calls(call)


if __name__ == "__main__":
    main()
