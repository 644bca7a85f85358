"""What the leaderboard keeps of a bundle: one small folder a submission, without actions and rows.

`docs/leaderboard.md` lists its files, which are held against the bundle's hash again.

Only a small bundle lies in the repository itself, of a model whose weights a recipe there remakes.
All of its trials are replayed, since whoever hands it in may also make the commit that would choose
a sample.
"""

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated, cast

from msgspec import Struct, to_builtins

from robospa.harness.running.atomic_file import replace_file
from robospa.leaderboard import bundle as layout
from robospa.leaderboard.bundle import IN_REPOSITORY, BundleError
from robospa.leaderboard.card import (
    LINK,
    Card,
    check_checkpoints,
    check_folder,
    read_card,
    recipe_of,
    to_card,
)
from robospa.leaderboard.evidence import BADGES, BadgeEvidence, read_evidence
from robospa.leaderboard.rules import manifest_of
from robospa.leaderboard.verify import Valid
from robospa.results.failures.labels import NAMES, distribution, failures_of
from robospa.results.records.manifest import RunManifest
from robospa.results.records.runs import Run
from robospa.results.report.run_card import END_NAMES
from robospa.results.report.trials import trial_rows
from robospa.results.scoring.grounding import ROWS, Grounding, groundings
from robospa.schema import Count, one_of, pattern, read

MOST = 8 * layout.MEGA
"""The most bytes of a bundle in the repository, which never becomes smaller again."""


def size_of(folder: Path) -> int:
    """Bytes of the bundle in `folder`; BundleError unless it is a plain file and small enough."""
    path = folder / IN_REPOSITORY
    if path.is_symlink() or not path.is_file():
        raise BundleError(f"{path} is missing or no plain file")
    size = path.stat().st_size
    if size > MOST:
        raise BundleError(
            f"{path} has {size} bytes; a bundle in the repository has at most {MOST}, a larger one "
            "is downloaded from a https address"
        )
    return size


def check_weights(card: Card, where: str) -> None:
    """BundleError unless all weights of `card` are remade by a recipe of this repository."""
    if strange := [p.reference for p in card.checkpoints.values() if not recipe_of(p.reference)]:
        raise BundleError(
            f"{where}: a bundle lies in the repository only if a recipe there remakes the weights, "
            f"which are at {strange[0][:80]}; give the bundle a https address"
        )


def check_recipes(card: Card, clone: Path) -> None:
    """BundleError unless every recipe that `card` names is a script in `clone`."""
    for source in (card.link, *(point.reference for point in card.checkpoints.values())):
        script = recipe_of(source)
        if script and not (clone / script).is_file():
            raise BundleError(f"the model card names {script}, which this repository does not have")


def check_contents(folder: Path, manifest: layout.BundleManifest, where: str) -> None:
    """BundleError unless the bundle in `folder` holds the files that `manifest` lists."""
    size_of(folder)
    with layout.BundleArchive(folder / IN_REPOSITORY, layout.BundleLimits(packed=MOST)) as archive:
        if set(archive.sizes) != {*manifest.files, layout.MANIFEST}:
            raise BundleError(f"{where}: {IN_REPOSITORY} has other files than the manifest lists")
        for name, listed in manifest.files.items():
            if layout.sha256(archive.read(name)) != listed.sha256:
                raise BundleError(f"{where}: {name} in {IN_REPOSITORY} is not the manifest's")


ASKED, BUNDLE = "model.toml", "bundle.txt"
HANDED_IN = (ASKED, BUNDLE, IN_REPOSITORY)
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
Number = int | float
SLUG = re.compile(r"[a-z0-9][a-z0-9-]{0,63}")


@dataclass(frozen=True)
class Submission:
    """A folder read back. `scores` and `outcomes` are the bundle's files as they are, `bundle` and
    `rows` are the hashes of all of it and of its rows."""

    folder: Path
    bundle: str
    rows: str
    card: Card
    run: RunManifest
    scores: Mapping[str, object]
    outcomes: Mapping[str, object]
    evidence: BadgeEvidence
    failures: Mapping[str, Mapping[str, int]]
    films: Sequence[Mapping[str, object]]
    grounding: Mapping[str, Grounding]


@dataclass(frozen=True)
class Announced:
    """What was handed in: where the bundle is (`IN_REPOSITORY` beside it), how many bytes it
    has, and its hash."""

    address: str
    size: int
    bundle: str

    @property
    def files(self) -> set[str]:
        """What the folder holds until it is verified."""
        return {ASKED, BUNDLE} | ({IN_REPOSITORY} & {self.address})


class FilmedTrial(Struct, frozen=True, forbid_unknown_fields=True):
    """A filmed trial: what the page's script works with, and nothing else."""

    task: str
    level: Number | None
    seed: Number | None
    end: Annotated[str, one_of(END_NAMES.values())]
    video: Annotated[str, pattern(r"videos/[A-Za-z0-9_-]{1,200}\.mp4", "the name of a video")]
    instruction: str = ""
    message: str = ""
    digest: str = ""
    failure: str = ""
    why: str = ""
    run: Number | None = None
    good: Number | None = None
    done: Number | None = None
    total: Number | None = None
    steps: Number | None = None
    seconds: Number | None = None
    attempts: Number | None = None
    at: Number | None = None
    events: list[tuple[Number, str, str]] = []


class TrialsFile(Struct, frozen=True):
    """`trials.json`: how often each failure type was seen, by task, the filmed trials, and what was
    chosen, by category and dimension; none of a submission of an older version."""

    failures: dict[str, dict[Annotated[str, one_of(NAMES)], Count]]
    films: list[FilmedTrial]
    grounding: dict[Annotated[str, one_of(ROWS)], Grounding] = {}


def slug_of(name: str) -> str:
    """A folder's name for a model's name."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")[:64].strip("-") or "model"


def add(
    valid: Valid,
    found: Sequence[Mapping[str, object]],
    home: Path,
    name: str = "",
    address: str = "",
) -> Path:
    """Keep a valid bundle in the folder `name` below `home` and return the folder.

    The folder may be there with what the submitter handed in, which has to fit the bundle. `found`
    are the contents of evidence files; BundleError if they are of another bundle, show that
    outcomes did not come again, or if the folder is of a submission already.
    """
    if valid.manifest.practice:
        raise BundleError("a bundle for practice enters no leaderboard")
    evidence: dict[str, object] = {"valid": to_builtins(valid.evidence)}
    for part in found:
        own = part.get("valid")
        if isinstance(own, Mapping) and own.get("bundle") != valid.manifest.bundle:
            raise BundleError("the evidence is of another bundle")
        evidence.update({name: part[name] for name in BADGES[1:] if name in part})
    name = name or slug_of(valid.card.name)
    if not SLUG.fullmatch(name):
        raise BundleError("a submission's name is of small letters, digits and hyphens")
    check_folder(name)
    folder = home / name
    if address == IN_REPOSITORY:
        raise BundleError(f"an address is that of a bundle elsewhere; {BUNDLE} names one beside it")
    if address := _asked(folder, valid) or address:
        evidence["address"] = address
    read_evidence(evidence, valid.manifest.bundle, "the submission")
    filmed = {key: r for key, r in valid.run.records.items() if r.video}
    with layout.BundleArchive(valid.path) as archive:
        for name, source in KEPT.items():
            replace_file(folder / name, archive.read(source))
        for record in filmed.values():
            replace_file(folder / record.video, archive.read(record.video))
    shown = Run(folder, valid.run.manifest, tuple(filmed), filmed)
    rows = trial_rows([shown], folder, [failures_of(filmed.values())])
    chosen = groundings(valid.run.records.values()).items()
    trials = {
        "failures": distribution(valid.run.records.values()),
        "films": rows,
        "grounding": {row: asdict(one) for (row, n), one in chosen if not n and row in ROWS},
    }
    for name, content in ((TRIALS, trials), (EVIDENCE, evidence)):
        replace_file(folder / name, (json.dumps(content, indent=1) + "\n").encode())
    return folder


def _asked(folder: Path, valid: Valid) -> str:
    """The bundle's address, if the submitter's files are there; BundleError if they do not fit."""
    there = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
    if there - {*HANDED_IN} or (folder.exists() and not folder.is_dir()):
        raise BundleError(f"{folder} is already there; remove it or choose another name")
    if ASKED in there and read_card(folder / ASKED) != valid.card:
        raise BundleError(f"{folder / ASKED} is not the bundle's model card")
    if BUNDLE not in there:
        return ""
    announced = read_announced(folder)
    if IN_REPOSITORY in announced.files:
        check_weights(valid.card, str(folder))
        check_contents(folder, valid.manifest, str(folder))
    sizes = {valid.path.stat().st_size, *(f.stat().st_size for f in folder.glob("*.zip"))}
    if ({announced.size}, announced.bundle) != (sizes, valid.manifest.bundle):
        raise BundleError(f"{folder / BUNDLE} has the size or the hash of another bundle")
    return announced.address


def read_announced(folder: Path) -> Announced:
    """What `bundle.txt` in `folder` says; BundleError if it is none."""
    path = folder / BUNDLE
    lines = _bytes(path, str(folder)).decode(errors="replace").split()
    inside = lines[:1] == [IN_REPOSITORY]
    where = inside or (lines and LINK.fullmatch(lines[0]))
    if len(lines) != 3 or not where or not COUNT.fullmatch(lines[1]):
        raise BundleError(
            f"{path} is not three lines: https address (or {IN_REPOSITORY}), bytes, hash"
        )
    if not layout.is_sha256(lines[2]):
        raise BundleError(f"{path} has no bundle hash of 64 hexadecimal digits")
    most = MOST if inside else layout.BundleLimits().packed
    if int(lines[1]) > most:
        raise BundleError(f"{path} announces more than {most} bytes")
    return Announced(lines[0], int(lines[1]), lines[2])


def left_out(home: Path) -> dict[str, str]:
    """Folders below `home` that the site does not show, with the reason."""
    found = {}
    for folder in _folders(home):
        if {p.name for p in folder.iterdir()} in ({ASKED, BUNDLE}, {*HANDED_IN}):
            found[folder.name] = "it is not verified yet (robospa leaderboard add)"
            continue
        try:
            check_folder(folder.name)
        except BundleError as error:
            found[folder.name] = str(error)
    return found


def read_submissions(home: Path) -> list[Submission]:
    """Every verified submission below `home`, by name; BundleError for a folder that is none."""
    hidden = left_out(home)
    return [read_submission(folder) for folder in _folders(home) if folder.name not in hidden]


def _folders(home: Path) -> list[Path]:
    return sorted(p for p in home.iterdir() if p.is_dir()) if home.is_dir() else []


def read_submission(folder: Path) -> Submission:
    """The submission in `folder`, its files held against the bundle's hash."""
    where = f"the submission {folder.name[:80]!a}"
    if not SLUG.fullmatch(folder.name):
        raise BundleError(f"{where} has a name of other than small letters, digits and hyphens")
    data = {name: _bytes(folder / name, where) for name in (*KEPT, EVIDENCE, TRIALS)}
    parts = {name: layout.parse_map(raw, f"{where}, {name}") for name, raw in data.items()}
    manifest = read(
        layout.BundleManifest, parts[layout.MANIFEST], f"{where}: the manifest", BundleError
    )
    if manifest.bundle != layout.bundle_hash(parts[layout.MANIFEST]):
        raise BundleError(f"{where}: the manifest was changed, its hash is not the bundle's")
    if manifest.practice:
        raise BundleError(f"{where} was packed for practice and enters no leaderboard")
    for name, source in KEPT.items():
        listed = manifest.files.get(source)
        if name != layout.MANIFEST and (not listed or layout.sha256(data[name]) != listed.sha256):
            raise BundleError(f"{where}: {name} is not the bundle's")
    evidence = read_evidence(parts[EVIDENCE], manifest.bundle, where)
    run = manifest_of(parts[layout.RUN], f"{where}: the run")
    card = to_card(parts[layout.CARD], f"{where}, {layout.CARD}")
    check_checkpoints(card, list(run.categories), f"{where}, {layout.CARD}")
    if evidence.address == IN_REPOSITORY:
        check_weights(card, where)
        check_contents(folder, manifest, where)
    trials = read(TrialsFile, parts[TRIALS], f"{where}, {TRIALS}", BundleError)
    for film in trials.films:
        path = folder / film.video
        if path.is_symlink() or not path.is_file() or path.stat().st_size > 16 * layout.MEGA:
            raise BundleError(f"{where}: {film.video} is missing or no plain file")
    rows = cast(list[dict[str, object]], parts[TRIALS]["films"])
    return Submission(
        folder=folder,
        bundle=manifest.bundle,
        rows=manifest.chain.last,
        card=card,
        run=run,
        scores=parts["scores.json"],
        outcomes=parts["outcomes.json"],
        evidence=evidence,
        failures=trials.failures,
        films=[{**row, "run": 0} for row in rows],
        grounding=trials.grounding,
    )


def _bytes(path: Path, where: str) -> bytes:
    try:
        if path.is_symlink() or path.stat().st_size > 16 * layout.MEGA:
            raise BundleError(f"{where}: {path.name} is a link or larger than it can be")
        return path.read_bytes()
    except OSError as error:
        raise BundleError(f"{where}: {path.name} cannot be read: {error.strerror}") from None
