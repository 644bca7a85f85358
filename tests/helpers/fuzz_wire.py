"""Damaged messages by the million: nothing may come out but a value or the documented error.

    python tests/helpers/fuzz_wire.py [--inputs 1000000] [--seed 0] [--target all] [--out FILE.json]

Valid messages of every type (ours, and openpi's observations) are changed at random: bits, bytes,
lengths, cut, doubled, spliced, with the tags and lengths that are hard to read right put in. Each
result goes to every target that takes it: the codec, the messages, what a server does to an
observation, what a client does to a chunk, openpi's dialect. What was decoded must survive another
round trip. The process may not grow by more than `ROOM` while it runs, and every thousandth input
is decoded under `tracemalloc`: at most `PER_BYTE` bytes for each of its own.

Prints what was run and how fast; ends with 1 and the input in hexadecimal at the first surprise.
`TARGETS` and `mutate` can be used by others.
"""

from __future__ import annotations

import argparse
import json
import random
import resource
import sys
import time
import tracemalloc
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from robospa.observation import CameraSpec
from robospa.protocol.codec import decode, encode
from robospa.protocol.errors import DecodeError, PolicyAnswerError, VersionMismatch
from robospa.protocol.messages import (
    Actions,
    End,
    Ended,
    Error,
    Hello,
    Infer,
    Message,
    Ready,
    Reset,
    pack,
    read_message,
)
from robospa.protocol.openpi import CAMERA_NAMES, from_openpi, to_openpi
from robospa.protocol.policy import PolicySpec, TrialInfo, check_chunk, check_observation

ROOM = 512 * 2**20
PER_BYTE, BASE = 400, 200_000
SPEC = PolicySpec("fuzz", cameras=(CameraSpec("head", 4, 3),), horizon=4, history=(-1,))
ALLOWED = (DecodeError, VersionMismatch, PolicyAnswerError)
TAGS = [0x80, 0x84, 0x8F, 0x90, 0x9F, 0xC0, 0xC1, *range(0xC4, 0xE0), 0xFF, 0x00, 0x7F]
ENDS = [
    b"\xff" * 4,
    b"\x7f\xff\xff\xff",
    b"\x80\x00\x00\x00",
    b"\x00" * 4,
    b"\xff\xff",
    b"\x00\x01",
]


def _observation() -> dict[str, Any]:
    view = {"images": {"head": np.arange(36, dtype=np.uint8).reshape(3, 4, 3)}}
    view["state"] = np.zeros(14, np.float32)  # type: ignore[assignment]
    now = {**view, "ee": np.zeros((2, 8), np.float32), "instruction": "pick it", "step": 3}
    return {**now, "history": {-1: view}, "privileged": {"a": [1, 2.5, None, True]}}


def corpus() -> list[bytes]:
    """Valid messages, one of every kind."""
    trial = TrialInfo("Pick", "aloha-agilex", "pick it", 7, {"a": 1})
    messages: list[Message] = [
        Hello(0, "1.1", "fuzz", SPEC),
        Reset(1, trial),
        Ready(1),
        Infer(2, _observation()),
        Actions(2, np.zeros((3, 14), np.float32), {"infer_ms": 1.5, "batch": 2}),
        Error(3, "busy", "wait", True),
        End(4, {"success": True, "steps": 12}),
        Ended(4),
    ]
    openpi = to_openpi(_observation(), CAMERA_NAMES, {})
    return [*map(pack, messages), encode(openpi), encode([np.zeros(s) for s in ((), (0,), (2, 2))])]


def mutate(rng: random.Random, seeds: list[bytes]) -> bytes:
    """One of `seeds`, changed in one to four places."""
    data = bytearray(rng.choice(seeds))
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        if not data:
            break
        at, kind = rng.randrange(len(data)), rng.randrange(9)
        if kind == 0:
            data[at] ^= 1 << rng.randrange(8)
        elif kind == 1:
            data[at] = rng.choice(TAGS)
        elif kind == 2:
            data[at] = rng.randrange(256)
        elif kind == 3:
            end = rng.choice(ENDS)
            data[at : at + len(end)] = end
        elif kind == 4:
            del data[at : at + rng.randint(1, 8)]
        elif kind == 5:
            data[at:at] = rng.randbytes(rng.randint(1, 8))
        elif kind == 6:
            data[at:at] = data[at : at + rng.randint(1, 64)]
        elif kind == 7:
            del data[at:]
        else:
            other = rng.choice(seeds)
            data[at:] = other[rng.randrange(len(other)) :]
    return bytes(data)


def wire(data: bytes) -> None:
    """The codec, and the way back: what was read is written and read again to the same bytes."""
    again = encode(decode(data))
    assert encode(decode(again)) == again, "a decoded value does not survive a round trip"


def message(data: bytes) -> None:
    """The message, and what either end does with its content."""
    found = read_message(decode(data))
    if isinstance(found, Infer):
        check_observation(found.observation, SPEC)
    elif isinstance(found, Actions):
        check_chunk(found.chunk, SPEC)
    elif isinstance(found, Hello):
        assert PolicySpec.from_json(found.spec.to_json()) == found.spec
    elif isinstance(found, Reset):
        assert TrialInfo.from_json(found.trial.to_json()) == found.trial


def openpi(data: bytes) -> None:
    """An observation in openpi's dialect."""
    from_openpi(decode(data), 0, replace(SPEC, history=()))


TARGETS: dict[str, Callable[[bytes], None]] = {"wire": wire, "message": message, "openpi": openpi}


def attempt(target: Callable[[bytes], None], data: bytes) -> str:
    """How `target` ended: `read`, or the name of a documented error; anything else is raised."""
    try:
        target(data)
    except ALLOWED as error:
        assert str(error), "an error without a word"
        return type(error).__name__
    return "read"


def measured(data: bytes) -> int:
    """The most bytes that decoding took at once."""
    tracemalloc.start()
    try:
        attempt(lambda d: (decode(d), None)[1], data)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def fuzz(inputs: int, seed: int, targets: dict[str, Callable[[bytes], None]]) -> dict[str, Any]:
    """Run; raises AssertionError, or what came out, with the input named."""
    rng, seeds, ends = random.Random(seed), corpus(), Counter[str]()
    worst, began = 0.0, time.process_time()
    for number in range(inputs):
        data = mutate(rng, seeds)
        for name, target in targets.items():
            try:
                ends[f"{name}: {attempt(target, data)}"] += 1
            except BaseException as error:
                error.add_note(f"input {number} of seed {seed}, target {name}: {data.hex()}")
                raise
        if number % 1000 == 0:
            used = measured(data)
            worst = max(worst, used / (len(data) + 1))
            assert used <= PER_BYTE * len(data) + BASE, f"{used} bytes for {data.hex()}"
    seconds = time.process_time() - began
    return {
        "inputs": inputs,
        "seed": seed,
        "executions": inputs * len(targets),
        "executions_per_cpu_s": round(inputs * len(targets) / seconds),
        "cpu_seconds": round(seconds, 1),
        "ends": dict(sorted(ends.items())),
        "most_bytes_per_input_byte": round(worst),
        "peak_rss_mib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss // 1024,
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--inputs", type=int, default=1_000_000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--target", choices=["all", *TARGETS], default="all")
    parser.add_argument("--out", type=Path)
    chosen = parser.parse_args()
    size = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + ROOM, resource.RLIM_INFINITY))
    targets = TARGETS if chosen.target == "all" else {chosen.target: TARGETS[chosen.target]}
    text = json.dumps(fuzz(chosen.inputs, chosen.seed, targets), indent=2)
    print(text)
    if chosen.out:
        chosen.out.write_text(text + "\n", encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
