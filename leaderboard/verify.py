"""Level 1, *valid*: everything that can be known of a bundle without running anything.

Structure, hashes, seeds, records, actions, lints, scores, scenes and sentences. The first thing
that is not as it has to be ends it, in one sentence.
"""

import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from itertools import groupby
from pathlib import Path
from typing import Annotated

from msgspec import Meta, Struct, to_builtins

from robospa.harness.running.status import cores
from robospa.leaderboard import bundle as layout
from robospa.leaderboard import rules
from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.card import Card, check_checkpoints, to_card
from robospa.leaderboard.evidence import Validity, announced
from robospa.leaderboard.traces import Trace, decode, most_bytes
from robospa.leaderboard.trial_rows import check_record, check_trace, read_rows, trace_hash
from robospa.results.comparison.compare import Difference, compare_results, over_levels
from robospa.results.lint import lint_run
from robospa.results.records.manifest import RunManifest, RunSettings, seed_hash
from robospa.results.records.runs import Run, film_name
from robospa.results.records.trial_record import EventRow, TrialRecord
from robospa.results.scoring.first_choice import first_choice, held_at_start
from robospa.results.scoring.models import IncomparableError, ModelResults, results_of_records
from robospa.results.scoring.repeats import was_repeated
from robospa.results.scoring.scores import ScoresData, Variant, score_run, to_json
from robospa.schema import pattern, read
from robospa.tasks.scene import SUITE
from robospa.trial import METRICS, TrialKey

LISTING = ("unequal-trials", "missing")
"""Lint rules about how many trials there are, which `check_seeds` decides."""
MOVIE = b"ftyp"
THREADS = 4
"""Action files that are looked at together; decoding takes seven times the bytes of each."""


@dataclass(frozen=True)
class Valid:
    """A bundle that is valid: its parts, the hashes of the trials' actions, and the `evidence` for
    the badge."""

    path: Path
    manifest: layout.BundleManifest
    card: Card
    run: Run
    traces: Mapping[TrialKey, str]
    evidence: Validity

    @property
    def keys(self) -> tuple[TrialKey, ...]:
        """All trials, in the order of the rows."""
        return self.run.keys

    @property
    def settings(self) -> RunSettings:
        return self.run.manifest.settings


def verify(
    path: Path,
    reference: rules.Reference,
    practice: bool = False,
    limits: layout.BundleLimits | None = None,
    workers: int = 0,
    done: rules.Done = lambda count, trials: None,
) -> Valid:
    """The bundle at `path`, if it is valid; BundleError saying in one sentence why not.

    `practice` also accepts bundles that were packed for practice and enter no leaderboard. Scenes
    are made again in `workers` processes (0: one a core); `done` hears how many of how many are.
    """
    with layout.BundleArchive(path, limits) as archive:
        manifest = _manifest(archive, practice)
        archive.listed = manifest.files
        claimed = rules.manifest_of(said := archive.read_map(layout.RUN))
        if where := compare_scores(claimed.to_json(), said):
            raise BundleError(f"{layout.RUN} says what no run says: {where}")
        if sum(len(group.seeds) for group in claimed.trials) > archive.limits.rows:
            raise BundleError(f"the run lists more than {archive.limits.rows} trials")
        keys = tuple(sorted(claimed.keys))
        if claimed.seed_hash != seed_hash(keys):
            raise BundleError("the run's hash of its list of trials is another")
        if manifest.inputs != layout.inputs_hash(claimed):
            raise BundleError("the hash of the run's inputs is not the manifest's")
        card = to_card(archive.read_map(layout.CARD))
        check_listed(claimed, keys, card, reference, manifest.practice)
        records, traces = _records(archive, manifest, keys)
        run = Run(path, claimed, keys, records)
        warnings = check_records(run, reference)
        _check_actions(archive, run, traces, reference)
        _check_derived(archive, run)
        _check_videos(archive, manifest, records)
        archive.all_used()
    rules.check_scenes(records, reference.parts, workers or cores(), done)
    evidence = Validity(
        bundle=manifest.bundle,
        trials=len(keys),
        variants=len({key.variant for key in keys}),
        practice=manifest.practice,
        drivers=claimed.about.drivers if claimed.about.processors else 0,  # an older version's
        repeated=sum(map(was_repeated, records.values())),
        warnings=tuple(warnings),
    )
    return Valid(path, manifest, card, run, traces, evidence)


def check_run(run: Run, card: Card, reference: rules.Reference, practice: bool) -> list[str]:
    """Warnings of our lint; BundleError unless a run may enter a leaderboard under `card`."""
    check_listed(run.manifest, run.keys, card, reference, practice)
    if missing := run.without_result:
        raise BundleError(
            f"the run is incomplete: {len(missing)} of {len(run.keys)} trials have no result, such "
            f"as {missing[0].slug}; finish it with robospa eval ... --resume"
        )
    return check_records(run, reference)


def check_listed(
    run: RunManifest,
    keys: Sequence[TrialKey],
    card: Card,
    reference: rules.Reference,
    practice: bool,
) -> None:
    """BundleError unless settings, card and the listed trials `keys` fit the benchmark and each
    other."""
    settings = rules.check_settings(run, reference)
    for name in rules.ONE:
        if strange := [k for k in keys if getattr(k, name) != getattr(settings, name)[0]]:
            raise BundleError(f"{strange[0].slug[:120]!a} is not of the run's {name}")
    rules.check_seeds(keys, reference, practice)
    tasks = list(dict.fromkeys(key.task for key in keys))
    check_checkpoints(card, tasks)
    if run.categories != {t: reference.task(t, rules.LEVELS[0]).category for t in tasks}:
        raise BundleError("the run's categories are not those of its tasks")
    for task in tasks:
        rules.check_card_fits(card, settings, task)


def check_records(run: Run, reference: rules.Reference) -> list[str]:
    """Warnings of our lint; BundleError for a record that cannot be, and the lint's first error."""
    for record in run.records.values():
        check_record(record, reference, run.manifest.settings)
    warnings = []
    for finding in lint_run(run):
        if finding.rule in LISTING:
            continue
        where = finding.where.removeprefix(run.folder.name).lstrip(", ")
        text = f"{where}: {finding.text} [{finding.rule}]".removeprefix(": ")
        if finding.severity == "error":
            raise BundleError(f"lint: {text}")
        warnings.append(f"warning: {text}")
    return warnings


def _manifest(archive: layout.BundleArchive, practice: bool) -> layout.BundleManifest:
    """The manifest, held against the archive."""
    data = archive.read_map(layout.MANIFEST)
    version = data.get("format")
    if type(version) is not int or version < 1:
        raise BundleError("the manifest does not say which format the bundle has")
    if version != layout.FORMAT:
        raise BundleError(f"the bundle has format {version}; this robospa reads {layout.FORMAT}")
    manifest = read(layout.BundleManifest, data, "the manifest", BundleError)
    if manifest.suite != SUITE:
        raise BundleError(
            f"the bundle is of the suite {manifest.suite[:40]!a}; this robospa has "
            f"{SUITE!r}: use the version that it was made with"
        )
    if manifest.bundle != layout.bundle_hash(data):
        raise BundleError("the manifest was changed: its hash is not the bundle's")
    if manifest.practice and not practice:
        raise BundleError(
            "the bundle was packed for practice: pack the whole run, or verify with --practice"
        )
    _check_files(archive, manifest.files)
    return manifest


def _check_files(archive: layout.BundleArchive, listed: Mapping[str, layout.FileEntry]) -> None:
    """BundleError unless `listed` are exactly the archive's files with their sizes."""
    there = set(archive.sizes) - {layout.MANIFEST}
    if lost := sorted(set(listed) - there):
        raise BundleError(f"the bundle lacks {lost[0][:80]!a}, which its manifest lists")
    if strange := sorted(there - set(listed)):
        raise BundleError(f"{strange[0]} is in the bundle but not in its manifest")
    for name, entry in listed.items():
        if entry.size != archive.sizes[name]:
            raise BundleError(f"{name} was changed: its size is not the manifest's")
    needed = (layout.CARD, layout.RUN, layout.RECORDS, layout.SCORES, layout.OUTCOMES)
    for name in needed:
        if name not in listed:
            raise BundleError(f"the bundle has no {name}")


def _records(
    archive: layout.BundleArchive, manifest: layout.BundleManifest, keys: Sequence[TrialKey]
) -> tuple[dict[TrialKey, TrialRecord], dict[TrialKey, str]]:
    """Every record and the hash of its actions, from the chain of rows."""
    records: dict[TrialKey, TrialRecord] = {}
    traces: dict[TrialKey, str] = {}
    digest, last = hashlib.sha256(), manifest.inputs
    lines = archive.rows(layout.RECORDS, digest)
    for record, trace, so_far in read_rows(lines, manifest.inputs, layout.RECORDS):
        key, place, last = record.key, len(records), so_far
        if key in records:
            raise BundleError(f"{key.slug[:120]!a} is there twice: one trial has one row")
        if place >= len(keys) or key != keys[place]:
            raise BundleError(
                f"{layout.RECORDS}, row {place + 1} is {key.slug[:120]!a}, not "
                f"{keys[place].slug if place < len(keys) else 'the end'}: rows are the listed "
                "trials by task, level and seed"
            )
        records[key], traces[key] = record, trace
    if len(records) < len(keys):
        raise BundleError(f"the rows end before {keys[len(records)].slug}: trials are missing")
    if manifest.chain != layout.RowChain(len(records), last):
        raise BundleError("the chain of rows does not end as the manifest says")
    if digest.hexdigest() != manifest.files[layout.RECORDS].sha256:
        raise BundleError(f"{layout.RECORDS} was changed: its hash is not the manifest's")
    return records, traces


def _variants(records: Mapping[TrialKey, TrialRecord]) -> Iterator[list[TrialRecord]]:
    """The records of each variant, which follow each other."""
    return (list(own) for _, own in groupby(records.values(), key=lambda r: r.key.variant))


def _check_actions(
    archive: layout.BundleArchive,
    run: Run,
    traces: Mapping[TrialKey, str],
    reference: rules.Reference,
) -> None:
    """BundleError unless every stored array has its row's and record's hash.

    Unpacking and hashing take most of the time and leave Python alone, so threads share them.
    """

    def check(found: Sequence[TrialRecord]) -> None:
        first = found[0].key
        name, space = layout.actions_name(*first.variant), spec_of(first.task).space
        size, most = archive.sizes.get(name, 0), most_bytes([record.steps for record in found])
        if size > most:
            raise BundleError(f"{name} unpacks to {size} bytes; its trials have {most} at most")
        stored = decode(archive.read(name), name)
        if len(stored) != len(found):
            raise BundleError(f"{name} holds {len(stored)} trials, not {len(found)}")
        for record, trace in zip(found, stored, strict=True):
            digest = trace_hash(trace)
            if digest != traces[record.key]:
                raise BundleError(f"{name}: {record.key.slug} has other actions than its row says")
            check_trace(record, trace, digest, reference, space)

    spec_of = partial(rules.spec_of, run.manifest.settings)
    with ThreadPoolExecutor(THREADS) as pool:
        for _ in pool.map(check, _variants(run.records)):
            pass  # the first that fails, in their order, raises here, and those left are dropped


def read_traces(valid: Valid, wanted: Sequence[TrialKey]) -> dict[TrialKey, Trace]:
    """The stored actions of the trials `wanted`, from a bundle that was found valid."""
    places = {}
    for records in _variants(valid.run.records):
        places.update({record.key: place for place, record in enumerate(records)})
    found: dict[TrialKey, Trace] = {}
    with layout.BundleArchive(valid.path) as archive:
        for variant in dict.fromkeys(key.variant for key in wanted):
            name = layout.actions_name(*variant)
            stored = decode(archive.read(name), name)
            for key in (k for k in wanted if k.variant == variant):
                found[key] = stored[places[key]].copy()
                if trace_hash(found[key]) != valid.traces[key]:
                    raise BundleError(f"{name} was changed while it was being verified")
    return found


def _check_derived(archive: layout.BundleArchive, run: Run) -> None:
    """BundleError if a number is not what follows from the records."""
    given = layout.parse(archive.read(layout.SCORES), layout.SCORES)
    if where := compare_scores(scores_of(run), given):
        raise BundleError(f"{layout.SCORES} is not what the records give: {where}")
    if archive.read_map(layout.OUTCOMES) != to_builtins(outcomes_of(run)):
        raise BundleError(f"{layout.OUTCOMES} is not what the records give")


def _check_videos(
    archive: layout.BundleArchive,
    manifest: layout.BundleManifest,
    records: Mapping[TrialKey, TrialRecord],
) -> None:
    """BundleError unless the announced trials, and only they, have a video."""
    chosen = {film_name(key): key for key in announced(manifest.suite, records)}
    for name, key in chosen.items():
        if name not in manifest.files:
            if manifest.practice:
                continue
            raise BundleError(f"the announced video {name} is missing")
        if archive.read(name)[4:8] != MOVIE:
            raise BundleError(f"{name} is not an MP4 video")
        if records[key].video != name:
            raise BundleError(f"{key.slug} does not name its video {name}")
    for key, record in records.items():
        if record.video and (record.video not in chosen or chosen[record.video] != key):
            raise BundleError(f"{key.slug} names a video that was not announced")


CLOSE = 1e-9
"""Two computations of one number may differ by this much: other numpy, other order of sums."""


def scores_of(run: Run) -> ScoresData:
    """All scores of `run`, as `report.json` has them."""
    return to_json(score_run(run))


def compare_scores(right: object, given: object, where: str = "") -> str:
    """Where `given` first differs from `right`, in words; "" if nowhere. A version that has fewer
    scores leaves them out, which is no difference."""
    if isinstance(right, Mapping):
        if not isinstance(given, Mapping) or bool(given) < bool(right) or set(given) - set(right):
            return f"{where or 'it'} has other entries"
        pairs = [(name, right[name], given[name]) for name in given]
    elif isinstance(right, (list, tuple)):
        if not isinstance(given, list) or len(given) != len(right):
            return f"{where} has another length"
        pairs = [(str(n), a, b) for n, (a, b) in enumerate(zip(right, given, strict=True))]
    else:
        return "" if _equal(right, given) else f"{where} is {str(given)[:40]!a}, not {right!r}"
    for name, one, other in pairs:
        if found := compare_scores(one, other, f"{where}, {name}" if where else str(name)):
            return found
    return ""


def _equal(right: object, given: object) -> bool:
    numbers = (int, float)
    if isinstance(right, numbers) and isinstance(given, numbers):
        if isinstance(right, bool) or isinstance(given, bool):
            return right is given
        return math.isclose(right, given, rel_tol=CLOSE, abs_tol=CLOSE)
    return type(right) is type(given) and bool(right == given)


DIGITS = "0123456789abcdefghijklmnopqrstuvwxyz"
Rows = dict[str, dict[str, list[float | None]]]


class Outcomes(Struct, forbid_unknown_fields=True):
    """The outcomes of a variant: of every trial whether it failed (0), succeeded by its first
    choice (1) or later (2), how many subtasks are done, and how many held at the start."""

    candidates: int
    total: Annotated[int, Meta(gt=0, lt=len(DIGITS))]
    success: Annotated[str, pattern("[012]*", "text of 0, 1 and 2")] = ""
    done: Annotated[str, pattern("[0-9a-z]*", "text of digits and small letters")] = ""
    held: Annotated[str, pattern("[0-9a-z]*", "text of digits and small letters")] = ""


def outcomes_of(run: Run) -> dict[str, Outcomes]:
    """The outcomes of a complete run, by "TASK/LEVEL"."""
    found: dict[str, Outcomes] = {}
    for key in sorted(run.keys):
        record = run.records[key]
        own = found.setdefault(f"{key.task}/{key.level}", Outcomes(record.candidates, record.total))
        own.success += str(2 * record.success - first_choice(record))
        own.done += DIGITS[record.done]
        own.held += DIGITS[held_at_start(record)]
    return found


def results_of(name: str, outcomes: Mapping[str, object], run: RunManifest) -> ModelResults:
    """The results of a model, from the `outcomes` of the trials of `run`; BundleError if they do
    not fit each other."""
    seeds: dict[Variant, list[TrialKey]] = {}
    for key in sorted(run.keys):
        seeds.setdefault(key.variant, []).append(key)
    if set(outcomes) != {f"{task}/{level}" for task, level in seeds}:
        raise BundleError(f"{name[:80]!a}: the outcomes are of other variants than the run")
    records: dict[TrialKey, TrialRecord] = {}
    for (task, level), own in seeds.items():
        part = _checked(outcomes[f"{task}/{level}"], len(own), f"{name[:80]!a}, {task} L{level}")
        category = run.categories.get(task, "")
        records |= {k: _record(k, category, part, place) for place, k in enumerate(own)}
    # What else the run says of itself is for its card: a column is shown as any other model's.
    told = RunManifest(categories=run.categories, suite=run.suite)
    found = results_of_records(name, sorted(run.keys), records, told)
    return replace(found, setting=replace(found.setting, track=run.tracks))


def _checked(data: object, count: int, where: str) -> Outcomes:
    """The outcomes of a variant, if they are of `count` trials."""
    part = read(Outcomes, data, f"{where}: the outcomes", BundleError)
    if not len(part.success) == len(part.done) == len(part.held) == count:
        raise BundleError(f"{where}: the outcomes are not of {count} trials")
    if set(part.done + part.held) - set(DIGITS[: part.total + 1]):
        raise BundleError(f"{where}: the outcomes say that more is done than a trial can have")
    return part


def _record(key: TrialKey, category: str, part: Outcomes, place: int) -> TrialRecord:
    """As much of a trial's record as scores and comparisons look at. One suite, one seed: one
    scene."""
    done, held = (DIGITS.index(text[place]) for text in (part.done, part.held))
    good, later = part.success[place] != "0", part.success[place] == "2"
    counts = (done, done, part.total, part.candidates, 0, 0, 0)
    end = "success" if good else "step_limit"
    kinds = [*(("subtask_done", index) for index in range(held)), *[("wrong_object", -1)] * later]
    events = tuple(EventRow(time=0, kind=k, object="", index=i, note="", step=0) for k, i in kinds)
    return TrialRecord(*(key, category, "", "", end, good, *counts, "", "", 0.0), events=events)


def paired(first: ModelResults, second: ModelResults) -> dict[str, Rows]:
    """Differences in percent on equal seeds, by metric, row and level (0: over levels).

    Each is [difference, low, high, pairs that only the first, only the second did better in, q].
    A metric that they cannot be paired in is left out.
    """
    made: dict[str, Rows] = {}
    for metric in METRICS:
        try:
            found = compare_results(first, second, metric)
            rows = [*found.cells, *found.groups, *over_levels(first, second, metric)]
        except IncomparableError:
            continue
        if found.paired:
            made[metric] = {}
            for row in rows:
                made[metric].setdefault(row.label, {})[str(row.level)] = _shown(row)
    return made


def _shown(row: Difference) -> list[float | None]:
    found = row.estimate
    numbers = [round(100 * x, 6) for x in (found.value, found.low, found.high)]
    return [*numbers, row.only_first, row.only_second, float(f"{row.q:.2g}")]
