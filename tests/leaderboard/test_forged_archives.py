"""Archives made to harm their reader: each is refused in one sentence, nothing is written.

Every forger here knows our code: where that makes sense, all hashes and the chain are made to hold
again after the change, so that the rule in question is what catches it.
"""

from __future__ import annotations

import stat
import struct
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bundle_fakes import (
    ACTIONS,
    PICK,
    REFERENCE,
    Files,
    edit_row,
    put_rows,
    refused,
    rows_of,
    seal,
    unzip,
    zip_up,
)

from robospa.leaderboard import bundle as layout
from robospa.leaderboard.bundle import BundleError, BundleLimits
from robospa.leaderboard.traces import HEAD, MAGIC, encode
from robospa.leaderboard.verify import verify


def test_a_zip_bomb(files: Files, tmp_path: Path) -> None:
    files[ACTIONS] = bytes(65 * layout.MEGA)
    path = zip_up(tmp_path / "b.zip", seal(files))
    assert path.stat().st_size < layout.MEGA
    assert "unpacks to 68157440 bytes" in refused(path)


def test_actions_that_unpack_to_more_than_their_trials_have(
    files: Files, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A valid file of four long trials, for four records of at most 20 actions: refused unread."""
    files[ACTIONS] = encode([np.zeros((20_000, 14), np.float32)] * 4)
    monkeypatch.setattr("robospa.leaderboard.verify.decode", lambda data, name: pytest.fail("read"))
    path = zip_up(tmp_path / "b.zip", seal(files))
    assert path.stat().st_size < layout.MEGA / 4
    assert f"{ACTIONS} unpacks to {len(files[ACTIONS])} bytes" in refused(path)


@pytest.mark.parametrize("name", ["run.json", "seeds.json", "report/scores.json"])
def test_json_that_takes_many_times_its_size_in_memory(
    files: Files, tmp_path: Path, name: str
) -> None:
    files[name] = b'{"x":[' + b"[]," * layout.MEGA + b"[]]}"
    path = zip_up(tmp_path / "b.zip", files)
    assert path.stat().st_size < layout.MEGA / 4
    assert f"'{name}' unpacks to" in refused(path)


@pytest.mark.parametrize(
    "fields",
    [
        {"diagnostics": {"x": [[]] * 500}},
        {"diagnostics": {str(n): 0 for n in range(500)}},
        {"diagnostics": {"x": [[[] for _ in range(30)] for _ in range(30)]}},
        {"timing": {str(n): 0.0 for n in range(50)}},
    ],
)
def test_rows_that_take_many_times_their_size_in_memory(
    files: Files, tmp_path: Path, fields: dict[str, Any]
) -> None:
    edit_row(files, 0, lambda row: row["record"].update(fields))
    text = refused(zip_up(tmp_path / "b.zip", seal(files)))
    assert "row 1 has more times or diagnostics than any trial" in text


def test_many_small_bombs(files: Files, tmp_path: Path) -> None:
    path = zip_up(tmp_path / "b.zip", files)
    assert "the bundle unpacks to" in refused(path, BundleLimits(unpacked=10_000))


def test_more_entries_than_a_bundle_can_have(files: Files, tmp_path: Path) -> None:
    path = zip_up(tmp_path / "b.zip", files)
    assert "5 is the most" in refused(path, BundleLimits(entries=5))


def test_a_file_that_is_too_large(files: Files, tmp_path: Path) -> None:
    path = zip_up(tmp_path / "b.zip", files)
    assert "more than the 100 allowed" in refused(path, BundleLimits(packed=100))


def test_an_endless_row(files: Files, tmp_path: Path) -> None:
    edit_row(files, 0, lambda row: row["record"].update(message="x" * 300_000))
    assert "longer than" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_more_rows_than_allowed(files: Files, tmp_path: Path) -> None:
    put_rows(files, [*rows_of(files), rows_of(files)[-1]])
    path = zip_up(tmp_path / "b.zip", seal(files))
    assert "is there twice" in refused(path)
    assert "lists more than 39 trials" in refused(path, BundleLimits(rows=39))


def test_more_rows_than_the_reader_takes(honest: Path) -> None:
    import hashlib

    from robospa.leaderboard.untrusted import BundleArchive

    with (
        BundleArchive(honest, BundleLimits(rows=3)) as archive,
        pytest.raises(BundleError, match="has more than 3 rows"),
    ):
        list(archive.rows(layout.RECORDS, hashlib.sha256()))


def test_a_size_that_is_a_lie(honest: Path, tmp_path: Path) -> None:
    data = bytearray(honest.read_bytes())
    with zipfile.ZipFile(honest) as archive:
        info = archive.getinfo(layout.RECORDS)
    name = layout.RECORDS.encode()
    for start, mark, place in ((info.header_offset, b"PK\x03\x04", 22), (None, b"PK\x01\x02", 24)):
        at = start if start is not None else data.rfind(name) - 46
        assert data[at : at + 4] == mark
        data[at + place : at + place + 4] = struct.pack("<I", 100)
    (tmp_path / "b.zip").write_bytes(data)
    assert refused(tmp_path / "b.zip")


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("../../outside.txt", "leads out of the bundle"),
        ("/etc/passwd", "leads out of the bundle"),
        ("actions/../../x.bin", "leads out of the bundle"),
        ("..\\outside.txt", "leads out of the bundle"),
        ("C:evil.txt", "leads out of the bundle"),
        ("setup.py", "none of the files"),
        ("actions/<img src=x>-L1.bin", "none of the files"),
        ("videos/x.html", "none of the files"),
        ("actions/", "none of the files"),
        (f"actions/{PICK}-L1.bin\n", "none of the files"),
        ("manifest.json\0.txt", "none of the files"),
    ],
)
def test_path_tricks(files: Files, tmp_path: Path, name: str, words: str) -> None:
    path = zip_up(tmp_path / "b.zip", files)
    with zipfile.ZipFile(path, "a") as archive:
        if "\0" in name:  # our own zip library cuts such a name when it writes it
            placeholder = name.replace("\0", "#")
            archive.writestr(placeholder, b"x")
        else:
            archive.writestr(name, b"x")
    if "\0" in name:
        data = path.read_bytes().replace(placeholder.encode(), name.encode())
        path.write_bytes(data)
    assert words in refused(path)


def test_a_link(files: Files, tmp_path: Path) -> None:
    path = tmp_path / "b.zip"
    del files["model.json"]
    with zipfile.ZipFile(path, "w") as archive:
        link = zipfile.ZipInfo("model.json")
        link.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(link, "/etc/passwd")
        for name, data in files.items():
            archive.writestr(name, data)
    assert "is a link" in refused(path)


@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_a_name_twice(files: Files, tmp_path: Path) -> None:
    path = zip_up(tmp_path / "b.zip", files)
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr("model.json", b"{}")
    assert "is there twice" in refused(path)


@pytest.mark.parametrize("where", ["before", "between", "after", "comment"])
def test_bytes_that_belong_to_no_entry(honest: Path, tmp_path: Path, where: str) -> None:
    path = tmp_path / "b.zip"
    path.write_bytes(honest.read_bytes())
    if where == "comment":
        with zipfile.ZipFile(path, "a") as archive:
            archive.comment = b"#!/bin/sh"
    else:
        junk = b"#!/bin/sh\nexit\n"
        whole = honest.read_bytes()
        if where == "between":
            start = struct.unpack("<I", whole[-6:-2])[0]
            moved = whole[start:-6] + struct.pack("<I", start + len(junk)) + whole[-2:]
            whole, junk = whole[:start] + junk + moved, b""
        path.write_bytes(junk + whole if where == "before" else whole + junk)
    assert "zip file" in refused(path)


def test_entries_that_share_bytes(files: Files, tmp_path: Path) -> None:
    path = zip_up(tmp_path / "b.zip", files)
    with zipfile.ZipFile(path) as archive:
        infos = archive.infolist()
    data = path.read_bytes()
    central = data.find(b"PK\x01\x02")
    second = data.find(b"PK\x01\x02", central + 4)
    offset = struct.pack("<I", infos[0].header_offset)
    path.write_bytes(data[: second + 42] + offset + data[second + 46 :])
    assert "shares bytes" in refused(path)


def test_an_encrypted_entry(honest: Path, tmp_path: Path) -> None:
    data = bytearray(honest.read_bytes())
    data[data.find(b"PK\x01\x02") + 8] |= 1
    (tmp_path / "b.zip").write_bytes(data)
    assert "encrypted" in refused(tmp_path / "b.zip")


def test_an_unusual_compression(files: Files, tmp_path: Path) -> None:
    assert "unusual" in refused(zip_up(tmp_path / "b.zip", files, zipfile.ZIP_LZMA))


def test_damaged_bytes(honest: Path, tmp_path: Path) -> None:
    data = bytearray(honest.read_bytes())
    with zipfile.ZipFile(honest) as archive:
        info = archive.getinfo(layout.RECORDS)
    data[info.header_offset + 200] ^= 0xFF
    (tmp_path / "b.zip").write_bytes(data)
    assert refused(tmp_path / "b.zip")


@pytest.mark.parametrize(("trials", "width"), [(2**32 - 1, 14), (4, 2**31), (4, 65)])
def test_a_huge_array(files: Files, tmp_path: Path, trials: int, width: int) -> None:
    files[ACTIONS] = HEAD.pack(MAGIC, trials, width) + bytes(64)
    assert "more than it can hold" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_an_array_longer_than_its_file(files: Files, tmp_path: Path) -> None:
    lengths = struct.pack("<4I", *[2**32 - 1] * 4)
    files[ACTIONS] = HEAD.pack(MAGIC, 4, 14) + lengths + bytes(64)
    assert "announces 17179869180 actions" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_numbers_that_no_action_has(files: Files, tmp_path: Path) -> None:
    steps = np.full((4, 14), 0xFFFFFFFE, ">u4")  # the zigzag of 2^31 - 1 steps
    planes = steps.reshape(-1).view(np.uint8).reshape(-1, 4).T.tobytes()
    files[ACTIONS] = HEAD.pack(MAGIC, 4, 14) + struct.pack("<4I", *[1] * 4) + planes
    path = zip_up(tmp_path / "b.zip", seal(files))
    assert f"{ACTIONS} has an action with a number beyond" in refused(path)


def test_actions_off_the_grid_cannot_be_written_down() -> None:
    for odd in (0.1, np.nan, np.inf):
        with pytest.raises(ValueError, match="finer than 1/65536"):
            encode([np.full((1, 14), odd, np.float32)])


@pytest.mark.parametrize("number", ["NaN", "-Infinity", "1e999", "9" * 5000])
def test_numbers_that_are_none(files: Files, tmp_path: Path, number: str) -> None:
    old = b'"wall_time":'
    line, rest = files[layout.RECORDS].split(b"\n", 1)
    start = line.index(old) + len(old)
    end = line.index(b",", start)
    files[layout.RECORDS] = line[:start] + number.encode() + line[end:] + b"\n" + rest
    text = refused(zip_up(tmp_path / "b.zip", seal(files)))
    assert "row 1" in text


def test_a_number_where_text_belongs(files: Files, tmp_path: Path) -> None:
    edit_row(files, 0, lambda row: row["record"].update(message=3))
    assert "'message' must be text, not 3" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_nesting_without_end(files: Files, tmp_path: Path) -> None:
    files["model.json"] = b"[" * 100_000 + b"]" * 100_000
    assert "nested" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_a_field_given_twice(files: Files, tmp_path: Path) -> None:
    files["model.json"] = files["model.json"][:-1] + b',"name":"Another"}'
    assert "there twice" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_nothing_is_written_and_an_honest_bundle_passes(
    honest: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import builtins
    import io

    written: list[object] = []
    real = io.open

    def watched(file: Any, mode: str = "r", *more: Any, **named: Any) -> Any:
        if set(mode) & set("wax+"):
            written.append(file)
        return real(file, mode, *more, **named)

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(builtins, "open", watched)
    monkeypatch.setattr(io, "open", watched)
    assert verify(honest, REFERENCE).evidence.trials == 40
    assert written == []
    assert list(tmp_path.iterdir()) == []


def test_all_files_of_an_honest_bundle_are_known(honest: Path) -> None:
    assert all(layout.most_bytes(name) for name in unzip(honest))
