"""From runs to a bundle: what may not enter is refused, the rest written, verified and named.

The rules are those of verifying (`verify.check_run`); besides, runs have to be complete and made
alike. The announced trials are filmed by playing their recorded actions again, unless the run has
the film already. Addresses and command lines stay at home.
"""

import os
import zipfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from functools import partial
from itertools import groupby
from pathlib import Path

from msgspec import structs, to_builtins

from robospa.action_space import STEPS_PER_UNIT, is_quantized
from robospa.harness.factory import load_function
from robospa.harness.running.manifest import changed_settings
from robospa.harness.running.record_store import read_trace
from robospa.harness.world import World
from robospa.harness.worlds import open_world
from robospa.leaderboard import bundle as layout
from robospa.leaderboard.bundle import BundleError, BundleManifest, FileEntry, RowChain
from robospa.leaderboard.card import Card
from robospa.leaderboard.evidence import announced
from robospa.leaderboard.rules import Done, Reference
from robospa.leaderboard.traces import Trace, encode, with_joints
from robospa.leaderboard.trial_rows import TrialRow, trace_hash, write_rows
from robospa.leaderboard.verify import Valid, check_run, outcomes_of, scores_of, verify
from robospa.results.records.manifest import PolicySettings, RunAbout, make_manifest
from robospa.results.records.runs import Run, action_path, by_setting, film_name, read_run
from robospa.results.records.trial_record import TrialRecord
from robospa.results.report.page import own_version
from robospa.trial import TrialKey, path_part

ABOUT = ("versions", "git", "code", "machine", "world", "warnings", "drivers", "processors")
"""What of the machine and its software goes into the bundle."""
SAME = ("versions", "code")
DATE = (1980, 1, 1, 0, 0, 0)
"""Of every entry: the same run gives the same bytes."""
Note = Callable[[str], None]


def pack(
    folders: Sequence[Path],
    card: Card,
    out: Path,
    reference: Reference,
    *,
    practice: bool = False,
    videos: bool = True,
    replace_old: bool = False,
    note: Note = lambda text: None,
    done: Done = lambda count, trials: None,
) -> list[Valid]:
    """Write a bundle for each robot that the runs in `folders` are of, whole or not at all, and
    verify it.

    Of one robot it is `out`, of several NAME-ROBOT.zip where `out` is NAME.zip. None is written
    before all are found fit to enter. A file that is there is kept unless `replace_old`, and also
    then until the new one holds. With `practice` the first few seeds of any variants are enough,
    and `videos` may be left out; such a bundle enters no leaderboard. Raises BundleError and
    RunError.
    """
    parts = _by_robot([read_run(folder) for folder in folders], out)
    for path in parts:
        if path.exists() and not replace_old:
            raise BundleError(
                f"{path} is already there; choose another name, or --force to replace it"
            )
    if not videos and not practice:
        raise BundleError("videos can be left out of a bundle for practice only")
    whole = {path: merged(runs) for path, runs in parts.items()}
    for run in whole.values():
        check_run(run, card, reference, practice)
    packed = []
    for path, run in whole.items():
        homes = {key: one.folder for one in parts[path] for key in one.keys}
        part = path.with_name(f".{path.name}.{os.getpid()}.part")
        try:
            chosen = announced(run.manifest.suite, run.keys) if videos else []
            films = _films(run, chosen, reference, homes, note)
            note("writing the bundle")
            trace = partial(_trace, homes)
            write_bundle(part, run, card, trace, films, practice)
            note("verifying what was packed")
            valid = verify(part, reference, practice, done=done)
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)
        packed.append(replace(valid, path=path))
    return packed


def _by_robot(runs: Sequence[Run], out: Path) -> dict[Path, list[Run]]:
    """The runs of each bundle, by its path."""
    robots = dict.fromkeys(key.embodiment for run in runs for key in run.keys)
    if len(robots) < 2:
        return {out: list(runs)}
    parts = [part for run in runs for part in by_setting(run)]
    return {
        out.with_name(f"{out.stem}-{path_part(robot)}{out.suffix}"): [
            part for part in parts if part.keys[0].embodiment == robot
        ]
        for robot in robots
    }


def _trace(homes: Mapping[TrialKey, Path], key: TrialKey) -> Trace:
    """What a trial executed, from the folder of its run."""
    kept = read_trace(action_path(homes[key], key))
    actions = with_joints(kept.actions, kept.joints)
    if not is_quantized(actions):
        raise BundleError(
            f"{key.slug} has actions finer than 1/{STEPS_PER_UNIT}, as runs of older "
            "versions have: run it again with this one"
        )
    return actions


def merged(runs: Sequence[Run]) -> Run:
    """Several runs of one model as one; BundleError if they were not made alike."""
    first = runs[0]
    keys: list[TrialKey] = []
    records: dict[TrialKey, TrialRecord] = {}
    categories: dict[str, str] = {}
    policies: dict[str, PolicySettings] = {}
    for run in runs:
        _check_alike(first, run)
        known = set(keys)
        if again := [key for key in run.keys if key in known]:
            raise BundleError(f"two of the runs list the trial {again[0].slug}")
        keys += run.keys
        records.update(run.records)
        named, own = run.manifest.categories, run.manifest.settings
        tasks = dict.fromkeys(key.task for key in run.keys)
        categories.update({task: named[task] for task in tasks if task in named})
        policies.update({task: own.policies.get(task, own.policy) for task in tasks})
    settings, about = first.manifest.settings, first.manifest.about
    differ = any(policy != settings.policy for policy in policies.values())
    keys.sort()
    manifest = make_manifest(
        structs.replace(settings, policies=policies if differ else {}),
        keys,
        structs.replace(
            RunAbout(**{name: getattr(about, name) for name in ABOUT}),
            processors=tuple(dict.fromkeys(p for r in runs for p in r.manifest.about.processors)),
            drivers=sum(run.manifest.about.drivers for run in runs),
        ),
        categories,
        first.manifest.suite,
    )
    return Run(first.folder, manifest, tuple(keys), records)


def _check_alike(first: Run, run: Run) -> None:
    """BundleError if two runs differ in what decides a result, apart from the policy's options."""

    def decided(one: Run) -> dict[str, object]:
        settings, about = one.manifest.settings, one.manifest.about
        kept = to_builtins(settings)
        kept["world"]["arguments"].pop("render", None)
        del kept["policy"], kept["policies"]
        return {"suite": one.manifest.suite, **kept, **{k: getattr(about, k) for k in SAME}}

    if changes := changed_settings(decided(first), decided(run)):
        raise BundleError(
            f"{first.folder} and {run.folder} were not made alike ({'; '.join(changes[:3])}): "
            "a bundle has one version of everything"
        )


def write_bundle(
    path: Path,
    run: Run,
    card: Card,
    trace: Callable[[TrialKey], Trace],
    films: Mapping[str, bytes],
    practice: bool = False,
) -> None:
    """Write the bundle of `run` to `path` without looking at it; `trace` finds a trial's actions,
    `films` has the videos by name."""
    inputs = layout.inputs_hash(run.manifest)
    files: dict[str, FileEntry] = {}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=6) as archive:

        def add(name: str, data: bytes) -> None:
            files[name] = FileEntry(len(data), layout.sha256(data))
            _put(archive, name, data)

        for name, film in films.items():
            add(name, film)
        rows = list[TrialRow]()
        for variant, group in groupby(run.keys, key=lambda key: key.variant):
            traces = {key: trace(key) for key in group}
            add(layout.actions_name(*variant), encode(list(traces.values())))
            for key, actions in traces.items():
                video = film_name(key) if film_name(key) in films else ""
                rows.append((replace(run.records[key], video=video), trace_hash(actions)))
        lines = list(write_rows(rows, inputs))
        add(layout.RECORDS, b"".join(line + b"\n" for line in lines))
        for name, content in (
            (layout.RUN, run.manifest.to_json()),
            (layout.CARD, card),
            (layout.SCORES, scores_of(run)),
            (layout.OUTCOMES, outcomes_of(run)),
        ):
            add(name, layout.canonical(content))
        manifest = BundleManifest(
            format=layout.FORMAT,
            suite=run.manifest.suite,
            robospa=own_version(),
            practice=practice,
            inputs=inputs,
            chain=RowChain(len(lines), layout.sha256(lines[-1])),
            files=files,
        )
        name = layout.bundle_hash(to_builtins(manifest))
        _put(archive, layout.MANIFEST, layout.canonical(structs.replace(manifest, bundle=name)))


def _put(archive: zipfile.ZipFile, name: str, data: bytes) -> None:
    entry = zipfile.ZipInfo(name, DATE)
    entry.compress_type = zipfile.ZIP_STORED if name.endswith(".mp4") else zipfile.ZIP_DEFLATED
    entry.external_attr = 0o100644 << 16
    archive.writestr(entry, data)


def _films(
    run: Run,
    chosen: Sequence[TrialKey],
    reference: Reference,
    homes: Mapping[TrialKey, Path],
    note: Note,
) -> dict[str, bytes]:
    """The videos of the `chosen` trials by name in the bundle."""
    from robospa.harness.pictures.video import film
    from robospa.harness.replay import ReplayError

    films: dict[str, bytes] = {}
    parts = load_function(reference.parts)
    with ExitStack() as stack:
        world: World | None = None
        for number, key in enumerate(chosen, 1):
            name = film_name(key)
            there = homes[key] / name
            if run.records[key].video and there.is_file():
                films[name] = there.read_bytes()
                continue
            note(f"filming {key.slug} ({number} of {len(chosen)})")
            if world is None:
                world = stack.enter_context(closing(open_world(reference.world, render=True)))
            try:
                films[name] = film(world, run.records[key], homes[key], parts=parts)
            except ReplayError as error:
                raise BundleError(
                    f"{error}, so it cannot be filmed here: pack where it ran"
                ) from error
    return films
