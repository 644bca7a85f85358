"""Bundles made to harm their reader or to pass for others: each is refused in one sentence.

Every forger here knows our code: where that makes sense, all hashes and the chain are made to hold
again after the change, so that the rule in question is what catches it.
"""

import json
import stat
import struct
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bundle_fakes import (
    ACTIONS,
    PICK,
    PRESS,
    REFERENCE,
    Files,
    claim_success,
    edit,
    edit_row,
    put_rows,
    refused,
    relist,
    rows_of,
    seal,
    unzip,
    zip_up,
)

from robospa.harness.sim.motion import RATE
from robospa.leaderboard import bundle as layout
from robospa.leaderboard.bundle import BundleArchive, BundleError, BundleLimits
from robospa.leaderboard.rules import check_scenes, first_wrong
from robospa.leaderboard.traces import HEAD, MAGIC, Trace, decode, encode
from robospa.leaderboard.trial_rows import check_record, check_trace, trace_hash
from robospa.leaderboard.verify import Valid, read_traces, verify
from robospa.results.records.trial_record import RetryRow, TrialRecord
from robospa.trial import TrialKey

Forgery = Callable[[Files], object]
OTHER_ACTIONS = layout.actions_name(PRESS, 1)


def put(name: str, data: bytes) -> Forgery:
    """The file `name` is `data`."""
    return lambda files: files.update({name: data})


def field(file: str, /, *path: str, **values: Any) -> Forgery:
    """Fields of the JSON file `file`, inside of `path`, have other values."""

    def change(data: Any) -> None:
        for step in path:
            data = data[step]
        data.update(values)

    return lambda files: edit(files, file, change)


def record(**values: Any) -> Forgery:
    """The first record has other values."""
    return lambda files: edit_row(files, 0, lambda row: row["record"].update(values))


def first_failure(change: Callable[[Any], None]) -> Forgery:
    def forge(files: Files) -> None:
        rows = rows_of(files)
        edit_row(files, [row["record"]["success"] for row in rows].index(False), change)

    return forge


def rows(change: Callable[[list[Any]], list[Any]], listed: bool = False) -> Forgery:
    """The rows are what `change` makes of them; `listed`: the run lists just these trials."""

    def forge(files: Files) -> None:
        made = change(rows_of(files))
        if listed:
            relist(files, [TrialKey(**row["record"]["key"]) for row in made])
        put_rows(files, made)

    return forge


def keyed(change: Callable[[Any], Any]) -> Callable[[list[Any]], list[Any]]:
    """Every row with another key."""

    def forge(made: list[Any]) -> list[Any]:
        for row in made:
            row["record"]["key"].update(change(row["record"]["key"]))
        return made

    return forge


def swap(first: str, second: str) -> Forgery:
    def forge(files: Files) -> None:
        files[first], files[second] = files[second], files[first]

    return forge


def hashes_to_match(files: Files) -> None:
    """Another task's actions, whose hashes the rows have."""
    files[ACTIONS] = files[OTHER_ACTIONS]
    made = rows_of(files)
    for row, trace in zip(made, decode(files[ACTIONS], ""), strict=False):
        row["trace"] = trace_hash(trace)
    put_rows(files, made)


def other_start(files: Files) -> None:
    lines = files[layout.RECORDS].splitlines()
    first = json.dumps({**json.loads(lines[0]), "previous": "1" * 64}).encode()
    files[layout.RECORDS] = b"\n".join([first, *lines[1:], b""])


def number(text: str) -> Forgery:
    """A wall time that is no number."""

    def forge(files: Files) -> None:
        line, rest = files[layout.RECORDS].split(b"\n", 1)
        start = line.index(b'"wall_time":') + 12
        line = line[:start] + text.encode() + line[line.index(b",", start) :]
        files[layout.RECORDS] = line + b"\n" + rest

    return forge


def replaced(name: str, old: bytes, new: bytes) -> Forgery:
    return lambda files: files.update({name: files[name].replace(old, new, 1)})


def film(files: Files) -> str:
    return next(name for name in files if name.startswith("videos/"))


def other_film(files: Files) -> None:
    old = film(files)
    level = 3 if f"{PICK}-L1-" in old else 1
    files[f"videos/{PICK}-L{level}-100001-aloha-agilex-clean-heldout.mp4"] = files.pop(old)


def four_of(count: int, data: bytes) -> bytes:
    """Four traces of `count` actions of 14 numbers each."""
    return HEAD.pack(MAGIC, 4, 14) + struct.pack("<4I", *[count] * 4) + data


def other_setting(name: str, value: str) -> Forgery:
    """All trials of the run, and the run itself, have another mode, robot or split."""

    def forge(files: Files) -> None:
        edit(files, layout.RUN, lambda run: run["settings"].update({name: [value]}))
        relist(files, [TrialKey(**{**r["record"]["key"], name: value}) for r in rows_of(files)])

    return forge


NEW = (("mode", "moonlight"), ("embodiment", "humanoid-9000"), ("split", "easy"))
SPEC = (layout.RUN, "settings", "policy", "spec")
BIGGEST = np.full((4, 14), 0xFFFFFFFE, ">u4").reshape(-1).view(np.uint8)  # zigzag of 2^31 - 1
FORGERIES: list[tuple[Forgery, str]] = [
    # sizes
    (put(ACTIONS, bytes(65 * layout.MEGA)), "unpacks to 68157440 bytes"),
    (record(message="x" * 300_000), "longer than"),
    (record(diagnostics={"x": [[]] * 700}), "more times or diagnostics"),
    (record(diagnostics={str(n): 0 for n in range(700)}), "more times or diagnostics"),
    (record(diagnostics={"x": [[[]] * 30] * 30}), "more times or diagnostics"),
    (record(timing={str(n): 0.0 for n in range(50)}), "more times or diagnostics"),
    (rows(lambda made: [*made, made[-1]]), "is there twice"),
    # arrays
    *(
        (put(ACTIONS, HEAD.pack(MAGIC, trials, width) + bytes(64)), "more than it can hold")
        for trials, width in ((2**32 - 1, 14), (4, 2**31), (4, 65))
    ),
    (put(ACTIONS, four_of(2**32 - 1, bytes(64))), "announces 17179869180 actions"),
    (put(ACTIONS, four_of(1, BIGGEST.reshape(-1, 4).T.tobytes())), "a number beyond"),
    (swap(ACTIONS, OTHER_ACTIONS), "other actions than its row says"),
    (hashes_to_match, "not those of its record"),
    (lambda files: files.pop(ACTIONS), f"has no {ACTIONS}"),
    # JSON
    *((number(text), "row 1") for text in ("NaN", "-Infinity", "1e999", "9" * 5000)),
    (record(message=3), "'message' must be text, not 3"),
    (put(layout.CARD, b"[" * 100_000 + b"]" * 100_000), "nested"),
    (
        lambda files: files.update({layout.CARD: files[layout.CARD][:-1] + b',"name":"Another"}'}),
        "there twice",
    ),
    # the chain, rows and seeds
    (replaced(layout.RECORDS, b'"message":""', b'"message":"x"'), "does not follow the row"),
    (other_start, "does not follow"),
    (rows(lambda made: [made[1], made[0], *made[2:]]), "row 1 is"),
    (rows(lambda made: made[:-1]), "trials are missing"),
    (rows(lambda made: [*made[:3], made[2], *made[4:]]), "is there twice"),
    (rows(lambda made: [*made[:3], made[2], *made[4:]], listed=True), "more than once|twice"),
    (rows(keyed(lambda key: {"seed": key["seed"] - 10**5}), listed=True), "not in the shipped"),
    (rows(lambda made: made[1:], listed=True), "incomplete: 1 of its 4 listed seeds"),
    (rows(lambda made: [r for r in made if r["record"]["key"]["level"] < 5], listed=True), "L5"),
    (rows(keyed(lambda key: {"task": "Easy_" + key["task"]}), listed=True), "no variant with"),
    # what follows from the records
    (first_failure(lambda row: row["record"].update(success=True, end="success")), "say False"),
    (first_failure(claim_success), "is not what the records give"),
    (field(layout.OUTCOMES, f"{PICK}/1", success="1111"), "outcomes.json is not what"),
    (replaced(layout.SCORES, b"0.75", b"0.99"), "scores.json is not what the records give"),
    (other_film, "video"),
    (lambda files: files.update({film(files): b"<html>" * 9}), "is not an MP4 video"),
    # text
    *(
        (field(layout.CARD, name=text), "model")
        for text in (
            *("<script>alert(1)</script>", "<img src=x onerror=alert(1)>", "javascript:alert(1)"),
            *("a\u202eb", "a\u0000b", "a\u200bb", '" onload="alert(1)', "x" * 81, ""),
        )
    ),
    *(
        (field(layout.CARD, link=link), "model")
        for link in ("javascript:alert(1)", "http://x.org", 'https://x.org/"><b>')
    ),
    *(
        (record(**{name: text}), "markup")
        for name in ("instruction", "message", "digest")
        for text in ("<script>", "</td>", "<svg/onload=x>")
    ),
    (replaced(layout.RECORDS, b'"message":""', b'"message":"\\u003cscript>"'), "follow|markup"),
    (field(*SPEC, name="<script>"), "markup"),
    # other versions, and settings that do not count
    (field(layout.CARD, onload="x"), "unknown field 'onload'"),
    (record(reward=1.0), "newer version"),
    (field(*SPEC, privileged=True), "privileged"),
    (field(*SPEC, environment_state=True), "privileged"),
    (field(layout.RUN, "settings", "world", name="os:getcwd"), "another world"),
    (field(layout.RUN, "settings", "world", gravity=0), "says what no run says: settings, world"),
    (field(layout.RUN, "about", "versions", python="2.7.1"), "of python, which cannot be"),
    (field(layout.RUN, "about", "versions", sapien="1.0"), "of sapien, which cannot be"),
    (field(layout.RUN, "about", code="x"), "cannot be"),
    (field(layout.RUN, "about", "machine", cores=0), "cannot be"),
    (field(layout.RUN, "about", warnings=["x" * 20_000]), "bytes of itself; 20000 are the most"),
    (field(*SPEC, name="x" * 20_000), "bytes of itself; 20000 are the most"),
    # records that cannot be (more of them below), and policies
    (record(steps=0), "nothing happens without any"),
    (record(end="vanished"), "'end' must be one of success, "),
    (record(diagnostics={"roles": {"a": 5}}), "'roles' must be a list"),
    (record(diagnostics={"pressed": 5}), "'pressed' must be a list, not 5"),
    (field(layout.RUN, "about", "machine", cores=10**400), "not finite or too large"),
    (put(layout.SCORES, b"[1" + 400 * b"0" + b"]"), "not finite or too large"),
    (record(success=1), "'success' must be true or false, not 1"),
    (record(instruction="x"), "has another sentence ('x', not 'level 1: sum to 1')"),
    (record(scene_digest="0" * 16), "has another scene ('0000000000000000', not "),
    *(
        (other_setting(*new), f"the run's {new[0]} is {new[1]!r}, which is not known")
        for new in NEW
    ),
    *(
        (field(layout.RUN, "settings", policies=policies), words)
        for policies, words in (
            ({"Easy_Task": {"spec": {"name": "x", "action": "joint"}}}, "a policy for 'Easy_Task'"),
            ({PICK: {"spec": {"name": "x", "action": "joint"}}}, "hold no policy spec for Press"),
            ({PICK: None}, "'settings.policies' must be a map"),
            ({PICK: {"spec": {"name": "x", "action": "fly"}}}, "must be one of joint"),
            ({PICK: {"spec": {"name": "x", "action": "joint", "horizon": 0}}}, "whole number >= 1"),
            ([], "must be a map"),
        )
    ),
]


@pytest.mark.parametrize(("forge", "words"), FORGERIES, ids=[w for _, w in FORGERIES])
def test_a_sealed_forgery(files: Files, tmp_path: Path, forge: Forgery, words: str) -> None:
    forge(files)
    assert_refused(zip_up(tmp_path / "b.zip", seal(files)), words)


def assert_refused(path: Path, words: str, limits: BundleLimits | None = None) -> None:
    text = refused(path, limits)
    assert any(word in text for word in words.split("|")), text


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"chain": {"rows": 40, "last": "0" * 64}}, "does not end as the manifest says"),
        ({"format": 1}, "format 1; this robospa reads 2"),
        ({"suite": "robospa-99"}, "robospa-99"),
    ],
)
def test_a_sealed_manifest(
    files: Files, tmp_path: Path, changes: dict[str, Any], words: str
) -> None:
    assert_refused(zip_up(tmp_path / "b.zip", seal(files, **changes)), words)


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        (BundleLimits(unpacked=10_000), "the bundle unpacks to"),
        (BundleLimits(entries=5), "5 is the most"),
        (BundleLimits(packed=100), "more than the 100 allowed"),
        (BundleLimits(rows=39), "lists more than 39 trials"),
    ],
)
def test_more_than_a_bundle_can_have(honest: Path, limits: BundleLimits, words: str) -> None:
    assert_refused(honest, words, limits)


def test_more_rows_than_the_reader_takes(honest: Path) -> None:
    import hashlib

    with (
        BundleArchive(honest, BundleLimits(rows=3)) as archive,
        pytest.raises(BundleError, match="has more than 3 rows"),
    ):
        list(archive.rows(layout.RECORDS, hashlib.sha256()))


def test_actions_that_unpack_to_more_than_their_trials_have(
    files: Files, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A valid file of four long trials, for four records of at most 20 actions: refused unread."""
    files[ACTIONS] = encode([np.zeros((20_000, 14), np.float32)] * 4)
    monkeypatch.setattr("robospa.leaderboard.verify.decode", lambda data, name: pytest.fail("read"))
    assert_refused(zip_up(tmp_path / "b.zip", seal(files)), f"{ACTIONS} unpacks to")


@pytest.mark.parametrize("name", [layout.RUN, layout.SCORES])
def test_json_that_takes_many_times_its_size_in_memory(
    files: Files, tmp_path: Path, name: str
) -> None:
    files[name] = b'{"x":[' + b"[]," * layout.MEGA + b"[]]}"
    assert_refused(zip_up(tmp_path / "b.zip", files), f"'{name}' unpacks to")


@pytest.mark.parametrize("name", [layout.CARD, layout.RUN, layout.SCORES])
def test_a_file_changed_behind_the_manifest(files: Files, tmp_path: Path, name: str) -> None:
    same_size = files[name].replace(b":", b";", 1)
    for data in (files[name][:-1] + b" }", same_size):
        assert_refused(zip_up(tmp_path / "b.zip", {**files, name: data}), f"{name} was changed")


def test_a_manifest_changed_behind_its_hash(files: Files, tmp_path: Path) -> None:
    field(layout.MANIFEST, robospa="9.9")(files)
    assert_refused(zip_up(tmp_path / "b.zip", files), "the manifest was changed")
    del files[ACTIONS]
    assert_refused(zip_up(tmp_path / "c.zip", files), "lacks|the manifest was changed")


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
        ("model.json", "is there twice"),
    ],
)
@pytest.mark.filterwarnings("ignore:Duplicate name")
def test_names_of_entries(files: Files, tmp_path: Path, name: str, words: str) -> None:
    path = zip_up(tmp_path / "b.zip", files)
    placeholder = name.replace("\0", "#")  # our own zip library cuts such a name
    with zipfile.ZipFile(path, "a") as archive:
        archive.writestr(placeholder, b"x")
    if placeholder != name:
        path.write_bytes(path.read_bytes().replace(placeholder.encode(), name.encode()))
    assert_refused(path, words)


def test_a_link(files: Files, tmp_path: Path) -> None:
    del files["model.json"]
    path = zip_up(tmp_path / "b.zip", files)
    with zipfile.ZipFile(path, "a") as archive:
        link = zipfile.ZipInfo("model.json")
        link.external_attr = (stat.S_IFLNK | 0o777) << 16
        archive.writestr(link, "/etc/passwd")
    assert_refused(path, "is a link")


JUNK = b"#!/bin/sh\nexit\n"


def junk_between(whole: bytes) -> bytes:
    start = struct.unpack("<I", whole[-6:-2])[0]
    end = struct.pack("<I", start + len(JUNK)) + whole[-2:]
    return whole[:start] + JUNK + whole[start:-6] + end


def with_comment(whole: bytes) -> bytes:
    return whole[:-2] + struct.pack("<H", len(JUNK)) + JUNK


def shared_bytes(whole: bytes) -> bytes:
    central = whole.find(b"PK\x01\x02")
    second = whole.find(b"PK\x01\x02", central + 4)
    return whole[: second + 42] + whole[central + 42 : central + 46] + whole[second + 46 :]


def encrypted(whole: bytes) -> bytes:
    place = whole.find(b"PK\x01\x02") + 8
    return whole[:place] + bytes([whole[place] | 1]) + whole[place + 1 :]


def lied_about_its_size(whole: bytes) -> bytes:
    data = bytearray(whole)
    name = layout.RECORDS.encode()
    for at, place in ((data.find(name) - 30, 22), (data.rfind(name) - 46, 24)):
        assert data[at : at + 2] == b"PK"
        data[at + place : at + place + 4] = struct.pack("<I", 100)
    return bytes(data)


def damaged(whole: bytes) -> bytes:
    place = whole.find(layout.RECORDS.encode()) + 200
    return whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda whole: JUNK + whole, "zip file"),
        (lambda whole: whole + JUNK, "zip file"),
        (junk_between, "zip file"),
        (with_comment, "zip file"),
        (shared_bytes, "shares bytes"),
        (encrypted, "encrypted"),
        (lied_about_its_size, ""),
        (damaged, ""),
    ],
)
def test_bytes_of_the_zip_file(
    honest: Path, tmp_path: Path, change: Callable[[bytes], bytes], words: str
) -> None:
    (tmp_path / "b.zip").write_bytes(change(honest.read_bytes()))
    assert_refused(tmp_path / "b.zip", words)


def test_an_unusual_compression(files: Files, tmp_path: Path) -> None:
    assert_refused(zip_up(tmp_path / "b.zip", files, zipfile.ZIP_LZMA), "unusual")


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
    assert written == [] and list(tmp_path.iterdir()) == []
    assert all(layout.most_bytes(name) for name in unzip(honest))


# ---- records that no trial of our harness has: each impossible value is refused, whoever sealed it


Change = Callable[[TrialRecord], TrialRecord]


@pytest.fixture(scope="module")
def valid(honest: Path) -> Valid:
    return verify(honest, REFERENCE)


def of_end(valid: Valid, end: str) -> TrialRecord:
    return next(r for r in valid.run.records.values() if r.end == end and r.key.task == PICK)


def event(kind: str, **fields: Any) -> dict[str, Any]:
    return {"time": 0.0, "kind": kind, "object": "", "index": -1, "note": "", "step": 0, **fields}


def and_event(*more: Mapping[str, Any]) -> Change:
    return lambda record: replace(record, events=(*record.events, *more))


def before(*more: Mapping[str, Any]) -> Change:
    return lambda record: replace(record, events=(*more, *record.events))


def first_event(**fields: Any) -> Change:
    return lambda r: replace(r, events=({**r.events[0], **fields}, *r.events[1:]))


def last_event(**fields: Any) -> Change:
    return lambda r: replace(r, events=(*r.events[:-1], {**r.events[-1], **fields}))


LATENCY = {"p50": 1e-3, "p95": 1e-3, "p99": 1e-3, "max": 1e-3}
CASES: list[tuple[str, Change | dict[str, Any], str]] = [
    ("success", {"steps": 0}, "nothing happens without any"),
    ("success", {"physics_steps": 0}, "nothing happens without any"),
    ("success", {"policy_calls": 0}, "nothing happens without any"),
    ("step_limit", {"steps": 0}, "ends at its limit of 20 actions after 0"),
    ("success", {"steps": 10_000}, "the limit is 20"),
    ("step_limit", {"steps": 19}, "ends at its limit of 20 actions after 19"),
    ("step_limit", {"policy_calls": 4}, "an answer has at most 4"),
    ("step_limit", {"policy_calls": 21}, "every answer has an action"),
    ("step_limit", {"physics_steps": 19}, "fewer physics steps than actions"),
    ("success", {"candidates": 99}, "candidates is 99"),
    ("success", {"total": 1}, "total is 1"),
    ("success", {"category": "MIP"}, "category is 'MIP'"),
    ("success", {"policy_seed": 1}, "policy_seed is 1"),
    ("success", {"end": "infrastructure"}, "has no result"),
    ("step_limit", {"success": True}, "its events say False"),
    ("success", {"end": "step_limit"}, "ends at its limit"),
    ("success", {"end": "policy_error"}, "ends in policy_error and claims success"),
    ("policy_error", {"end": "goal_lost", "physics_steps": 6}, "which its events do not say once"),
    ("step_limit", and_event(event("failed", time=20 / RATE, step=20)), "do not say once"),
    ("success", last_event(kind="grasped"), "its events say False"),
    ("success", {"physics_steps": 21}, "goes on after"),
    ("success", last_event(step=0), "go back in time|goes on after"),
    ("success", first_event(kind="flew"), "the unknown kind 'flew'"),
    ("success", before(event("subtask_done", index=2)), "subtask 2; there are 2"),
    ("success", last_event(time=60.0), "outside the trial's time"),
    ("success", first_event(time=-1.0), "outside the trial's time"),
    ("success", last_event(step=21), "outside the trial's time"),
    ("success", and_event(event("closed")), "go back in time"),
    ("success", {"attempts": 10**6}, "tried 1000000 times"),
    ("success", {"attempts": 0}, "tried 0 times"),
    ("success", {"attempts": 3}, "gives the causes of 0"),
    (
        "success",
        {"attempts": 12, "retries": (RetryRow("connection_lost"),) * 11},
        "11 times at most",
    ),
    (
        "success",
        {"attempts": 2, "retries": (RetryRow("deadline", "", 21),)},
        "an attempt of more than 20 actions",
    ),
    ("success", {"wall_time": -1.0}, "a time below zero"),
    ("success", {"timing": {"physics": -1e-9}}, "a time below zero"),
    ("success", {"latency": {}}, "0 times of answers"),
    ("success", {"latency": {**LATENCY, "p95": 0.5}}, "no percentiles"),
    ("success", {"latency": {**LATENCY, "p50": -1}}, "no percentiles"),
    ("success", {"latency": {**LATENCY, "max": 1e9}}, "waited longer"),
    ("success", {"diagnostics": {"unreachable_actions": 21}}, "unreachable ones"),
]


@pytest.mark.parametrize(("end", "change", "words"), CASES, ids=[words for *_, words in CASES])
def test_a_record_that_cannot_be(valid: Valid, end: str, change: Any, words: str) -> None:
    record = of_end(valid, end)
    forged = replace(record, **change) if isinstance(change, dict) else change(record)
    check_record(record, REFERENCE, valid.settings)
    with pytest.raises(BundleError, match=words):
        check_record(forged, REFERENCE, valid.settings)


def test_the_last_action_ends_with_the_goal(valid: Valid) -> None:
    def slow(robot: str, trace: Trace) -> Any:
        return np.full(len(trace), 100)

    record = of_end(valid, "success")
    [trace] = read_traces(valid, [record.key]).values()
    reference, count = replace(REFERENCE, durations=slow), len(trace)
    for steps in (100 * (count - 1) + 1, 100 * count):
        other = replace(record, physics_steps=steps)
        check_trace(other, trace, record.actions_digest, reference, "joint")
    for steps in (100 * (count - 1), 100 * count + 1):
        other = replace(record, physics_steps=steps)
        with pytest.raises(BundleError, match="its actions take"):
            check_trace(other, trace, record.actions_digest, reference, "joint")


@pytest.mark.parametrize("workers", [1, 2])
def test_all_scenes_are_made_again(
    valid: Valid, monkeypatch: pytest.MonkeyPatch, workers: int
) -> None:
    monkeypatch.setattr("robospa.leaderboard.rules.FEW", 0)
    records, seen = dict(valid.run.records), list[tuple[int, int]]()
    check_scenes(records, REFERENCE.parts, workers, lambda *counts: seen.append(counts))
    assert seen[-1] == (40, 40) and len(seen) == 10
    key = list(records)[-1]
    records[key] = replace(records[key], scene_digest="f" * 16)
    with pytest.raises(BundleError, match=f"{key.slug} has another scene"):
        check_scenes(records, REFERENCE.parts, workers)


def test_a_real_scene_and_sentence_are_made_again() -> None:
    from robospa.harness.trial import task_parts
    from robospa.harness.worlds import TASK_PARTS

    key = TrialKey(PICK, 1, 100000)
    found = task_parts(key)
    assert first_wrong(TASK_PARTS, [(key, found.scene.digest, found.instruction)]) == ""
    train = replace(key, split="train")
    text = first_wrong(TASK_PARTS, [(train, found.scene.digest, found.instruction)])
    assert "has another sentence" in text
    text = first_wrong(TASK_PARTS, [(replace(key, mode="moonlight"), "", "")])
    assert "is no trial of this suite" in text
