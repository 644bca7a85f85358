"""`robospa submit`: make a bundle of a run, verify one, have one reproduced.

What these commands do lies in `robospa.leaderboard`, which is reached by name: the harness is
below it and imports nothing of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from robospa.harness.cli.options import PROCESSES, SHARE, TRIALS, AsJson, Token, aside, print_json

LEADERBOARD = "robospa.leaderboard"
submit = typer.Typer(
    help="Pack a run as a bundle, verify a bundle, have it reproduced.",
    no_args_is_help=True,
    rich_markup_mode=None,
)
Hidden = Annotated[str | None, typer.Option(hidden=True)]


def _load(path: str) -> Callable[..., Any]:
    from robospa.harness.factory import load_function

    return load_function(f"{LEADERBOARD}.{path}")


@submit.command()
def template() -> None:
    """Print a model card to fill in: robospa submit template > model.toml"""
    print(_load("card:template")(), end="")


@submit.command()
def pack(
    run: Annotated[list[Path], typer.Argument(help="folders of one model's runs")],
    model: Annotated[Path, typer.Option(help="the model card, TOML")],
    out: Annotated[Path, typer.Option("--out", "-o", help="the bundle to write")],
    practice: Annotated[
        bool,
        typer.Option(
            "--practice", help="the first seeds of any variants will do; not to be ranked"
        ),
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

    Of runs of several robots a bundle each, NAME-ROBOT.zip.
    """
    reference = _load("rules:shipped")(world, parts)
    card = _load("card:read_card")(model)
    how = _load("packing:Packing")(
        practice=practice,
        videos=videos,
        replace_old=force,
        note=aside if as_json else print,
        done=scene_progress(),
    )
    bundles = []
    for packed in _load("packing:pack")(run, card, out, reference, how):
        evidence = packed.valid.evidence
        if as_json:
            about = {"path": packed.valid.path, "bytes": packed.size, "parts": packed.parts}
            bundles.append({**about, "evidence": evidence})
            continue
        print(f"{packed.valid.path}: {packed.size / 1e6:.1f} MB, {evidence.trials} trials")
        total = sum(packed.parts.values())
        shares = [
            f"{n} {100 * s / total:.0f} %" for n, s in packed.parts.items() if s > total / 100
        ]
        print("of which " + ", ".join(shares))
        for warning in evidence.warnings:
            print(warning)
        print(f"bundle {evidence.bundle}")
    if as_json:
        print_json(bundles)


@submit.command()
def verify(
    bundle: Annotated[Path, typer.Argument(help="the bundle")],
    challenge: Annotated[
        str | None,
        typer.Option(
            help="replay a sample that this value chooses: one that nobody could know before the "
            "bundle was handed in, such as the merge commit's hash"
        ),
    ] = None,
    fraction: Annotated[
        float,
        typer.Option(
            help="share of the trials to replay, never fewer than show 5 % of invented outcomes "
            "999 times in a thousand"
        ),
    ] = 0.01,
    workers: Annotated[int, typer.Option(callback=PROCESSES, help="0 for one per core")] = 0,
    practice: Annotated[
        bool, typer.Option("--practice", help="accept bundles for practice")
    ] = False,
    evidence: Annotated[
        Path | None, typer.Option(help="write the evidence for the badges there, JSON")
    ] = None,
    as_json: AsJson = False,
    world: Hidden = None,
    parts: Hidden = None,
) -> None:
    """Check a bundle; with --challenge also replay a sample. Offline; nothing is unpacked."""
    import time

    from msgspec import to_builtins

    if challenge is not None:
        _load("evidence:check_challenge")(challenge)
        _load("evidence:check_fraction")(fraction)
    reference = _load("rules:shipped")(world, parts)
    started = time.perf_counter()
    valid = _load("verify:verify")(
        bundle, reference, practice, workers=workers, done=scene_progress()
    )
    found: dict[str, object] = {"valid": to_builtins(valid.evidence)}
    seconds = time.perf_counter() - started
    say = aside if as_json else print
    for line in _lines(valid.evidence, seconds):
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
    if evidence is not None:
        _write(evidence, found)
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
    alpha: Annotated[float, typer.Option(callback=SHARE, help="level of the test")] = 0.01,
    workers: Annotated[int, typer.Option(callback=PROCESSES, help="0 for one per core")] = 0,
    practice: Annotated[
        bool, typer.Option("--practice", help="accept bundles for practice, and few trials")
    ] = False,
    as_json: AsJson = False,
    world: Hidden = None,
    parts: Hidden = None,
) -> None:
    """Draw hidden scenes that the expert solves, and print the commitment to publish beforehand."""
    from robospa.harness.running.status import cores

    valid = _load("verify:verify")(bundle, _load("rules:shipped")(world, parts), practice)
    count = _load("reproduce:plan")(valid, trials, alpha)
    variants = list(dict.fromkeys(key.variant for key in valid.keys))
    say = aside if as_json else print
    say(f"{count} hidden trials of each of {len(variants)} variants: {count * len(variants)}")
    robot, mode = valid.keys[0].embodiment, valid.keys[0].mode
    draw = _load("reproduce:draw_block")
    drawn = draw(variants, count, workers or cores(), say, robot, mode)
    _load("reproduce:write_block")(drawn, out)
    say(f"Keep {out} secret until the trials are over. Publish now:")
    if as_json:
        known = {"block": out, "trials": count, "variants": len(variants)}
        print_json({**known, "commitment": drawn.commitment})
    else:
        print(f"commitment {drawn.commitment}")


@submit.command()
def reproduce(
    bundle: Annotated[Path, typer.Argument(help="the bundle")],
    policy: Annotated[str, typer.Argument(help="the submitter's server, such as ws://host:port")],
    block: Annotated[Path, typer.Option(help="the secret block of hidden scenes")],
    commitment: Annotated[str, typer.Option(help="as published before")],
    out: Annotated[Path, typer.Option(help="folder for the run on the hidden scenes")],
    resume: Annotated[bool, typer.Option("--resume", help="go on with the run in --out")] = False,
    workers: Annotated[
        int, typer.Option(callback=PROCESSES, help="worker processes; 0 for one per core")
    ] = 0,
    alpha: Annotated[float, typer.Option(callback=SHARE, help="level of the test")] = 0.01,
    token: Token = None,
    practice: Annotated[
        bool, typer.Option("--practice", help="accept bundles for practice")
    ] = False,
    evidence: Annotated[
        Path | None, typer.Option(help="write the evidence for the badge there, JSON")
    ] = None,
    as_json: AsJson = False,
    world: Hidden = None,
    parts: Hidden = None,
) -> None:
    """Run hidden scenes on the submitter's server and test exactly whether they agree."""
    from msgspec import to_builtins

    from robospa.harness.running.evaluate import evaluate
    from robospa.harness.running.request import make_request
    from robospa.harness.settings import EvaluationSettings, updated
    from robospa.results.records.runs import read_run

    reference = _load("rules:shipped")(world, parts)
    valid = _load("verify:verify")(bundle, reference, practice)
    seeds = _load("reproduce:read_block")(block, commitment)
    keys = _load("reproduce:hidden_keys")(valid, seeds, reference)
    _load("reproduce:plan")(valid, min(map(len, seeds.seeds.values())), alpha)
    run_seed = valid.run.manifest.settings.run_seed
    asked = {"policy": policy, "out": out, "workers": workers, "run_seed": run_seed}
    request = make_request(
        updated(EvaluationSettings(), {**asked, "world": world, "parts": parts}),
        token=token,
        resume=resume,
        keys=keys,
        arguments={"command": "submit reproduce", "commitment": commitment},
        salt=seeds.salt,
    )
    _load("reproduce:check_policy")(valid, request)
    evaluate(request)
    compared = _load("reproduce:compare")(valid, read_run(out), keys, seeds, alpha)
    earned = "reproduced" if compared.enough else "agrees, but earns no badge"
    verdict = earned if compared.holds else "NOT REPRODUCED"
    if as_json:
        held = {"holds": compared.holds, "badge": compared.holds and compared.enough}
        print_json({**held, "reproduced": to_builtins(compared)})
    else:
        print(f"{verdict}: " + " ".join(compared.sentences()))
    if evidence is not None:
        _write(evidence, {"reproduced": to_builtins(compared)})
    if not compared.holds:
        raise typer.Exit(1)


def _lines(evidence: Any, seconds: float) -> list[str]:
    """What of a bundle was found valid, in sentences."""
    counts = f"valid: {evidence.trials} trials of {evidence.variants} variants"
    what = "structure, hashes, chain, seeds, records, actions, scores, tables and scenes hold"
    return [f"{counts}; {what} ({seconds:.1f} s)", *evidence.warnings]


def scene_progress() -> Callable[[int, int], None]:
    """A function that says on stderr how many scenes of a large bundle were made again."""
    import sys

    tenths = 0

    def show(count: int, trials: int) -> None:
        nonlocal tenths
        if trials > 1000 and 10 * count // trials > tenths:
            tenths = 10 * count // trials
            print(f"scenes made again: {count} of {trials}", file=sys.stderr, flush=True)

    return show


def _replay(valid: Any, challenge: str, fraction: float, workers: int, reference: Any) -> Any:
    """Replay a sample of the trials, with a progress bar."""
    from robospa.harness.progress import Progress
    from robospa.harness.running.status import cores

    count = _load("evidence:sample_size")(fraction, len(valid.keys))
    with Progress(count) as progress:

        def show(trial: Any) -> None:
            if trial.kind == "different":
                reason = trial.trouble or "other " + ", ".join(trial.differs)
                progress.note(f"{trial.key.slug}: {reason}")
            progress.add(trial.record or valid.run.records[trial.key])
            progress.update()

        return _load("replay:replay")(valid, challenge, count, reference, workers or cores(), show)


def _write(path: Path, found: Mapping[str, object]) -> None:
    import json

    from robospa.harness.running.atomic_file import replace_file

    replace_file(path, (json.dumps(found, indent=1) + "\n").encode())
