"""`robospa submit`: make a bundle of a run, verify one, have one reproduced.

What these commands do lies in `robospa.leaderboard`, which is reached by name: the harness is
below it and imports nothing of it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

LEADERBOARD = "robospa.leaderboard"
submit = typer.Typer(
    help="Pack a run as a bundle, verify a bundle, have it reproduced.",
    no_args_is_help=True,
    rich_markup_mode=None,
)
Hidden = Annotated[str | None, typer.Option(hidden=True)]


def _reach(path: str) -> Any:
    from robospa.harness.factory import load_function

    return load_function(f"{LEADERBOARD}.{path}")


@submit.command()
def template() -> None:
    """Print a model card to fill in: robospa submit template > model.toml"""
    print(_reach("card:template")(), end="")


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
    world: Hidden = None,
    parts: Hidden = None,
) -> None:
    """Make a bundle of complete runs, film the announced trials, and verify the result."""
    reference = _reach("reference:shipped")(world, parts)
    card = _reach("card:read_card")(model)
    packed = _reach("packing:pack")(
        run, card, out, reference, practice=practice, videos=videos, note=print
    )
    evidence = packed.valid.evidence
    print(f"{out}: {packed.size / 1e6:.1f} MB, {evidence['trials']} trials")
    whole = sum(packed.parts.values())
    shares = [f"{n} {100 * s / whole:.0f} %" for n, s in packed.parts.items() if s > whole / 100]
    print("of which " + ", ".join(shares))
    for warning in evidence["warnings"]:
        print(warning)
    print(f"bundle {evidence['bundle']}")


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
    fraction: Annotated[float, typer.Option(help="share of the trials to replay")] = 0.01,
    workers: Annotated[int, typer.Option(help="processes; 0 for one per core")] = 0,
    practice: Annotated[
        bool, typer.Option("--practice", help="accept bundles for practice")
    ] = False,
    evidence: Annotated[
        Path | None, typer.Option(help="write the evidence for the badges there, JSON")
    ] = None,
    world: Hidden = None,
    parts: Hidden = None,
) -> None:
    """Check a bundle; with --challenge also replay a sample. Offline; nothing is unpacked."""
    import time

    reference = _reach("reference:shipped")(world, parts)
    begun = time.perf_counter()
    valid = _reach("verify:verify")(bundle, reference, practice)
    found: dict[str, Any] = {"valid": dict(valid.evidence)}
    seconds = time.perf_counter() - begun
    print(
        f"valid: {valid.evidence['trials']} trials of {valid.evidence['variants']} variants; "
        "structure, hashes, chain, seeds, records, actions, scores and tables hold "
        f"({seconds:.1f} s)"
    )
    for warning in valid.evidence["warnings"]:
        print(warning)
    holds = True
    if challenge is not None:
        made = _replayed(valid, challenge, fraction, workers, reference)
        found["replayed"] = made.to_json()
        holds = made.holds
        badge = "replayed" if made.exact else "replayed, outcomes only" if holds else "NOT REPLAYED"
        print(f"{badge}: " + " ".join(made.sentences()))
    print(f"bundle {valid.manifest['bundle']}")
    if evidence is not None:
        _write(evidence, found)
    if not holds:
        raise typer.Exit(1)


@submit.command()
def block(
    tasks: Annotated[str, typer.Argument(help="tasks, categories or all, as for robospa eval")],
    out: Annotated[Path, typer.Option("--out", "-o", help="where to write the secret block")],
    levels: Annotated[str, typer.Option(help="such as 1,3-5")] = "1-5",
    trials: Annotated[int, typer.Option(help="seeds per variant")] = 10,
    workers: Annotated[int, typer.Option(help="processes; 0 for one per core")] = 0,
) -> None:
    """Draw fresh seeds that the expert solves, and print the commitment to publish beforehand."""
    from robospa.harness.running.autoscaling import cores
    from robospa.harness.selection import parse_levels, parse_tasks

    variants = [(task, level) for task in parse_tasks(tasks) for level in parse_levels(levels)]
    made = _reach("hidden_seeds:draw_block")(variants, trials, workers or cores(), note=print)
    _reach("hidden_seeds:write_block")(made, out)
    print(f"Keep {out} secret until the trials begin. Publish now:")
    print(f"commitment {made.commitment}")


@submit.command()
def reproduce(
    bundle: Annotated[Path, typer.Argument(help="the bundle")],
    policy: Annotated[str, typer.Argument(help="the submitter's server, such as ws://host:port")],
    block: Annotated[Path, typer.Option(help="the block of hidden seeds, revealed now")],
    commitment: Annotated[str, typer.Option(help="as published before")],
    out: Annotated[Path, typer.Option(help="folder for the run on the hidden seeds")],
    resume: Annotated[bool, typer.Option("--resume", help="go on with the run in --out")] = False,
    workers: Annotated[int, typer.Option(help="worker processes; 0 for one per core")] = 0,
    alpha: Annotated[float, typer.Option(help="level of the test")] = 0.01,
    token: Annotated[
        str | None, typer.Option(envvar="ROBOSPA_TOKEN", help="bearer token of the server")
    ] = None,
    practice: Annotated[
        bool, typer.Option("--practice", help="accept bundles for practice")
    ] = False,
    evidence: Annotated[
        Path | None, typer.Option(help="write the evidence for the badge there, JSON")
    ] = None,
    world: Hidden = None,
    parts: Hidden = None,
) -> None:
    """Run hidden seeds against the submitter's server and test exactly whether they agree."""
    from robospa.harness.running.evaluate import evaluate
    from robospa.harness.running.request import make_request
    from robospa.harness.settings import EvaluationSettings, updated
    from robospa.results.records.run_io import read_run

    reference = _reach("reference:shipped")(world, parts)
    valid = _reach("verify:verify")(bundle, reference, practice)
    seeds = _reach("hidden_seeds:read_block")(block, commitment)
    keys = _reach("reproduce:hidden_keys")(valid, seeds, reference)
    run_seed = valid.run.manifest["settings"]["run_seed"]
    asked = {"policy": policy, "out": out, "workers": workers, "run_seed": run_seed}
    request = make_request(
        updated(EvaluationSettings(), {**asked, "world": world, "parts": parts}),
        token=token,
        resume=resume,
        keys=keys,
        arguments={"command": "submit reproduce", "commitment": commitment},
    )
    _reach("reproduce:check_policy")(valid, request)
    evaluate(request)
    made = _reach("reproduce:compare")(valid, read_run(out), keys, seeds, alpha)
    badge = "reproduced" if made.holds else "NOT REPRODUCED"
    print(f"{badge}: " + " ".join(made.sentences()))
    if evidence is not None:
        _write(evidence, {"reproduced": made.to_json()})
    if not made.holds:
        raise typer.Exit(1)


def _replayed(valid: Any, challenge: str, fraction: float, workers: int, reference: Any) -> Any:
    """The replayed sample, with a bar while it is made."""
    from robospa.harness.running.autoscaling import cores
    from robospa.harness.running.progress import Progress

    count = _reach("sampling:sample_size")(fraction, len(valid.keys))
    with Progress(count) as progress:

        def show(trial: Any) -> None:
            if trial.kind == "different":
                why = trial.trouble or "other " + ", ".join(trial.differs)
                progress.note(f"{trial.key.slug}: {why}")
            progress.add(trial.record or valid.run.records[trial.key])
            progress.show()

        return _reach("replay:replay")(valid, challenge, count, reference, workers or cores(), show)


def _write(path: Path, found: dict[str, Any]) -> None:
    import json

    from robospa.harness.running.atomic_file import replace_file

    replace_file(path, (json.dumps(found, indent=1) + "\n").encode())
