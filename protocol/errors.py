"""Everything that can go wrong on the wire, sorted by what the caller should do about it.

    WireError
    ├── EncodeError            a value that cannot be sent: the caller's mistake
    ├── DecodeError            bytes that are no valid message (malformed, over a limit, wrong type)
    ├── HandshakeError         refuse to start: the line is fine, but the two ends do not fit
    │   ├── VersionMismatch    the server speaks another major version
    │   ├── SpecMismatch       another spec, or another policy, than expected
    │   └── Unauthorized       the token was missing or wrong
    ├── TransportError         infrastructure: the trial is repeated, a bounded number of times
    │   ├── ConnectFailed      nobody listens there, or the handshake did not finish
    │   ├── ConnectionLost     closed in the middle; there is no reconnect inside a trial
    │   ├── CallTimeout        no answer in time; the connection is given up
    │   └── ProtocolViolation  wrong request id, unreadable or unexpected message; given up too
    └── PolicyError            the policy failed: the trial ends as a policy error, a failure
        ├── PolicyAnswerError  the answer came and cannot be executed
        └── ServerError        the server answered `error` (code, message, retriable)

A harness needs three branches: HandshakeError stops the run, TransportError repeats the trial,
PolicyError ends the trial as a failure. What the other side says of itself never repeats a trial:
else a policy that reports an error whenever it is about to fail would never fail.

Here too: text from other machines made safe for a terminal, a log and the record of a run, and a
policy's exception in words in which its author finds the line.
"""

import hashlib
import json
import math
import re
import traceback
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType

import numpy as np

MAX_LINE = 300
"""Characters of a server's message that are repeated."""
MAX_JSON = 2**16
"""Characters of a server's metadata that a run keeps."""
_USER = re.compile(r"(\w://)[^/?#\s'\"]*@")
_SECRET_VALUE = re.compile(
    r"([?&;](?:[\w.-]*[_.-])?(?:token|key|apikey|password|passwd|pwd|secret|auth|authorization)=)"
    r"[^&;#\s'\"]+",
    re.IGNORECASE,
)
_COLOURS = re.compile(r"\x1b\[[0-?]*[ -/]*[@-~]|\x1b\][^\x07\x1b]*(?:\x07|\x1b\\)?")


def printable(text: str, most: int = MAX_LINE) -> str:
    """`text` from outside as one line that is safe on a terminal and in a record: without control
    characters and colours, and with at most `most` characters."""
    words = _COLOURS.sub("", text[: 8 * most])
    line = " ".join("".join(c if c.isprintable() else " " for c in words).split())
    return line if len(line) <= most else f"{line[: most - 3]}..."


def without_secrets(text: str) -> str:
    """`text` with `***` in place of users, passwords and tokens in the URLs that it holds."""
    return _SECRET_VALUE.sub(r"\1***", _USER.sub(r"\1***@", text))


def json_values(value: object) -> object:
    """A decoded value as JSON values, for the record of a run: arrays as lists, numbers that JSON
    does not have as text; a note in its place if that has more than MAX_JSON characters."""
    found = _plain(value)
    text = json.dumps(found, sort_keys=True)
    if len(text) <= MAX_JSON:
        return found
    digest = hashlib.sha256(text.encode()).hexdigest()[:16]
    return f"left out: {len(text)} characters, sha256 {digest}"


def _plain(value: object) -> object:
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    return value if value is None or isinstance(value, (bool, int, float, str)) else repr(value)


POLICY_FAILED = "policy_failed"
"""Code of an `error`: the policy raised an exception."""


class WireError(Exception):
    """Base of every error of this package."""


class EncodeError(WireError):
    """A value cannot be put on the wire."""


class DecodeError(WireError):
    """Bytes are not a valid message."""


class HandshakeError(WireError):
    """The two ends do not fit together; starting anyway would give wrong numbers."""


class VersionMismatch(HandshakeError):
    """Different major protocol versions."""


class SpecMismatch(HandshakeError):
    """The server has another spec, or is another one, than was expected."""


class Unauthorized(HandshakeError):
    """The server refused the token."""


class TransportError(WireError):
    """Infrastructure trouble; says nothing about the policy."""


class ConnectFailed(TransportError):
    """No connection could be made."""


class ConnectionLost(TransportError):
    """The connection ended although it was still needed."""


class CallTimeout(TransportError):
    """The server did not answer in time."""


class ProtocolViolation(TransportError):
    """The server answered something that the protocol does not allow here."""


class PolicyError(WireError):
    """The policy failed, not the line to it. `timing`: what its server reported with that."""

    timing: Mapping[str, float] = {}


class ServerError(PolicyError):
    """The server reported an error for one request."""

    def __init__(self, code: str, message: str, retriable: bool, url: str = "") -> None:
        """`url`: where the log with the details is."""
        self.code, self.message = printable(code, 60), printable(message)
        if self.code == POLICY_FAILED:  # the policy's own exception comes first
            where = f"; its traceback is in the log of {url}" if url else ""
            super().__init__(f"{self.message}{where}")
        else:
            where = f"; look at the log of {url}" if url else ""
            super().__init__(f"the server reported {self.code}: {self.message}{where}")
        self.retriable = retriable


class PolicyAnswerError(PolicyError):
    """The policy answered a chunk that cannot be executed (shape, dtype, NaN)."""


CALLERS = ("robospa.protocol.", "robospa.harness.")
"""Modules that call policies, whose frames are left out where a policy's exception is shown."""
STANDARD = str(Path(traceback.__file__).parent)
INSTALLED = ("site-packages", "dist-packages")
MAX_TEXT = 500


def error_sentence(error: BaseException) -> str:
    """`ValueError: no such camera (my_policy.py:40)`, in one line.

    The place is the last one in the policy's own code; the last of all, in a library, if there is
    none; left out if the policy was never called.
    """
    text = printable((str(error).strip().splitlines() or [""])[0], MAX_TEXT)
    name = type(error).__name__
    said = f"{name}: {text}" if text else name
    frames = [trace for trace in _frames(error.__traceback__) if not _calls(trace)]
    if not frames:
        return said
    places = [(trace.tb_frame.f_code.co_filename, trace.tb_lineno) for trace in frames]
    own = [
        (file, line)
        for file, line in places
        if not file.startswith(STANDARD) and not any(folder in file for folder in INSTALLED)
    ]
    file, line = (own or places)[-1]
    return f"{said} ({Path(file).name}:{line})"


def policy_traceback(error: BaseException) -> str:
    """The traceback of `error` from the policy's first frame on; whole if there is none."""
    first = next((t for t in _frames(error.__traceback__) if not _calls(t)), error.__traceback__)
    return "".join(traceback.format_exception(type(error), error, first)).rstrip()


def _frames(trace: TracebackType | None) -> Iterator[TracebackType]:
    while trace is not None:
        yield trace
        trace = trace.tb_next


def _calls(trace: TracebackType) -> bool:
    return str(trace.tb_frame.f_globals.get("__name__", "")).startswith(CALLERS)
