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
from robospa.leaderboard.bundle import BundleError, canonical
from robospa.leaderboard.packing import pack
from robospa.leaderboard.traces import decode, encode
from robospa.leaderboard.untrusted import BundleArchive
from robospa.leaderboard.verify import verify
from robospa.results.records.manifest import RunError, read_manifest, seed_hash
from robospa.results.records.run_io import finished, from_line, merge, read_file, read_run, to_line
from robospa.trial import TrialKey

ALLOWED = (RunError, BundleError, SettingsError)
DOCUMENTED: dict[str, tuple[type[Exception], ...]] = {"line": (ValueError,)}
TOKENS: list[Any] = [None, True, False, 0, -1, 1, 2**31, 2**63, 10**400, 0.5, -0.0, 1e308]
TOKENS += ["", "x", "../../x", "a/b", "\x00", "\ud800", "é", "A" * 5000, [], {}, [[]], [1, "a"]]
TOKENS += [{"a": {}}, {"1": [1]}, "success", "infrastructure", [None], "NaN", float("nan")]
TOKENS += [float("inf"), "100000", {"kind": "success"}, [{"kind": 3}], {"seeds": 1}]
RAW = [
    b"[" * 3000,
    b"{" * 300,
    b'"',
    b"\\ud800",
    b"1e999",
    b"-",
    b"9" * 5000,
    b"NaN",
    b"\n",
    b"\x00",
]
RAW += [b"\xff\xfe", b"null", b"true", b'{"a":', b",", b"]", b"}", b"\xff" * 4, b"PK\x01\x02"]
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
        self.run = fakes.make_run(folder / "run")
        self.bundle = folder / "run.zip"
        pack([self.run], fakes.CARD, self.bundle, fakes.REFERENCE)
        self.files: dict[str, bytes] = fakes.unzip(self.bundle)
        self.known = read_manifest(self.run)
        traces = [np.arange(28, dtype=np.float32).reshape(2, 14), np.zeros((0, 14), np.float32)]
        write_actions(folder, TrialKey("A", 1, 1), traces[0], "joint")
        text = next((self.run / "trials").glob("*.jsonl")).read_bytes()
        options = {"horizon": 25, "execute": 10, "names": "head:cam", "extra": '{"a": 1}'}
        self.seeds: dict[str, list[bytes]] = {
            "line": text.splitlines()[::7],
            "records": [text[:2500], text[2000:5000], b"\n".join(text.splitlines()[:2]) + b"\n"],
            "manifest": [(self.run / "run.json").read_bytes()],
            "policy map": [
                b'{"Pick_A": "ws://a:1", "Pick_B": "ws://b:2"}',
                b'{"Pick_A": ["ws://a"]}',
            ],
            "client options": [json.dumps(options).encode(), b'{"horizon": 5}'],
            "seeds": [b'{"Pick_A": {"1": [1, 2], "2": [3]}}', b"[100000, 100001]"],
            "actions": [next((folder / "actions").glob("*.npz")).read_bytes()],
            "traces": [encode(traces), encode(traces * 3), encode([])],
            "archive": [self.bundle.read_bytes()],
            "bundle": [self.files[name] for name in sorted(self.files) if name.endswith("json")],
            "run": [],
        }
        self.last: Any = b""

    def input(self, name: str, rng: random.Random) -> bytes:
        """A damaged or a changed file of the kind `name`."""
        seeds = self.seeds[name]
        if rng.random() < 0.5:
            self.last = damage(rng, seeds)
        else:
            try:
                value = json.loads(rng.choice(seeds))
                for _ in range(rng.choice((1, 1, 2, 4))):
                    value = change(rng, value)
                self.last = json.dumps(value).encode()
            except ValueError:
                self.last = damage(rng, seeds)
        data: bytes = self.last
        return data

    def _put(self, name: str, rng: random.Random, place: str) -> Path:
        path = self.folder / place
        path.write_bytes(self.input(name, rng))
        return path

    def _line(self, rng: random.Random) -> None:
        record = from_line(self.input("line", rng).decode())
        line = to_line(record)
        line.encode()
        assert from_line(line) == record or "NaN" in line, "a record does not survive its line"
        assert "/" not in record.key.slug and finished(record) in (True, False)
        merge([record, record])

    def _records(self, rng: random.Random) -> None:
        merge(read_file(self._put("records", rng, "records.jsonl")))

    def _manifest(self, rng: random.Random) -> None:
        (self.folder / "m").mkdir(exist_ok=True)
        self._put("manifest", rng, "m/run.json")
        found = read_manifest(self.folder / "m")
        seed_hash(found.keys)
        changed_settings(found.settings, self.known.settings)

    def _policy_map(self, rng: random.Random) -> None:
        read_map(self._put("policy map", rng, "map.json"), ["Pick_A"], ["Pick_A", "Pick_B"])

    def _client_options(self, rng: random.Random) -> None:
        client_options("openpi://h:1", self._put("client options", rng, "client.json"))

    def _seeds(self, rng: random.Random) -> None:
        parse_seeds(str(self._put("seeds", rng, "seeds.json")))("Pick_A", 1)

    def _actions(self, rng: random.Random) -> None:
        read_actions(self._put("actions", rng, "a.npz"))

    def _traces(self, rng: random.Random) -> None:
        decode(self.input("traces", rng), "actions")

    def _archive(self, rng: random.Random) -> None:
        with BundleArchive(self._put("archive", rng, "a.zip")) as archive:
            for name in archive.sizes:
                archive.read(name)

    def _bundle(self, rng: random.Random) -> None:
        """One inner file changed; the hashes hold again, as a forger would see to."""
        files = dict(self.files)
        name = rng.choice(sorted(files))
        self.last = name, damage(rng, [files[name]])
        if name == layout.RECORDS and rng.random() < 0.7:
            rows = fakes.rows_of(files)
            place = rng.randrange(len(rows))
            changed = change(rng, rows[place])
            rows[place] = changed if isinstance(changed, dict) else {"record": changed}
            fakes.put_rows(files, rows)
        elif name.endswith("json") and rng.random() < 0.8:
            try:
                files[name] = canonical(change(rng, json.loads(files[name])))
            except (ValueError, UnicodeEncodeError):
                return
        else:
            files[name] = self.last[1]
        self.last = name, files[name]
        if name != layout.MANIFEST:
            with contextlib.suppress(Exception):  # the forger's own tools may choke on it
                fakes.seal(files)
        verify(fakes.zip_up(self.folder / "b.zip", files), fakes.REFERENCE)

    def _run(self, rng: random.Random) -> None:
        """A whole run, one of its records or its manifest changed, up to its tables."""
        from robospa.results.report.score_table import print_scores
        from robospa.results.scoring.scores import score_run

        run = self.folder / "whole"
        (run / "trials").mkdir(parents=True, exist_ok=True)
        lines = next((self.run / "trials").glob("*.jsonl")).read_bytes().splitlines()
        place, manifest = rng.randrange(len(lines)), (self.run / "run.json").read_bytes()
        if rng.random() < 0.7:
            lines[place] = json.dumps(change(rng, json.loads(lines[place]))).encode()
        else:
            manifest = json.dumps(change(rng, json.loads(manifest))).encode()
        self.last = lines[place], manifest
        (run / "run.json").write_bytes(manifest)
        (run / "trials" / "0000.jsonl").write_bytes(b"\n".join(lines) + b"\n")
        with contextlib.redirect_stdout(io.StringIO()):
            found = read_run(run)
            print_scores(found, score_run(found))

    def attempt(self, name: str, rng: random.Random) -> str:
        """How it ended: `read`, or the documented error; anything else is raised."""
        target: Callable[[random.Random], None] = getattr(self, f"_{name.replace(' ', '_')}")
        try:
            target(rng)
        except DOCUMENTED.get(name, ALLOWED) as error:
            assert 0 < len(str(error)) < 2000, "an error without a word, or with too many"
            return type(error).__name__
        return "read"


KINDS = "line,records,manifest,policy map,client options,seeds,actions,traces,archive,bundle,run"


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
    with BundleArchive(readers.bundle) as archive:
        assert all(archive.read(name) for name in archive.sizes)
