"""Whatever is in a damaged file, it is read or refused, in one sentence.

Kinds: a run's records and manifest, its action traces, option files of the command line, and
bundles of the leaderboard as archives, as action files, and with inner files that were changed and
hashed again. Half of the inputs are damaged bytes (bits, cuts, splices, hard numbers), half are
valid JSON in which a value became something else. What is read must be of its kind.
"""

from __future__ import annotations

import contextlib
import io
import json
import random
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import bundle_fakes as fakes
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robospa.harness.running.manifest import changed_settings
from robospa.harness.running.policy_probe import read_map
from robospa.harness.running.record_store import read_actions, write_actions
from robospa.harness.running.request import client_options
from robospa.harness.selection import parse_seeds
from robospa.harness.settings import SettingsError
from robospa.leaderboard import bundle as layout
from robospa.leaderboard.bundle import BundleArchive, BundleError, canonical
from robospa.leaderboard.packing import pack
from robospa.leaderboard.traces import decode, encode
from robospa.leaderboard.verify import verify
from robospa.results.records.manifest import RunError, read_manifest, seed_hash
from robospa.results.records.runs import finished, from_line, merge, read_file, read_run, to_line
from robospa.results.report.score_table import print_scores
from robospa.results.scoring.models import results_of_run
from robospa.trial import TrialKey

ALLOWED = (RunError, BundleError, SettingsError)
TOKENS: list[Any] = [None, True, False, 0, -1, 1, 2**31, 2**63, 10**400, 0.5, -0.0, 1e308]
TOKENS += ["", "x", "../../x", "a/b", "\x00", "\ud800", "é", "A" * 5000, [], {}, [[]], [1, "a"]]
TOKENS += [{"a": {}}, {"1": [1]}, "success", "infrastructure", [None], "NaN", float("nan")]
TOKENS += [float("inf"), "100000", {"kind": "success"}, [{"kind": 3}], {"seeds": 1}]
RAW = [b"[" * 3000, b"{" * 300, b'"', b"\\ud800", b"1e999", b"-", b"9" * 5000, b"NaN", b"\n"]
RAW += b'\x00 \xff\xfe null true {"a": , ] } \xff\xff\xff\xff PK\x01\x02'.split()
EXAMPLES = {"bundle": 12, "run": 30}
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
            "actions": ([next((folder / "actions").glob("*.npz")).read_bytes()], read_actions),
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


def test_an_archive_that_is_not_damaged_is_read(readers: Readers) -> None:
    readers.archive(readers.bundle)
