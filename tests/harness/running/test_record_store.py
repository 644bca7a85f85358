"""Records survive kills at any byte; corruption and contradictions are named."""

import contextlib
import errno
import fcntl
import io
import json
import os
import random
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from itertools import permutations
from pathlib import Path
from typing import Any

import bundle_fakes as fakes
import numpy as np
import pytest
from fake_runs import KEY, RECORD, other
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from run_fakes import fake_config

from robospa.harness.running.atomic_file import StorageError, replace_file, run_lock
from robospa.harness.running.manifest import changed_settings
from robospa.harness.running.policy_probe import read_map
from robospa.harness.running.record_store import (
    RecordWriter,
    read_trace,
    recover_folder,
    write_actions,
)
from robospa.harness.running.request import client_options
from robospa.harness.running.worker import Worker
from robospa.harness.selection import parse_seeds
from robospa.harness.settings import SettingsError
from robospa.leaderboard import bundle as layout
from robospa.leaderboard.bundle import BundleArchive, BundleError, canonical
from robospa.leaderboard.packing import pack
from robospa.leaderboard.traces import decode, encode
from robospa.leaderboard.verify import verify
from robospa.results.records.manifest import RunError, read_manifest, seed_hash
from robospa.results.records.runs import (
    LOCK,
    RepeatabilityError,
    action_path,
    finished,
    from_line,
    merge,
    read_file,
    read_records,
    read_run,
    to_line,
)
from robospa.results.records.trial_record import RetryRow, TrialRecord
from robospa.results.report.run_card import print_scores
from robospa.results.scoring.models import results_of_run
from robospa.trial import TrialKey


def write(folder: Path, *records: TrialRecord) -> Path:
    writer = RecordWriter(folder)
    for record in records:
        writer.write(record)
    writer.close()
    return writer.path


def test_every_prefix_of_a_file_reads_as_its_whole_lines(tmp_path: Path) -> None:
    path = write(tmp_path, RECORD, other(1))
    data = path.read_bytes()
    first = len(to_line(RECORD).encode())
    for size in range(len(data)):
        path.write_bytes(data[:size])
        assert len(read_file(path)) == (size >= first)


def test_a_corrupt_middle_line_is_named(tmp_path: Path) -> None:
    path = write(tmp_path, RECORD, other(1), other(2))
    lines = path.read_bytes().split(b"\n")
    lines[1] = lines[1][:40]
    path.write_bytes(b"\n".join(lines))
    with pytest.raises(RunError, match=r"0000\.jsonl, line 2"):
        read_file(path)


def test_writers_never_share_a_file(tmp_path: Path) -> None:
    first, second = RecordWriter(tmp_path), RecordWriter(tmp_path)
    assert first.path != second.path
    first.close()
    second.close()
    assert not first.path.exists()  # nothing was written


def test_two_records_of_a_trial_are_equal_in_all_but_times(tmp_path: Path) -> None:
    write(tmp_path, RECORD)
    write(tmp_path, replace(RECORD, wall_time=9.0, attempts=2))
    assert list(read_records(tmp_path)) == [KEY]
    write(tmp_path, replace(RECORD, digest="e"))
    with pytest.raises(RepeatabilityError, match="disagree on digest"):
        read_records(tmp_path)


LOST = replace(RECORD, end="infrastructure", success=False, digest="")


@pytest.mark.parametrize("pair", [(RECORD, LOST), (LOST, RECORD)])
def test_a_result_outranks_a_loss(tmp_path: Path, pair: tuple[TrialRecord, ...]) -> None:
    for record in pair:
        write(tmp_path, record)
    assert read_records(tmp_path)[KEY].end == "success"


WITHDRAWN = (
    replace(RECORD, end="policy_error", success=False, digest="x"),
    replace(RECORD, end="infrastructure", success=False, retries=(RetryRow("policy_error"),)),
    replace(RECORD, retries=(RetryRow("policy_error"),), attempts=2),
)


@pytest.mark.parametrize("order", [(0, 1), (1, 0), *permutations(range(3))])
def test_a_policy_error_that_was_withdrawn_is_no_result(
    tmp_path: Path, order: tuple[int, ...]
) -> None:
    for place in order:
        write(tmp_path, WITHDRAWN[place])
    assert read_records(tmp_path)[KEY] == WITHDRAWN[max(order)]


@pytest.mark.parametrize("joints", [None, np.ones((2, 14), np.float32)])
def test_actions_survive_their_file(tmp_path: Path, joints: NDArray[np.float32] | None) -> None:
    actions = np.linspace(0, 1, 32, dtype=np.float32).reshape(2, 16)
    write_actions(tmp_path, KEY, actions, "ee", joints)
    back = read_trace(action_path(tmp_path, KEY))
    assert back.space == "ee"
    np.testing.assert_array_equal(back.actions, actions)
    np.testing.assert_equal(back.joints, joints)


# ---------------------------------------------------------------- one driver per run


def test_a_second_driver_is_told_who_holds_the_run(tmp_path: Path) -> None:
    for _ in range(2):  # it is free again afterwards
        with (
            run_lock(tmp_path),
            pytest.raises(RunError, match=f"another process .process {os.getpid()} on .* is run"),
            run_lock(tmp_path),
        ):
            pass


def test_a_killed_driver_holds_nothing(tmp_path: Path) -> None:
    code = f"""
import os, pathlib
from robospa.harness.running.atomic_file import run_lock
with run_lock(pathlib.Path({str(tmp_path)!r})):
    os.kill(os.getpid(), 9)
"""
    assert subprocess.run([sys.executable, "-c", code]).returncode == -9
    assert b"process" in (tmp_path / LOCK).read_bytes()
    with run_lock(tmp_path):
        pass


def test_a_file_system_without_locks_is_no_reason_to_stop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(file: int, how: int) -> None:
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(fcntl, "flock", refuse)
    with run_lock(tmp_path):
        pass


# ------------------------- what reaches the disk, in which order, and what is left when it does not


def full(*_: object) -> int:
    raise OSError(errno.ENOSPC, "No space left on device")


class Strict(RecordWriter):
    """Refuses a record whose actions are not on disk."""

    def write(self, record: TrialRecord) -> None:
        actions = read_trace(action_path(self.path.parents[1], record.key)).actions
        assert len(actions) == record.steps
        super().write(record)


def test_a_record_is_written_only_after_its_actions(tmp_path: Path) -> None:
    config = fake_config(tmp_path)
    worker = Worker(config, Strict(tmp_path))
    worker.run(KEY, config.policy)
    worker.writer.close()
    worker.close()
    assert list(read_records(tmp_path)) == [KEY]


def test_names_are_on_disk_before_anybody_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[str] = []
    real = os.fsync

    def fsync(file: int) -> None:
        synced.append(os.path.basename(os.readlink(f"/proc/self/fd/{file}")))
        real(file)

    monkeypatch.setattr(os, "fsync", fsync)
    replace_file(tmp_path / "actions" / "x", b"data")
    assert synced[0].endswith(".part") and synced[1:] == ["actions"]
    synced.clear()
    RecordWriter(tmp_path).write(RECORD)
    assert synced == ["trials", tmp_path.name, "0000.jsonl"]


@pytest.mark.parametrize("broken", ["write", "fsync"])
def test_a_record_that_does_not_fit_is_taken_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, broken: str
) -> None:
    writer = RecordWriter(tmp_path)
    writer.write(RECORD)
    real = os.write
    with monkeypatch.context() as patch:
        patch.setattr(os, broken, full if broken == "fsync" else lambda f, d: real(f, d[:100]))
        with pytest.raises(StorageError, match=r"cannot write .*0000\.jsonl: No space left"):
            writer.write(other(1))
    writer.write(other(2))
    assert [r.key.seed for r in read_file(writer.path)] == [KEY.seed, 2]


def test_a_full_disk_is_one_sentence_with_folder_and_free_space(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StorageError) as caught:
        replace_file(tmp_path / "x", b"data")
    text = str(caught.value)
    assert f"cannot write {tmp_path}/x: No space left on device (" in text
    assert text.endswith(f"B free in {tmp_path}); make room")
    assert list(tmp_path.iterdir()) == []


def test_what_a_killed_worker_left_behind_is_settled(tmp_path: Path) -> None:
    writer = RecordWriter(tmp_path)
    writer.write(RECORD)
    os.close(writer._file)  # as the kernel does
    os.close(RecordWriter(tmp_path)._file)
    (tmp_path / "actions").mkdir()
    (tmp_path / "actions" / ".x.npz.12.part").touch()
    (tmp_path / ".run.json.12.part").touch()
    recover_folder(tmp_path)
    left = sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file())
    assert left == ["trials/0000.jsonl"]


def test_a_worker_that_outlives_its_driver_is_not_raced(tmp_path: Path) -> None:
    writer = RecordWriter(tmp_path)
    writer.write(RECORD)
    with pytest.raises(RunError, match=r"an earlier driver still writes to .*0000\.jsonl; end it"):
        recover_folder(tmp_path, patience=0.1)
    writer.close()
    recover_folder(tmp_path, patience=0.1)


# ---------------------------- whatever is in a damaged file, it is read or refused, in one sentence


ALLOWED = (RunError, BundleError, SettingsError)
TOKENS: list[Any] = [None, True, False, 0, -1, 1, 2**31, 2**63, 10**400, 0.5, -0.0, 1e308]
TOKENS += ["", "x", "../../x", "a/b", "\x00", "\ud800", "é", "A" * 5000, [], {}, [[]], [1, "a"]]
TOKENS += [{"a": {}}, {"1": [1]}, "success", "infrastructure", [None], "NaN", float("nan")]
TOKENS += [float("inf"), "100000", {"kind": "success"}, [{"kind": 3}], {"seeds": 1}]
RAW = [b"[" * 3000, b"{" * 300, b'"', b"\\ud800", b"1e999", b"-", b"9" * 5000, b"NaN", b"\n"]
RAW += b'\x00 \xff\xfe null true {"a": , ] } \xff\xff\xff\xff PK\x01\x02'.split()
EXAMPLES = {"bundle": 30, "run": 30}
"""Of these kinds; of the others a hundred."""


def damage(rng: random.Random, seeds: list[bytes]) -> bytes:
    """One of `seeds` with up to four changes."""
    data = bytearray(rng.choice(seeds))
    for _ in range(rng.choice((1, 1, 1, 2, 4))):
        at, kind = rng.randrange(len(data) + 1), rng.randrange(7)
        if kind == 0 and at < len(data):
            data[at] ^= 1 << rng.randrange(8)
        elif kind == 1 and at < len(data):
            data[at] = rng.randrange(256)
        elif kind == 2:
            data[at:at] = rng.choice(RAW)
        elif kind == 3:
            data[at : at + rng.randint(1, 8)] = rng.choice(RAW)
        elif kind == 4:
            del data[at : at + rng.choice((1, 4, 64, 10**9))]
        elif kind == 5:
            data[at:at] = data[at : at + rng.randint(1, 64)]
        else:
            other = rng.choice(seeds)
            data[at:] = other[rng.randrange(len(other) + 1) :]
    return bytes(data)


def change(rng: random.Random, value: Any) -> Any:
    """`value`, JSON, with something in it replaced, left out, added or doubled."""
    if rng.random() < 0.15 or not isinstance(value, (dict, list)) or not value:
        return rng.choice(TOKENS)
    kind = rng.randrange(8)
    if isinstance(value, dict):
        name = rng.choice(list(value))
        if kind == 0:
            return {k: v for k, v in value.items() if k != name}
        if kind == 1:
            return {**value, rng.choice(["x", "", "é", "task", "seed", "0"]): rng.choice(TOKENS)}
        return {**value, name: change(rng, value[name])}
    place = rng.randrange(len(value))
    if kind == 0:
        return value[:place] + value[place + 1 :]
    if kind == 1:
        return [*value, value[place]]
    return [*value[:place], change(rng, value[place]), *value[place + 1 :]]


class Readers:
    """What reads each kind, and the valid files that are damaged."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        (folder / "read").mkdir()
        self.run = fakes.make_run(folder / "run")
        self.bundle = folder / "run.zip"
        pack([self.run], fakes.CARD, self.bundle, fakes.REFERENCE)
        self.files: dict[str, bytes] = fakes.unzip(self.bundle)
        self.known = read_manifest(self.run)
        traces = [np.arange(28, dtype=np.float32).reshape(2, 14), np.zeros((0, 14), np.float32)]
        write_actions(folder, TrialKey("A", 1, 1), traces[0], "joint")
        self.text = next((self.run / "trials").glob("*.jsonl")).read_bytes()
        lines = self.text.splitlines()
        options = {"horizon": 25, "execute": 10, "names": "head:cam", "extra": '{"a": 1}'}
        maps = [b'{"Pick_A": "ws://a:1", "Pick_B": "ws://b:2"}', b'{"Pick_A": ["ws://a"]}']
        self.kinds: dict[str, tuple[list[bytes], Callable[[Path], object]]] = {
            "line": (lines[::7], self.line),
            "records": ([self.text[:2500], self.text[2000:5000], b"\n".join(lines[:2]) + b"\n"],
                lambda path: merge(read_file(path))),
            "run.json": ([(self.run / "run.json").read_bytes()], self.manifest),
            "policy map": (maps, lambda path: read_map(path, ["Pick_A"], ["Pick_A", "Pick_B"])),
            "client options": ([json.dumps(options).encode(), b'{"horizon": 5}'],
                lambda path: client_options("openpi://h:1", path)),
            "seeds": ([b'{"Pick_A": {"1": [1, 2], "2": [3]}}', b"[100000, 100001]"],
                lambda path: parse_seeds(str(path))("Pick_A", 1)),
            "actions": ([next((folder / "actions").glob("*.npz")).read_bytes()], read_trace),
            "traces": ([encode(traces), encode(traces * 3), encode([])],
                lambda path: decode(path.read_bytes(), "actions")),
            "archive": ([self.bundle.read_bytes()], self.archive),
        }  # fmt: skip

    def attempt(self, name: str, rng: random.Random) -> str:
        """How it ended: `read`, or the documented error; anything else is raised."""
        errors = (ValueError,) if name == "line" else ALLOWED
        try:
            if name in ("bundle", "run"):
                (self.forged_bundle if name == "bundle" else self.whole_run)(rng)
            else:
                seeds, read = self.kinds[name]
                path = self.folder / "read" / (f"{name}.json" if name == "seeds" else name)
                path.write_bytes(self.harmed(rng, seeds))
                read(path)
        except errors as error:
            assert 0 < len(str(error)) < 2000, "an error without a word, or with too many"
            return type(error).__name__
        return "read"

    @staticmethod
    def harmed(rng: random.Random, seeds: list[bytes]) -> bytes:
        """A damaged or a changed file."""
        if rng.random() < 0.5:
            return damage(rng, seeds)
        try:
            value = json.loads(rng.choice(seeds))
            for _ in range(rng.choice((1, 1, 2, 4))):
                value = change(rng, value)
            return json.dumps(value).encode()
        except ValueError:
            return damage(rng, seeds)

    def line(self, path: Path) -> None:
        record = from_line(path.read_bytes().decode())
        line = to_line(record)
        line.encode()
        assert from_line(line) == record or "NaN" in line, "a record does not survive its line"
        assert "/" not in record.key.slug and finished(record) in (True, False)
        merge([record, record])

    def manifest(self, path: Path) -> None:
        found = read_manifest(path.parent)
        seed_hash(found.keys)
        changed_settings(found.settings, self.known.settings)

    def archive(self, path: Path) -> None:
        with BundleArchive(path) as archive:
            assert all(archive.read(name) is not None for name in archive.sizes)

    def forged_bundle(self, rng: random.Random) -> None:
        """One inner file changed; the hashes hold again, as a forger would see to."""
        files = dict(self.files)
        name = rng.choice(sorted(files))
        if name == layout.RECORDS and rng.random() < 0.7:
            rows = fakes.rows_of(files)
            place = rng.randrange(len(rows))
            changed = change(rng, rows[place])
            rows[place] = changed if isinstance(changed, dict) else {"record": changed}
            fakes.put_rows(files, rows)
        elif name.endswith("json") and rng.random() < 0.8:
            with contextlib.suppress(ValueError, UnicodeEncodeError):
                files[name] = canonical(change(rng, json.loads(files[name])))
        else:
            files[name] = damage(rng, [files[name]])
        if name != layout.MANIFEST:
            with contextlib.suppress(Exception):  # the forger's own tools may choke on it
                fakes.seal(files)
        verify(fakes.zip_up(self.folder / "b.zip", files), fakes.REFERENCE)

    def whole_run(self, rng: random.Random) -> None:
        """A whole run, one of its records or its manifest changed, up to its tables."""
        run = self.folder / "whole"
        (run / "trials").mkdir(parents=True, exist_ok=True)
        lines, manifest = self.text.splitlines(), (self.run / "run.json").read_bytes()
        place = rng.randrange(len(lines))
        if rng.random() < 0.7:
            lines[place] = json.dumps(change(rng, json.loads(lines[place]))).encode()
        else:
            manifest = json.dumps(change(rng, json.loads(manifest))).encode()
        (run / "run.json").write_bytes(manifest)
        (run / "trials" / "0000.jsonl").write_bytes(b"\n".join(lines) + b"\n")
        with contextlib.redirect_stdout(io.StringIO()):
            found = read_run(run)
            print_scores(found, results_of_run(found))


KINDS = "line,records,run.json,policy map,client options,seeds,actions,traces,archive,bundle,run"


@pytest.fixture(scope="module")
def readers(tmp_path_factory: pytest.TempPathFactory) -> Readers:
    return Readers(tmp_path_factory.mktemp("damaged"))


@pytest.mark.parametrize("name", KINDS.split(","))
def test_a_damaged_file_is_read_or_refused(name: str, readers: Readers) -> None:
    ends: Counter[str] = Counter()

    @settings(max_examples=EXAMPLES.get(name, 100), deadline=None, derandomize=True, database=None)
    @given(st.randoms(use_true_random=False))
    def once(rng: random.Random) -> None:
        ends[readers.attempt(name, rng)] += 1

    once()
    if name not in ("archive", "bundle"):  # a checksum covers all of it
        assert ends["read"]
