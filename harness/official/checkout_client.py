"""The process in which a user's RoboSPA checkout runs: started, asked, watched and ended.

Its answers are as untrusted as those of a policy's server: sizes are checked before anything is
allocated, and every wait has an end.
"""

from __future__ import annotations

import contextlib
import os
import selectors
import subprocess
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.harness.official import checkout_server
from robospa.harness.official.checkout_server import packed, unpacked
from robospa.protocol.errors import printable

SENTENCE = 500
SECONDS = {"hello": 300.0, "load": 900.0, "step": 300.0, "observe": 120.0}
"""How long an answer may take [s]: at hello the simulator and torch are imported, at load a GPU
planner is warmed up and the official expert plays."""


class CheckoutFailed(Exception):
    """The checkout's process cannot go on; the message says what it was doing and what to do."""


class BadScene(Exception):
    """The checkout's scene is not stable, or its expert does not solve it: no valid seed."""


class CheckoutProcess:
    """A process of `python` that runs the checkout at `folder`; `hello` is its greeting."""

    def __init__(
        self, folder: Path, python: str = "python", seconds: Mapping[str, float] | None = None
    ) -> None:
        """Raises CheckoutFailed if it does not come up."""
        self._seconds = {**SECONDS, **(seconds or {})}
        script = Path(checkout_server.__file__).resolve()
        # Nothing of ours may be imported there: our packages need another Python.
        environment = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
        try:
            self._process = subprocess.Popen(
                [python, str(script), str(folder)],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                env=environment,
            )
        except OSError as error:
            raise CheckoutFailed(
                f"{python} cannot be started ({error.strerror}): name the Python of the "
                "checkout's environment with --world 'checkout:DIR?python=/path/to/python'"
            ) from error
        try:
            self.hello, _ = self.ask("hello")
            if self.hello.get("version") != checkout_server.VERSION:
                raise CheckoutFailed(
                    f"the checkout's process speaks version {self.hello.get('version')!r} of the "
                    f"protocol, and this robospa speaks {checkout_server.VERSION}"
                )
        except BaseException:
            self.close()
            raise

    def ask(
        self,
        do: str,
        arrays: Mapping[str, NDArray[Any]] | None = None,
        **request: object,
    ) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """The answer to one request; raises CheckoutFailed, after which it is of no use any more,
        or BadScene."""
        deadline = time.monotonic() + self._seconds[do]
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(packed({"do": do, **request}, arrays))
            self._process.stdin.flush()
            header, found = unpacked(lambda count: self._read(count, deadline, do))
        except (BrokenPipeError, EOFError):
            code = self._ended()
            raise CheckoutFailed(
                f"the checkout's process ended ({code}) at {do}: what it printed is in the log of "
                "this worker"
            ) from None
        except ValueError as error:
            self.close()
            raise CheckoutFailed(f"the checkout's process answered nonsense: {error}") from error
        if "error" in header:
            text = printable(str(header.get("text", "")), SENTENCE)
            if header["error"] in ("unstable", "unsolved"):
                raise BadScene(text)
            what = "be used" if do == "hello" else do
            raise CheckoutFailed(f"the checkout cannot {what}: {text}")
        return header, found

    def _read(self, count: int, deadline: float, do: str) -> bytes:
        """Exactly `count` bytes."""
        assert self._process.stdout is not None
        pipe, parts = self._process.stdout.fileno(), []
        with selectors.DefaultSelector() as ready:
            ready.register(pipe, selectors.EVENT_READ)
            while count:
                if not ready.select(max(0.0, deadline - time.monotonic())):
                    self.close()
                    raise CheckoutFailed(
                        f"the checkout did not {do} within {self._seconds[do]:g} s and was ended; "
                        "allow more with --world 'checkout:DIR?patience=2', a factor"
                    )
                part = os.read(pipe, min(count, 2**20))
                if not part:
                    raise EOFError
                parts.append(part)
                count -= len(part)
        return b"".join(parts)

    def _ended(self) -> str:
        try:
            code = self._process.wait(5.0)
        except subprocess.TimeoutExpired:
            self.close()
            return "it closed its pipe"
        return f"signal {-code}" if code < 0 else f"exit code {code}"

    def close(self) -> None:
        """End the process; may be called again."""
        self._process.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with contextlib.suppress(BrokenPipeError):  # what was still to be sent
                    pipe.close()


def numbers(value: object, shape: tuple[int, ...], what: str) -> NDArray[np.float64]:
    """`value` as finite numbers of `shape`, where -1 is any count; raises CheckoutFailed."""
    try:
        found = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        found = np.empty(0)
    fits = found.ndim == len(shape) and all(
        n in (-1, m) for n, m in zip(shape, found.shape, strict=True)
    )
    if not fits or not np.isfinite(found).all():
        raise CheckoutFailed(f"the checkout's {what} are not numbers of shape {shape}")
    return found
