"""Soak: interrupt a real `robospa eval` at random, resume, compare with a run in peace.

    python tests/helpers/soak.py --interruptions 200 --seed 1 --json soak.json

Drivers, workers and policy servers are real processes. In the end every run must hold exactly the
trials it was to hold, each once, with records and actions equal to those of an uninterrupted run,
and nothing else in its folder. The sequence follows from the seed, the moments also from the
machine. `--real` takes the simulator and the oracle instead of a fake world. Exit code 1 if
anything was found.
"""

from __future__ import annotations

import argparse
import json
import random
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

from soak_kinds import ENDS_DRIVER, KINDS, Trouble
from soak_run import Bench, Finding, check_run


def arguments() -> argparse.Namespace:
    """Command line."""
    reader = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else "")
    reader.add_argument("--interruptions", type=int, default=200)
    reader.add_argument("--seed", type=int, default=0)
    reader.add_argument("--trials", type=int, default=120, help="trials of each run")
    reader.add_argument("--workers", type=int, default=2)
    reader.add_argument("--kinds", default="", help=f"some of {', '.join(KINDS)}")
    reader.add_argument("--mount", action="store_true", help="runs on a small tmpfs, to fill it")
    reader.add_argument("--real", action="store_true", help="the simulator and the oracle")
    reader.add_argument("--json", type=Path)
    return reader.parse_args()


def choose(options: argparse.Namespace) -> list[str]:
    """The kinds that can be done here."""
    kinds = [k for k in options.kinds.split(",") if k] or list(KINDS)
    if unknown := [k for k in kinds if k not in KINDS]:
        raise SystemExit(f"soak: no kind {unknown[0]!r}; known are {', '.join(KINDS)}")
    if not options.mount:
        kinds = [k for k in kinds if k != "disk full"]
    if options.real:  # the oracle needs no server, and only the fake world gets stuck on demand
        kinds = [k for k in kinds if k not in ("server killed", "worker stuck in native code")]
    return kinds


def soak(options: argparse.Namespace, base: Path) -> dict[str, object]:
    """All interruptions; what happened as plain JSON values."""
    rng = random.Random(options.seed)
    kinds = choose(options)
    bench = Bench(base, options.trials, options.workers, options.real)
    done: Counter[str] = Counter()
    found: list[str] = []
    rounds = trials = resumed = 0
    begun = time.monotonic()
    try:
        reference = bench.reference()
        while done.total() < options.interruptions:
            rounds += 1
            left = options.interruptions - done.total()
            trouble = Trouble(bench.new_run(rounds), rng, kinds, left)
            try:
                trouble.until_done()
                found += check_run(trouble.run, reference)
            except Finding as finding:
                found.append(f"run {rounds}: {finding}")
            finally:
                trouble.run.end()
            done += trouble.done
            resumed += trouble.run.starts - 1
            trials += options.trials
            print(
                f"run {rounds}: {dict(trouble.done)}; {done.total()} interruptions, "
                f"{len(found)} findings, {time.monotonic() - begun:.0f} s",
                flush=True,
            )
            if found:
                keep = Path(tempfile.mkdtemp(prefix="soak-finding-"))
                shutil.copytree(trouble.run.folder, keep / "run")
                print(f"kept in {keep}: {found[-1]}\n{trouble.run.errors()}", flush=True)
                break
    finally:
        bench.close()
    return {
        "seed": options.seed,
        "world": "sapien" if options.real else "fake",
        "interruptions": done.total(),
        "by_kind": {kind: done[kind] for kind in KINDS if done[kind]},
        "ended_the_driver": sum(done[k] for k in ENDS_DRIVER),
        "runs": rounds,
        "resumed": resumed,
        "trials_compared": trials,
        "seconds": round(time.monotonic() - begun, 1),
        "findings": found,
    }


def main() -> None:
    """Entry point."""
    options = arguments()
    base = Path(tempfile.mkdtemp(prefix="soak-"))
    if options.mount:
        subprocess.run(["mount", "-t", "tmpfs", "-o", "size=24m", "soak", str(base)], check=True)
    try:
        result = soak(options, base)
    finally:
        if options.mount:
            subprocess.run(["umount", "-l", str(base)], check=False)
        shutil.rmtree(base, ignore_errors=True)
    text = json.dumps(result, indent=1)
    print(text)
    if options.json:
        options.json.write_text(text + "\n")
    sys.exit(1 if result["findings"] else 0)


if __name__ == "__main__":
    main()
