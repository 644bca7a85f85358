"""Reading a zip file from strangers: looked at whole before a byte is unpacked, never extracted.

Refused: anything before, between or after the archive's own parts that would make two readers see
two archives; names that are not on the list, paths that lead elsewhere, names given twice; links,
folders and encrypted entries; files that unpack to more than their kind or the whole may have.
Every file is read into memory, at most as far as its announced size.
"""

from __future__ import annotations

import hashlib
import stat
import struct
import zipfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType

from robospa.leaderboard.bundle import BundleError, Limits, most_bytes

END = struct.Struct("<4s4H2LH")
"""A zip file's last record, without a comment."""
LOCAL_HEADER = 30
"""Bytes before an entry's name, in front of its data."""
BROKEN = (zipfile.BadZipFile, zlib.error, EOFError, OSError, NotImplementedError, ValueError)


class Archive:
    """A bundle's zip file, open for reading; use as a context manager."""

    def __init__(self, path: Path, limits: Limits | None = None) -> None:
        """Raises BundleError unless every entry is one that a bundle may have."""
        self.path = path
        self.limits = limits or Limits()
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

    def __enter__(self) -> Archive:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._zip.close()

    def read(self, name: str) -> bytes:
        """All bytes of the file `name`."""
        if name not in self.sizes:
            raise BundleError(f"the bundle has no {name}")
        try:
            with self._zip.open(name) as file:
                data = file.read(self.sizes[name] + 1)
        except BROKEN as error:
            raise BundleError(f"{name} cannot be unpacked: {str(error)[:120]}") from None
        if len(data) != self.sizes[name]:
            raise BundleError(f"{name} does not unpack to the size that it announces")
        return data

    def rows(self, name: str, digest: hashlib._Hash) -> Iterator[bytes]:
        """The lines of the file `name`, without their newlines; `digest` gets all bytes."""
        if name not in self.sizes:
            raise BundleError(f"the bundle has no {name}")
        try:
            with self._zip.open(name) as file:
                for number in range(1, self.limits.rows + 2):
                    line = file.readline(self.limits.row + 1)
                    if not line:
                        return
                    if number > self.limits.rows:
                        raise BundleError(f"{name} has more than {self.limits.rows} rows")
                    if not line.endswith(b"\n"):
                        raise BundleError(
                            f"{name}, row {number} is torn off or longer than "
                            f"{self.limits.row} bytes"
                        )
                    digest.update(line)
                    yield line[:-1]
        except BROKEN as error:
            raise BundleError(f"{name} cannot be unpacked: {str(error)[:120]}") from None


def _check_frame(path: Path, limits: Limits) -> None:
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


def _check_entries(archive: zipfile.ZipFile, limits: Limits) -> dict[str, int]:
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
