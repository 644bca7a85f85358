"""`robospa submit` and `robospa leaderboard`: make a bundle of a run, verify one, have one
reproduced; keep a verified bundle as a submission, build the site.

The command line reaches these commands by name: the harness is below the leaderboard and imports
nothing of it.
"""

import json
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated

import typer
from msgspec import to_builtins

from robospa.harness.cli.options import PROCESSES, TRIALS, AsJson, Token, aside, print_json
from robospa.harness.progress import Progress
from robospa.harness.running.atomic_file import replace_file
from robospa.harness.running.evaluate import evaluate
from robospa.harness.running.request import make_request
from robospa.harness.running.status import cores
from robospa.harness.settings import EvaluationSettings, updated
from robospa.leaderboard import card, evidence, packing, replay, reproduce, rules, site, submission
from robospa.leaderboard.bundle import parse_map
from robospa.leaderboard.verify import Valid, verify
from robospa.results.records.runs import read_run

SUBMISSIONS = Path("leaderboard/submissions")
MOST = 16 * 1024 * 1024
"""Bytes of a file of evidence."""
submit = typer.Typer(
    help="Pack a run as a bundle, verify a bundle, have it reproduced.",
    no_args_is_help=True,
    rich_markup_mode=None,
)
leaderboard = typer.Typer(
    help="Keep a verified bundle as a submission, build the site.",
    no_args_is_help=True,
    rich_markup_mode=None,
)
Hidden = Annotated[str | None, typer.Option(hidden=True)]
Workers = Annotated[int, typer.Option(callback=PROCESSES, help="processes; 0 for one per core")]
Practice = Annotated[bool, typer.Option("--practice", help="accept bundles for practice")]
Evidence = Annotated[
    Path | None, typer.Option("--evidence", help="write the evidence for the badges there, JSON")
]
Home = Annotated[Path, typer.Option(help="folder of the submissions")]


@submit.command()
def template() -> None:
    """Print a model card to fill in: robospa submit template > model.toml"""
    print(card.template(), end="")


@submit.command()
def pack(
    run: Annotated[list[Path], typer.Argument(help="folders of one model's runs")],
    model: Annotated[Path, typer.Option(help="the model card, TOML")],
    out: Annotated[Path, typer.Option("--out", "-o", help="the bundle to write")],
    practice: Annotated[
        bool,
        typer.Option("--practice", help="pack the first seeds of any variants; never ranked"),
    ] = False,
    videos: Annotated[
        bool, typer.Option(help="film the announced trials (leave out for practice only)")
    ] = True,
    force: Annotated[
        bool, typer.Option("--force", help="replace a bundle that is there already")
    ] = False,
    as_json: AsJson = False,
    world: Hidden = None,
    parts: Hidden = None,
) -> None:
    """Make a bundle of complete runs, film the announced trials, and verify the result.

    Runs of several robots give one bundle each, NAME-ROBOT.zip.
    """
    reference = rules.shipped(world, parts)
    about = card.read_card(model)
    note, done, bundles = aside if as_json else print, scene_progress(), []
    for valid in packing.pack(
        run,
        about,
        out,
        reference,
        practice=practice,
        videos=videos,
        replace_old=force,
        note=note,
        done=done,
    ):
        path, validity = valid.path, valid.evidence
        size = path.stat().st_size
        bundles.append({"path": path, "bytes": size, "evidence": validity})
        if as_json:
            continue
        print(f"{path}: {size / 1e6:.1f} MB, {validity.trials} trials")
        for warning in validity.warnings:
            print(warning)
        print(f"bundle {validity.bundle}")
    if as_json:
        print_json(bundles)


@submit.command("verify")
def verify_bundle(
    bundle: Annotated[Path, typer.Argument(help="the bundle")],
    challenge: Annotated[
        str | None,
        typer.Option(
            help="replay a sample chosen by this value, which nobody could know in advance, such "
            "as the merge commit's hash"
        ),
    ] = None,
    fraction: Annotated[
        float,
        typer.Option(
            help="share of the trials to replay; always enough to detect 5 % invented outcomes "
            "with 99.9 % probability"
        ),
    ] = 0.01,
    workers: Workers = 0,
    practice: Practice = False,
    evidence_file: Evidence = None,
    as_json: AsJson = False,
    world: Hidden = None,
    parts: Hidden = None,
) -> None:
    """Check a bundle; with --challenge also replay a sample. Offline; nothing is unpacked."""
    if challenge is not None:
        evidence.check_challenge(challenge)
        evidence.sample_size(fraction, 1)
    reference = rules.shipped(world, parts)
    started = time.perf_counter()
    valid = verify(bundle, reference, practice, workers=workers, done=scene_progress())
    found: dict[str, object] = {"valid": to_builtins(valid.evidence)}
    seconds = time.perf_counter() - started
    say = aside if as_json else print
    counts = f"valid: {valid.evidence.trials} trials of {valid.evidence.variants} variants"
    what = "structure, hashes, chain, seeds, records, actions, scores and scenes hold"
    for line in (
        f"{counts}; {what} ({seconds:.1f} s)",
        valid.evidence.attempts,
        *valid.evidence.warnings,
    ):
        say(line)
    holds = True
    if challenge is not None:
        replayed = _replay(valid, challenge, fraction, workers, reference)
        found["replayed"] = to_builtins(replayed.evidence)
        holds = replayed.evidence.holds
        exact = "replayed" if replayed.evidence.exact else "replayed, outcomes only"
        say(f"{exact if holds else 'NOT REPLAYED'}: " + " ".join(replayed.sentences()))
    say(f"bundle {valid.manifest.bundle}")
    if as_json:
        print_json({"holds": holds, **found})
    if evidence_file is not None:
        _write(evidence_file, found)
    if not holds:
        raise typer.Exit(1)


@submit.command()
def block(
    bundle: Annotated[Path, typer.Argument(help="the bundle that is to be reproduced")],
    out: Annotated[Path, typer.Option("--out", "-o", help="where to write the secret block")],
    trials: Annotated[
        int | None,
        typer.Option(
            callback=TRIALS, help="hidden trials per variant; default: as few as a badge needs"
        ),
    ] = None,
    workers: Workers = 0,
    practice: Practice = False,
    as_json: AsJson = False,
    world: Hidden = None,
    parts: Hidden = None,
) -> None:
    """Draw hidden scenes that the expert solves, and print the commitment to publish beforehand."""
    valid = verify(bundle, rules.shipped(world, parts), practice)
    count = reproduce.plan(valid, trials)
    variants = list(dict.fromkeys(key.variant for key in valid.keys))
    say = aside if as_json else print
    say(f"{count} hidden trials of each of {len(variants)} variants: {count * len(variants)}")
    robot, mode = valid.keys[0].embodiment, valid.keys[0].mode
    drawn = reproduce.draw_block(variants, count, workers or cores(), say, robot, mode)
    reproduce.write_block(drawn, out)
    say(f"Keep {out} secret until the trials are over. Publish now:")
    known = {"block": out, "trials": count, "variants": len(variants)}
    told = {**known, "commitment": drawn.commitment}
    _tell(as_json, told, f"commitment {drawn.commitment}")


@submit.command("reproduce")
def reproduce_bundle(
    bundle: Annotated[Path, typer.Argument(help="the bundle")],
    policy: Annotated[str, typer.Argument(help="the submitter's server, such as ws://host:port")],
    block: Annotated[Path, typer.Option(help="the secret block of hidden scenes")],
    commitment: Annotated[str, typer.Option(help="as published before")],
    out: Annotated[Path, typer.Option(help="folder for the run on the hidden scenes")],
    resume: Annotated[bool, typer.Option("--resume", help="go on with the run in --out")] = False,
    workers: Workers = 0,
    token: Token = None,
    practice: Practice = False,
    evidence_file: Evidence = None,
    as_json: AsJson = False,
    world: Hidden = None,
    parts: Hidden = None,
) -> None:
    """Run hidden scenes on the submitter's server and test exactly whether they agree."""
    reference = rules.shipped(world, parts)
    valid = verify(bundle, reference, practice)
    seeds = reproduce.read_block(block, commitment)
    keys = reproduce.hidden_keys(valid, seeds, reference)
    reproduce.plan(valid, min(map(len, seeds.seeds.values())))
    asked = {"policy": policy, "out": out, "workers": workers}
    request = make_request(
        updated(EvaluationSettings(), {**asked, "world": world, "parts": parts}),
        token=token,
        resume=resume,
        keys=keys,
        arguments={"command": "submit reproduce", "commitment": commitment},
        salt=seeds.salt,
    )
    reproduce.check_policy(valid, request)
    evaluate(request)
    compared = reproduce.compare(valid, read_run(out), keys, seeds)
    earned = "reproduced" if compared.enough else "agrees, but earns no badge"
    verdict = earned if compared.holds else "NOT REPRODUCED"
    held = {"holds": compared.holds, "badge": compared.holds and compared.enough}
    told = {**held, "reproduced": to_builtins(compared)}
    _tell(as_json, told, f"{verdict}: " + " ".join(compared.sentences()))
    if evidence_file is not None:
        _write(evidence_file, {"reproduced": to_builtins(compared)})
    if not compared.holds:
        raise typer.Exit(1)


@leaderboard.command()
def build(
    submissions: Home = SUBMISSIONS,
    out: Annotated[Path, typer.Option("--out", "-o", help="folder of the site")] = Path("site"),
    as_json: AsJson = False,
) -> None:
    """Write the leaderboard as static pages."""
    note = aside if as_json else print
    if not submissions.is_dir():
        note(f"There is no folder {submissions}: the site has the published models only.")
    index = site.build(submissions, out, note)
    _tell(as_json, {"index": index}, f"Leaderboard: {index}")


@leaderboard.command()
def add(
    bundle: Annotated[Path, typer.Argument(help="the bundle")],
    evidence: Annotated[
        list[Path] | None, typer.Option(help="files that verify and reproduce wrote")
    ] = None,
    address: Annotated[
        str, typer.Option(help="https address of the bundle, unless the folder has a bundle.txt")
    ] = "",
    name: Annotated[str, typer.Option(help="the folder; else made from the model's name")] = "",
    submissions: Home = SUBMISSIONS,
    as_json: AsJson = False,
    world: Hidden = None,
    parts: Hidden = None,
) -> None:
    """Verify a bundle and keep what the leaderboard needs of it in the submission's folder."""
    valid = verify(bundle, rules.shipped(world, parts))
    found = []
    for path in evidence or []:
        if path.stat().st_size > MOST:
            raise ValueError(f"{path} is larger than evidence can be")
        found.append(parse_map(path.read_bytes(), str(path)))
    folder = submission.add(valid, found, submissions, name, address)
    told = {"submission": folder, "evidence": valid.evidence}
    _tell(as_json, told, f"Submission: {folder}")


def _tell(as_json: bool, found: object, text: str) -> None:
    """What a command found, as JSON or in words."""
    if as_json:
        print_json(found)
    else:
        print(text)


def scene_progress() -> Callable[[int, int], None]:
    """A function that says on stderr how many scenes of a large bundle were made again."""
    tenths = 0

    def show(count: int, trials: int) -> None:
        nonlocal tenths
        if trials > 1000 and 10 * count // trials > tenths:
            tenths = 10 * count // trials
            print(f"scenes made again: {count} of {trials}", file=sys.stderr, flush=True)

    return show


def _replay(
    valid: Valid, challenge: str, fraction: float, workers: int, reference: rules.Reference
) -> replay.SampleReplay:
    """Replay a sample of the trials, with a progress bar."""
    count = evidence.sample_size(fraction, len(valid.keys))
    with Progress(count) as progress:

        def show(trial: replay.Replayed) -> None:
            if trial.kind == "different":
                reason = trial.trouble or "other " + ", ".join(trial.differs)
                progress.note(f"{trial.key.slug}: {reason}")
            progress.add(trial.record or valid.run.records[trial.key])
            progress.update()

        return replay.replay(valid, challenge, count, reference, workers or cores(), show)


def _write(path: Path, found: Mapping[str, object]) -> None:
    replace_file(path, (json.dumps(found, indent=1) + "\n").encode())
