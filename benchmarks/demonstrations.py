"""Recorded demonstrations: do they fit the step limit, and does replaying them meet the goal?

    python benchmarks/demonstrations.py [--trials 1] [--first 950000] [--tasks NAME,..] [--json]

Records the expert on `--trials` seeds of every variant that no list has, without pictures, and
replays what was recorded, one recorded action a step, by the official rule and within the official
step limit. Trials are kept in `--trials-file` (build/demonstrations.jsonl) as they are done; one
that is there is not done again. `--json` also writes the table of variants beside the result
(benchmarks/results/demonstrations.csv). The bars: 95 % of the replays succeed, and a demonstration
takes at most 85 % of its step limit, in every variant; the 205 frames of a demonstration are the
mean of the official data.
"""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from multiprocessing import get_context
from pathlib import Path
from statistics import mean

from common import RESULTS, Metric, Result, argument_parser, finish

from robospa.categories import BASIC, CATEGORIES
from robospa.tasks.catalog import LEVELS, task, tasks

REPLAYED = 95.0
SHARE = 85.0
OFFICIAL_FRAMES = 205
"""Mean of the official data: 108 million time steps in 527 thousand trajectories (the paper)."""
WORST = 10
UNSTABLE = "no valid scene"

Variant = tuple[str, int]


@dataclass(frozen=True)
class Trial:
    """One demonstration and its replay: `actions` recorded, `used` until the goal was met."""

    task: str
    level: int
    seed: int
    shown: bool
    replayed: bool
    actions: int
    used: int
    seconds: float
    """Simulated, of the demonstration."""
    failures: tuple[str, ...]
    end: str
    """Of the replay."""

    @property
    def key(self) -> tuple[str, int, int]:
        """What makes it one trial."""
        return (self.task, self.level, self.seed)


def run(key: tuple[str, int, int]) -> Trial:
    """Record and replay one trial."""
    from robospa.harness.demonstrations.expert_run import demonstrate
    from robospa.harness.demonstrations.recorder import FrameRecorder
    from robospa.harness.demonstrations.strides import stride_of
    from robospa.harness.replay import replay
    from robospa.harness.robots import embodiment
    from robospa.harness.sim.motion import DEMONSTRATION_LIMITS
    from robospa.harness.sim.sapien_world import SapienWorld
    from robospa.harness.world import SceneUnstable
    from robospa.trial import TrialKey

    name, level, seed = key
    trial = TrialKey(name, level, seed)
    recorder = FrameRecorder(stride_of(name))
    world = SapienWorld(render=False, limits=DEMONSTRATION_LIMITS)
    try:
        made = demonstrate(world, trial, recorder)
    except SceneUnstable:
        return Trial(name, level, seed, False, False, 0, 0, 0.0, (), UNSTABLE)
    finally:
        world.close()
    space = embodiment(trial.embodiment).action_space("joint")
    actions = recorder.episode(name, made.instruction, {}, space, ()).actions
    world = SapienWorld(render=False)
    done = replay(world, trial, actions, "joint")
    world.close()
    return Trial(name, level, seed, made.success, done.success, len(actions), done.steps,
        round(made.seconds, 2), made.failures, done.end)  # fmt: skip


def known_trials(path: Path) -> list[Trial]:
    """Those that are done."""
    if not path.exists():
        return []
    return [Trial(**json.loads(line)) for line in path.read_text(encoding="utf-8").splitlines()]


def measured(keys: list[tuple[str, int, int]], path: Path, workers: int) -> Iterator[Trial]:
    """The trials of `keys`, those in `path` first; new ones are appended to it."""
    wanted = set(keys)
    done = {trial.key: trial for trial in known_trials(path) if trial.key in wanted}
    yield from done.values()
    left = [key for key in keys if key not in done]
    path.parent.mkdir(parents=True, exist_ok=True)
    began = time.monotonic()
    with (
        ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool,
        path.open("a", encoding="utf-8") as file,
    ):
        for i, trial in enumerate(pool.map(run, left), 1):
            file.write(json.dumps(asdict(trial)) + "\n")
            file.flush()
            rest = (time.monotonic() - began) / i * (len(left) - i) / 60
            how = "" if trial.replayed else f"  replay: {trial.end} {' '.join(trial.failures)}"
            print(f"{i}/{len(left)} {trial.task} {trial.level} {trial.seed}: {trial.actions} of "
                f"{limit(trial)} actions{how}  ({rest:.0f} min left)", flush=True)  # fmt: skip
            yield trial


def limit(trial: Trial) -> int:
    """Its step limit."""
    return task(trial.task).levels[trial.level].steps


def replayed(trials: Iterable[Trial]) -> float:
    """Per cent of the replays that met the goal."""
    found = [trial.replayed for trial in trials]
    return 100 * sum(found) / len(found)


def share(trials: Iterable[Trial]) -> float:
    """Mean per cent of the step limit, every variant counted once."""
    some = grouped(trials).values()
    return mean(mean(100 * t.actions / limit(t) for t in trials) for trials in some)


def mean_actions(trials: Iterable[Trial]) -> float:
    """Mean number of recorded actions, every variant counted once."""
    return mean(mean(t.actions for t in some) for some in grouped(trials).values())


def grouped(trials: Iterable[Trial]) -> dict[Variant, list[Trial]]:
    """Trials by variant, in the catalog's order."""
    found: dict[Variant, list[Trial]] = {(name, n): [] for name in tasks() for n in LEVELS}
    for trial in trials:
        found[trial.task, trial.level].append(trial)
    return {variant: some for variant, some in found.items() if some}


COLUMNS = "category task level trials shown replayed actions limit share seconds"


def table(variants: dict[Variant, list[Trial]], path: Path) -> None:
    """Write one line a variant: COLUMNS."""
    with path.open("w", encoding="utf-8", newline="") as file:
        write = csv.writer(file, lineterminator="\n").writerow
        write(COLUMNS.split())
        for (name, level), some in variants.items():
            solved = (sum(t.shown for t in some), sum(t.replayed for t in some))
            length = (round(mean_actions(some)), limit(some[0]), f"{share(some):.0f}%")
            seconds = round(sum(t.seconds for t in some) / len(some), 1)
            write([task(name).category, name, level, len(some), *solved, *length, seconds])


def rows(trials: list[Trial]) -> tuple[Metric, ...]:
    """Figures with bars, then those of each category."""
    variants = grouped(trials)
    count, of = len(variants), f"of {len(variants)}"
    low = {v: replayed(some) for v, some in variants.items() if replayed(some) < REPLAYED}
    long = {v: share(some) for v, some in variants.items() if share(some) > SHARE}
    official = [t for t in trials if task(t.task).category not in BASIC]
    shown = sum(t.shown for t in trials)
    found = [
        Metric(f"variants with at least {REPLAYED:g} % of the replays successful",
            count - len(low), of, at_least=count, note=worst(low)),
        Metric(f"variants whose demonstrations take at most {SHARE:g} % of the step limit",
            count - len(long), of, at_least=count, note=worst(long)),
        Metric("replays that succeed", round(replayed(trials), 2), "%", at_least=REPLAYED,
            note=f"of {len(trials)}; so do {shown} of the demonstrations"),
    ]  # fmt: skip
    if official:
        found.append(Metric("actions of a demonstration, mean of the 280 variants",
            round(mean_actions(official)), note=f"official data: {OFFICIAL_FRAMES}"))  # fmt: skip
    for category in (*CATEGORIES, *BASIC):
        some = [t for t in trials if task(t.task).category == category]
        if some:
            most = max(share(v) for v in variants.values() if v[0] in some)
            note = f"{mean_actions(some):.0f} actions, {share(some):.0f} % of the step limit"
            found.append(Metric(f"{category}: replays that succeed", round(replayed(some), 1), "%",
                note=f"{note}, at most {most:.0f} % in a variant"))  # fmt: skip
    return tuple(found)


def worst(values: dict[Variant, float]) -> str:
    """The variants farthest from their bar."""
    ranked = sorted(values.items(), key=lambda item: -abs(item[1] - REPLAYED))[:WORST]
    return ", ".join(f"{name} {level}: {value:.0f} %" for (name, level), value in ranked)


TEXT = """An action is a recorded frame after the first. How many physics steps lie between two
frames is data (`harness/demonstrations/strides.py`); all variants are in
`benchmarks/results/demonstrations.csv`.
"""


def main() -> None:
    """Measure what was asked for and print."""
    parser = argument_parser(__doc__)
    parser.add_argument("--trials", type=int, default=1)
    parser.add_argument("--first", type=int, default=950_000)
    parser.add_argument("--tasks", default="", help="names, with commas between; default: all")
    parser.add_argument("--levels", default="1,2,3,4,5")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--trials-file", type=Path, default=Path("build/demonstrations.jsonl"))
    parser.add_argument("--report", action="store_true", help="only what the file holds")
    options = parser.parse_args()
    names = [task(n).name for n in options.tasks.split(",")] if options.tasks else list(tasks())
    levels = [int(level) for level in options.levels.split(",")]
    seeds = range(options.first, options.first + options.trials)
    keys = [(name, level, seed) for seed in seeds for name in names for level in levels]
    known = known_trials(options.trials_file) if options.report else None
    found = known or measured(keys, options.trials_file, options.workers)
    trials = [trial for trial in found if trial.end != UNSTABLE]
    if options.json is not None:
        table(grouped(trials), RESULTS / "demonstrations.csv")
    finish(Result("demonstrations", "Demonstrations", rows(trials), text=TEXT), options)


if __name__ == "__main__":
    main()
