"""What the leaderboard keeps of a bundle: one small folder a submission, without actions and rows.

    model.toml, bundle.txt    as handed in: the card; a bundle's address, size and hash
    manifest.json, model.json, run.json, scores.json, outcomes.json    as in the bundle
    evidence.json    what `robospa submit verify` and `reproduce` wrote, and where the bundle is
    trials.json      failure types by task, and the filmed trials
    videos/          the announced sample

The bundle's hash covers its files' hashes, so those files of a folder are held against it
again, and all averages are computed anew. Refused: anything else, in one sentence.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robospa.harness.running.atomic_file import replace_file
from robospa.leaderboard import bundle as layout
from robospa.leaderboard.archive import Archive
from robospa.leaderboard.bundle import MEGA, BundleError
from robospa.leaderboard.card import LINK, check_card, read_card
from robospa.leaderboard.strict_json import is_hash, parse_map
from robospa.leaderboard.verify import Valid
from robospa.results.failures.labels import NAMES, distribution, failures_of
from robospa.results.records.run_io import Run
from robospa.results.report.run_card import END_NAMES
from robospa.results.report.trials import trial_rows

ASKED, BUNDLE = "model.toml", "bundle.txt"
EVIDENCE = "evidence.json"
TRIALS = "trials.json"
KEPT = {
    layout.MANIFEST: layout.MANIFEST,
    layout.CARD: layout.CARD,
    layout.RUN: layout.RUN,
    "scores.json": layout.SCORES,
    "outcomes.json": layout.OUTCOMES,
}
"""File in the folder -> file in the bundle."""
COUNT = re.compile(r"[1-9][0-9]{0,11}")
LEVELS = ("valid", "replayed", "reproduced")
SLUG = re.compile(r"[a-z0-9][a-z0-9-]{0,63}")
VIDEO = re.compile(r"videos/[A-Za-z0-9_-]{1,200}\.mp4")


@dataclass(frozen=True)
class Submission:
    """A folder read back. `evidence` has the badges' by name and, maybe, the bundle's `address`."""

    folder: Path
    manifest: Mapping[str, Any]
    card: Mapping[str, Any]
    run: Mapping[str, Any]
    scores: Mapping[str, Any]
    outcomes: Mapping[str, Any]
    evidence: Mapping[str, Any]
    failures: Mapping[str, Mapping[str, int]]
    films: Sequence[Mapping[str, Any]]


@dataclass(frozen=True)
class Announced:
    """What was handed in: where the bundle is, how many bytes it has, and its hash."""

    address: str
    size: int
    bundle: str


def slug_of(name: str) -> str:
    """A folder's name for a model's name."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:64].strip("-") or "model"


def add(
    valid: Valid,
    found: Sequence[Mapping[str, Any]],
    home: Path,
    name: str = "",
    address: str = "",
) -> Path:
    """Keep a valid bundle in the folder `name` below `home` and return the folder.

    The folder may be there with what the submitter handed in, which has to fit the bundle. `found`
    are the contents of evidence files; BundleError if they are of another bundle, show that
    outcomes did not come again, or if the folder is of a submission already.
    """
    if valid.manifest["practice"]:
        raise BundleError("a bundle for practice enters no leaderboard")
    evidence: dict[str, Any] = {"valid": dict(valid.evidence)}
    for part in found:
        own = part.get("valid")
        if isinstance(own, Mapping) and own.get("bundle") != valid.manifest["bundle"]:
            raise BundleError("the evidence is of another bundle")
        evidence.update({name: part[name] for name in LEVELS[1:] if name in part})
    name = name or slug_of(str(valid.card["name"]))
    if not SLUG.fullmatch(name):
        raise BundleError("a submission's name is of small letters, digits and hyphens")
    folder = home / name
    address = _asked(folder, valid) or address
    if address:
        evidence["address"] = address
    _check_evidence(evidence, valid.manifest, "the evidence")
    filmed = {key: r for key, r in valid.run.records.items() if r.video}
    with Archive(valid.path) as archive:
        for name, source in KEPT.items():
            replace_file(folder / name, archive.read(source))
        for record in filmed.values():
            replace_file(folder / record.video, archive.read(record.video))
    shown = Run(folder, valid.run.manifest, tuple(filmed), filmed)
    rows = trial_rows([shown], folder, [failures_of(filmed.values())])
    trials = {"failures": distribution(valid.run.records.values()), "films": rows}
    for name, content in ((TRIALS, trials), (EVIDENCE, evidence)):
        replace_file(folder / name, (json.dumps(content, indent=1) + "\n").encode())
    return folder


def _asked(folder: Path, valid: Valid) -> str:
    """The bundle's address, if the submitter's files are there; BundleError if they do not fit."""
    there = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
    if there - {ASKED, BUNDLE} or (folder.exists() and not folder.is_dir()):
        raise BundleError(f"{folder} is already there; remove it or choose another name")
    if ASKED in there and read_card(folder / ASKED) != valid.card:
        raise BundleError(f"{folder / ASKED} is not the bundle's model card")
    if BUNDLE not in there:
        return ""
    announced = read_announced(folder)
    if (announced.size, announced.bundle) != (valid.path.stat().st_size, valid.manifest["bundle"]):
        raise BundleError(f"{folder / BUNDLE} has the size or the hash of another bundle")
    return announced.address


def read_announced(folder: Path) -> Announced:
    """What `bundle.txt` in `folder` says; BundleError if it is none."""
    path = folder / BUNDLE
    lines = _bytes(path, str(folder)).decode(errors="replace").split()
    if len(lines) != 3 or not LINK.fullmatch(lines[0]) or not COUNT.fullmatch(lines[1]):
        raise BundleError(f"{path} is not three lines: https address, bytes, hash")
    if not is_hash(lines[2]):
        raise BundleError(f"{path} has no bundle hash of 64 hexadecimal digits")
    if int(lines[1]) > layout.Limits().packed:
        raise BundleError(f"{path} announces more than {layout.Limits().packed} bytes")
    return Announced(lines[0], int(lines[1]), lines[2])


def waiting(home: Path) -> list[str]:
    """Folders below `home` that hold only what was handed in."""
    folders = sorted(p for p in home.iterdir() if p.is_dir()) if home.is_dir() else []
    return [f.name for f in folders if {p.name for p in f.iterdir()} == {ASKED, BUNDLE}]


def read_submissions(home: Path) -> list[Submission]:
    """Every verified submission below `home`, by name; BundleError for a folder that is none."""
    folders = sorted(p for p in home.iterdir() if p.is_dir()) if home.is_dir() else []
    left_out = waiting(home)
    return [read_submission(folder) for folder in folders if folder.name not in left_out]


def read_submission(folder: Path) -> Submission:
    """The submission in `folder`, its files held against the bundle's hash."""
    where = f"the submission {folder.name[:80]!a}"
    if not SLUG.fullmatch(folder.name):
        raise BundleError(f"{where} has a name of other than small letters, digits and hyphens")
    data = {name: _bytes(folder / name, where) for name in (*KEPT, EVIDENCE, TRIALS)}
    parts = {name: parse_map(raw, f"{where}, {name}") for name, raw in data.items()}
    manifest = parts[layout.MANIFEST]
    if manifest.get("bundle") != layout.bundle_hash(manifest):
        raise BundleError(f"{where}: the manifest was changed, its hash is not the bundle's")
    if manifest.get("practice") is not False:
        raise BundleError(f"{where} was packed for practice and enters no leaderboard")
    for name, source in KEPT.items():
        listed = manifest.get("files", {}).get(source, {})
        if name != layout.MANIFEST and layout.sha256(data[name]) != listed.get("sha256"):
            raise BundleError(f"{where}: {name} is not the bundle's")
    _check_evidence(parts[EVIDENCE], manifest, where)
    categories = parts[layout.RUN].get("categories")
    if not isinstance(categories, dict):
        raise BundleError(f"{where}: run.json does not say the tasks' categories")
    check_card(parts[layout.CARD], list(categories), f"{where}, {layout.CARD}")
    failures, films = _trials(parts[TRIALS], folder, where)
    return Submission(
        folder,
        manifest,
        parts[layout.CARD],
        parts[layout.RUN],
        parts["scores.json"],
        parts["outcomes.json"],
        parts[EVIDENCE],
        failures,
        films,
    )


def _bytes(path: Path, where: str) -> bytes:
    try:
        if path.is_symlink() or path.stat().st_size > 16 * MEGA:
            raise BundleError(f"{where}: {path.name} is a link or larger than it can be")
        return path.read_bytes()
    except OSError as error:
        raise BundleError(f"{where}: {path.name} cannot be read: {error.strerror}") from None


def _check_evidence(evidence: Mapping[str, Any], manifest: Mapping[str, Any], where: str) -> None:
    """BundleError unless the evidence is of this bundle and contradicts nothing in it."""
    valid, again, fresh = (evidence.get(name) for name in LEVELS)
    if not isinstance(valid, Mapping) or valid.get("bundle") != manifest["bundle"]:
        raise BundleError(f"{where} has no evidence that this very bundle is valid")
    address = evidence.get("address", "")
    if address and not (isinstance(address, str) and LINK.fullmatch(address)):
        raise BundleError(f"{where}: the bundle's address is no https address")
    counts = ("trials", "variants")
    if again is not None:
        if not _numbers(again, ("sampled", "identical", "agrees", "different", *counts[:1])):
            raise BundleError(f"{where}: the evidence of the replay is malformed")
        if again["different"] or not again["sampled"]:
            raise BundleError(f"{where}: the replay found other outcomes than the bundle has")
    if fresh is not None:
        tests: Any = fresh.get("categories") if isinstance(fresh, Mapping) else None
        whole: Any = fresh.get("overall") if isinstance(fresh, Mapping) else None
        named = isinstance(tests, Mapping) and all(_numbers(t, ("p_holm",)) for t in tests.values())
        if not named or not _numbers(whole, ("p",)) or not _numbers(fresh, ("alpha",)):
            raise BundleError(f"{where}: the evidence of the reproduction is malformed")
        least = min([whole["p"], *(t["p_holm"] for t in tests.values())])
        if least < fresh["alpha"]:
            raise BundleError(f"{where}: hidden seeds contradict what the bundle claims")
    if not _numbers(valid, counts):
        raise BundleError(f"{where}: the evidence of validity is malformed")


def _numbers(part: Any, names: Sequence[str]) -> bool:
    return isinstance(part, Mapping) and all(type(part.get(n)) in (int, float) for n in names)


def _trials(
    data: Mapping[str, Any], folder: Path, where: str
) -> tuple[dict[str, dict[str, int]], list[dict[str, Any]]]:
    """Failure counts and filmed trials, of the shapes that the pages rely on."""
    failures, films = data.get("failures"), data.get("films")
    if not isinstance(failures, dict) or not isinstance(films, list):
        raise BundleError(f"{where}: {TRIALS} has no failures and films")
    for counts in failures.values():
        kinds = isinstance(counts, dict) and set(counts) <= set(NAMES)
        if not kinds or not all(type(n) is int and n >= 0 for n in counts.values()):
            raise BundleError(f"{where}: {TRIALS} has failure types that there are not")
    for row in films:
        if not isinstance(row, dict) or not _film_is_right(row):
            raise BundleError(f"{where}: {TRIALS} has a filmed trial that is none")
        path = folder / row["video"]
        if path.is_symlink() or not path.is_file() or path.stat().st_size > 16 * MEGA:
            raise BundleError(f"{where}: {row['video']} is missing or no plain file")
    return failures, [{**row, "run": 0} for row in films]


TEXTS = ("task", "end", "instruction", "message", "digest", "video", "failure", "why")
NUMBERS = ("run", "level", "seed", "good", "done", "total", "steps", "seconds", "attempts", "at")


def _film_is_right(row: Mapping[str, Any]) -> bool:
    """Whether a filmed trial's row has what the page's script works with, and nothing else."""
    if set(row) - {*TEXTS, *NUMBERS, "events"} or not {"task", "level", "seed", "end"} <= set(row):
        return False
    if not all(isinstance(row[n], str) for n in TEXTS if n in row):
        return False
    if not all(type(row[n]) in (int, float) for n in NUMBERS if row.get(n) is not None):
        return False
    if row["end"] not in END_NAMES.values() or not VIDEO.fullmatch(row.get("video", "")):
        return False
    events = row.get("events", [])
    return isinstance(events, list) and all(
        isinstance(e, list)
        and len(e) == 3
        and type(e[0]) in (int, float)
        and isinstance(e[1], str)
        and isinstance(e[2], str)
        for e in events
    )
