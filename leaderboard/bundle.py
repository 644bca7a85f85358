"""What a submission bundle is: a zip file of known names, sizes and hashes, and nothing else.

Nothing in a bundle is ever extracted, imported or run. The zip is looked at whole before a byte is
unpacked, so that no two readers see two archives. JSON of strangers is finite numbers, no repeated
fields, and text without markup.
"""

from __future__ import annotations

import hashlib
import json
import re
import stat
import struct
import sys
import zipfile
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, TypeGuard

from msgspec import Struct, to_builtins

from robospa.results.records.manifest import RunManifest
from robospa.schema import Sha256, parse_json

IN_REPOSITORY = "bundle.zip"
"""Name of a bundle in its submission's folder, and its address in `bundle.txt`."""
FORMAT = 2
"""Version of this layout. A newer one is refused, an older one is read as long as it is known."""
MANIFEST = "manifest.json"
CARD = "model.json"
RUN = "run.json"
RECORDS = "records.jsonl"
SCORES = "report/scores.json"
OUTCOMES = "report/outcomes.json"

MEGA = 1024 * 1024
_TASK = r"[A-Za-z0-9_]{1,64}"
_SETTING = r"[A-Za-z0-9_.-]{1,250}"
KINDS: tuple[tuple[re.Pattern[str], int], ...] = (
    (re.compile(r"manifest\.json|model\.json"), MEGA),
    (re.compile(r"run\.json"), 2 * MEGA),
    (re.compile(r"report/(scores|outcomes)\.json"), 2 * MEGA),
    (re.compile(r"records\.jsonl"), 192 * MEGA),
    (re.compile(rf"actions/{_TASK}-L[1-5]\.bin"), 32 * MEGA),
    (re.compile(rf"videos/{_TASK}-L[1-5]-[0-9]{{1,20}}-{_SETTING}\.mp4"), 16 * MEGA),
)
"""Every name that a bundle may hold, and the most bytes that such a file may have: several times
what the whole benchmark needs. JSON takes up to 24 times its bytes in memory."""


@dataclass(frozen=True)
class BundleLimits:
    """What a bundle as a whole may have: bytes of the zip file, entries, bytes when unpacked, rows
    and bytes of one row."""

    packed: int = 1024 * MEGA
    entries: int = 2000
    unpacked: int = 3 * 1024 * MEGA
    rows: int = 60_000
    row: int = 128 * 1024


class FileEntry(Struct, frozen=True, forbid_unknown_fields=True):
    """Size [bytes] and hash of a file."""

    size: int
    sha256: Sha256


class RowChain(Struct, frozen=True, forbid_unknown_fields=True):
    """How many rows there are, and the hash of the last one."""

    rows: int
    last: Sha256


class BundleManifest(Struct, frozen=True, forbid_unknown_fields=True):
    """`manifest.json`. `robospa` is the version that packed it, `inputs` the hash of what was fixed
    before the first trial, `bundle` that of all the rest."""

    format: int
    suite: str
    robospa: str
    practice: bool
    inputs: Sha256
    chain: RowChain
    files: dict[str, FileEntry]
    bundle: str = ""


class BundleError(Exception):
    """A bundle, or a run that was to become one, is refused; the message is one sentence."""


def most_bytes(name: str) -> int | None:
    """The most bytes that the file `name` may have; None if a bundle holds no such file."""
    return next((most for pattern, most in KINDS if pattern.fullmatch(name)), None)


def actions_name(task: str, level: int) -> str:
    """Where the actions of a variant lie."""
    return f"actions/{task}-L{level}.bin"


def canonical(value: object) -> bytes:
    """The one way to write a JSON value or a Struct down, for hashes; ValueError for NaN and
    infinities."""
    text = json.dumps(
        value,
        sort_keys=True,
        separators=(",", ":"),
        allow_nan=False,
        default=to_builtins,
    )
    return text.encode()


def sha256(data: bytes) -> str:
    """Hexadecimal hash of `data`."""
    return hashlib.sha256(data).hexdigest()


def is_sha256(value: object) -> TypeGuard[str]:
    """Whether `value` is a sha256 in lower-case hexadecimal."""
    return isinstance(value, str) and re.fullmatch(r"[0-9a-f]{64}", value) is not None


def bundle_hash(manifest: Mapping[str, object]) -> str:
    """The hash that names a bundle: of its manifest, which has the hash of every other file."""
    return sha256(canonical({k: v for k, v in manifest.items() if k != "bundle"}))


def inputs_hash(run: RunManifest) -> str:
    """Hash of what is fixed before the first trial: the chain of rows starts from it."""
    names = ("embodiment", "mode", "split", "run_seed", "step_scale", "policy", "policies")
    fixed = {name: getattr(run.settings, name) for name in names}
    fixed["policies"] = fixed["policies"] or None
    return sha256(canonical({"suite": run.suite, "trials": run.trials, "settings": fixed}))


SUSPECT = re.compile(
    "[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u00ad\u034f\u061c\u115f\u1160\u17b4\u17b5\u180e\u200b-\u200f"
    "\u2028-\u202e\u2060-\u206f\u2800\u3164\ufe00-\ufe0f\ufeff\uffa0\ud800-\udfff"
    "\U000e0000-\U000e0fff]|<[A-Za-z/!?]|javascript:",
    re.IGNORECASE,
)
"""Control, invisible and direction-changing characters; openings of tags; script addresses."""
CLOSER_LOOK = re.compile(rb"[\\<\x7f-\xff]")
"""A line without any of these, and without "javascript:", holds no suspect text."""
MAX_DEPTH = 16
"""Deeper nesting than any of our files has."""
END = struct.Struct("<4s4H2LH")
"""A zip file's last record, without a comment."""
LOCAL_HEADER = 30
"""Bytes before an entry's name, in front of its data."""
BROKEN = (zipfile.BadZipFile, zlib.error, EOFError, OSError, NotImplementedError, ValueError)


def parse(data: bytes, what: str) -> object:
    """The JSON value in `data`; BundleError, naming `what`, if it is not strictly one."""
    value = _decode(data, what)
    check_text(value, what)
    return value


def parse_map(data: bytes, what: str) -> dict[str, object]:
    """The JSON object in `data`; BundleError if it is none."""
    return _map(parse(data, what), what)


def parse_row(data: bytes, what: str) -> dict[str, object]:
    """The JSON object in `data`, whose text is plain. Whether its numbers are finite and how deep
    it is nested is left to the caller, who checks every field of so many rows anyway."""
    value = _map(_decode(data, what), what)
    if CLOSER_LOOK.search(data) or b"javascript:" in data.lower():
        check_text(value, what)
    return value


def _decode(data: bytes, what: str) -> object:
    try:
        value: object = parse_json(data.decode())
    except ValueError as error:
        raise BundleError(f"{what} is not strict JSON: {str(error)[:120]}") from None
    return value


def _map(value: object, what: str) -> dict[str, object]:
    if not isinstance(value, dict):
        raise BundleError(f"{what} is not a JSON object")
    return value


def check_text(value: object, what: str, depth: int = 0) -> None:
    """BundleError if any text in `value` is suspect, a number not finite, or it goes too deep."""
    if depth > MAX_DEPTH:
        raise BundleError(f"{what} is nested more than {MAX_DEPTH} deep")
    if isinstance(value, str):
        _check_string(value, what)
    elif isinstance(value, int | float) and not abs(value) <= sys.float_info.max:
        raise BundleError(f"{what} holds a number that is not finite or too large")
    elif isinstance(value, Mapping):
        for name, inner in value.items():
            _check_string(name, what)
            check_text(inner, what, depth + 1)
    elif isinstance(value, list):
        for inner in value:
            check_text(inner, what, depth + 1)


def _check_string(text: str, what: str) -> None:
    found = SUSPECT.search(text)
    if found:
        raise BundleError(
            f"{what} holds text that is not plain ({found.group()!a} in {text[:40]!a}): markup, "
            "scripts and invisible characters are refused"
        )


class BundleArchive:
    """A bundle's zip file, open for reading; use as a context manager.

    Once `listed` are the manifest's entries, every file that is read is held against its hash.
    """

    def __init__(self, path: Path, limits: BundleLimits | None = None) -> None:
        """Raises BundleError unless every entry is one that a bundle may have."""
        self.path = path
        self.limits = limits or BundleLimits()
        self.listed: Mapping[str, FileEntry] = {}
        self._used = {RECORDS}
        _check_frame(path, self.limits)
        try:
            self._zip = zipfile.ZipFile(path)
        except BROKEN as error:
            why = str(error)[:120]
            raise BundleError(f"{path.name} is not a zip file that can be read: {why}") from None
        try:
            self.sizes = _check_entries(self._zip, self.limits)
        except BundleError:
            self._zip.close()
            raise

    def __enter__(self) -> BundleArchive:
        return self

    def __exit__(self, *error: object) -> None:
        self._zip.close()

    @contextmanager
    def _open(self, name: str) -> Iterator[IO[bytes]]:
        if name not in self.sizes:
            raise BundleError(f"the bundle has no {name}")
        try:
            with self._zip.open(name) as file:
                yield file
        except BROKEN as error:
            raise BundleError(f"{name} cannot be unpacked: {str(error)[:120]}") from None

    def read(self, name: str) -> bytes:
        """All bytes of the file `name`; BundleError if they are not those that are listed."""
        with self._open(name) as file:
            data = file.read(self.sizes[name] + 1)
        if len(data) != self.sizes[name]:
            raise BundleError(f"{name} does not unpack to the size that it announces")
        if name in self.listed and sha256(data) != self.listed[name].sha256:
            raise BundleError(f"{name} was changed: its hash is not the manifest's")
        self._used.add(name)
        return data

    def read_map(self, name: str) -> dict[str, object]:
        return parse_map(self.read(name), name)

    def all_used(self) -> None:
        """BundleError if a file is listed that was never read."""
        if unused := self.listed.keys() - self._used:
            raise BundleError(f"{min(unused)} belongs to none of the bundle's trials")

    def rows(self, name: str, digest: hashlib._Hash) -> Iterator[bytes]:
        """The lines of the file `name`, without their newlines; `digest` gets all bytes."""
        most, longest = self.limits.rows, self.limits.row
        with self._open(name) as file:
            for number in range(1, most + 2):
                line = file.readline(longest + 1)
                if not line:
                    return
                if number > most:
                    raise BundleError(f"{name} has more than {most} rows")
                if not line.endswith(b"\n"):
                    raise BundleError(
                        f"{name}, row {number} is torn off or longer than {longest} bytes"
                    )
                digest.update(line)
                yield line[:-1]


def _check_frame(path: Path, limits: BundleLimits) -> None:
    """The file as a whole, before its list of entries is read."""
    if path.is_dir():
        raise BundleError(f"{path} is a folder: a bundle is a .zip of `robospa submit pack`")
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            first = file.read(4)
            file.seek(max(0, size - END.size))
            last = file.read(END.size)
    except OSError as error:
        raise BundleError(f"{path} cannot be read: {error.strerror}") from None
    if size > limits.packed:
        raise BundleError(f"{path.name} has {size} bytes, more than the {limits.packed} allowed")
    if len(last) < END.size or first != b"PK\x03\x04" or last[:4] != b"PK\x05\x06":
        raise BundleError(f"{path.name} is not a plain zip file from its first to its last byte")
    _, disk, start, here, entries, length, offset, comment = END.unpack(last)
    if disk or start or comment or here != entries:
        raise BundleError(f"{path.name} is a zip file in parts or with a comment")
    if entries > limits.entries or length > 512 * entries:
        raise BundleError(f"{path.name} has {entries} entries; {limits.entries} is the most")
    if offset + length + END.size != size:
        raise BundleError(f"{path.name} holds bytes that belong to none of its entries")


def _check_entries(archive: zipfile.ZipFile, limits: BundleLimits) -> dict[str, int]:
    """Size of every entry by name; BundleError for the first that a bundle may not have."""
    sizes: dict[str, int] = {}
    place = 0
    for entry in sorted(archive.infolist(), key=lambda e: e.header_offset):
        name = entry.orig_filename
        shown = ascii(name[:80])
        if name.startswith(("/", "\\")) or ".." in name or "\\" in name or ":" in name[:3]:
            raise BundleError(f"the entry {shown} is a path that leads out of the bundle")
        most = most_bytes(name)
        if most is None:
            raise BundleError(f"the entry {shown} is none of the files that a bundle may hold")
        if name in sizes:
            raise BundleError(f"the entry {shown} is there twice")
        mode = entry.external_attr >> 16
        if mode and not stat.S_ISREG(mode):
            raise BundleError(f"the entry {shown} is a link or another thing that is no file")
        if entry.flag_bits & 0x1 or entry.compress_type not in (0, 8):
            raise BundleError(f"the entry {shown} is encrypted or compressed in an unusual way")
        if entry.file_size > most:
            raise BundleError(
                f"the entry {shown} unpacks to {entry.file_size} bytes; {most} is the most"
            )
        if entry.header_offset != place or entry.extra:
            raise BundleError(
                f"the entry {shown} shares bytes with another one, or there are hidden ones before"
            )
        place += LOCAL_HEADER + len(name.encode()) + entry.compress_size
        sizes[name] = entry.file_size
    if place != archive.start_dir:
        raise BundleError("the zip file has hidden bytes between its entries and their list")
    total = sum(sizes.values())
    if total > limits.unpacked:
        raise BundleError(f"the bundle unpacks to {total} bytes; {limits.unpacked} is the most")
    return sizes
