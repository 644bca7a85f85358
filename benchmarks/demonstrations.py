"""Recorded demonstrations: do replays meet the goal, and what does one cost?

    python benchmarks/demonstrations.py demonstrations [--trials 1] [--names TASK,..] [--json]
    python benchmarks/demonstrations.py collecting [--json]

`demonstrations` records the expert on seeds of every variant that no list has, without pictures,
and replays one recorded action a step, by the official rule and within the official step limit;
`--json` also writes a line a variant to benchmarks/results/demonstrations.csv. `collecting` makes
episodes as a worker of `robospa collect` does, with three films, of two tasks of each category at
three levels: all 280 variants cost what the frames of their demonstrations (the CSV) say. Trials
are kept in build/NAME.jsonl as they are done: stopped anywhere, the same command goes on there.
"""

from __future__ import annotations

import csv
from collections.abc import Iterable, Iterator
from functools import cache
from pathlib import Path
from statistics import mean
from types import SimpleNamespace

from frame import RESULTS, Figure, Json, Result, gather, main

from robospa.harness.datasets.maker import EpisodeMaker
from robospa.harness.datasets.workers import EpisodeJob, attempt_job
from robospa.harness.demonstrations.demonstration import DemonstrationWorld, replay, show
from robospa.harness.demonstrations.recorder import FrameRecorder, frame_steps
from robospa.harness.selection import parse_levels, parse_tasks
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.world import SceneUnstable
from robospa.observation import DEFAULT_CAMERAS
from robospa.tasks.catalog import LEVELS, task, tasks
from robospa.trial import BASIC, CATEGORIES, TrialKey

SUCCEEDED = 95.0
SHARE = 85.0
OFFICIAL_FRAMES = 205
"""Mean of the official data: 108 million time steps in 527 thousand trajectories (the paper)."""
EPISODES = 50
"""Of each variant, as in the paper's experiments."""
TABLE = RESULTS / "demonstrations.csv"
Found = SimpleNamespace
Variant = tuple[str, int]


def made(name: str, level: int, seed: int) -> Json:
    """Make one demonstration and replay it."""
    key = TrialKey(name, level, seed, split="train")
    recorder, world = FrameRecorder(frame_steps(name)), DemonstrationWorld(render=False)
    try:
        shown = show(world, key, recorder)
    except SceneUnstable as error:
        return {"valid": False, "problem": str(error)}
    finally:
        world.close()
    world = SapienWorld(render=False)
    again = replay(world, key, recorder.commanded, shown.prefix_action, shown.kind)
    world.close()
    return {
        "valid": True,
        "shown": shown.demonstration.success,
        "replayed": again.success,
        "actions": len(recorder.commanded) - 1,
        "problem": " ".join(shown.demonstration.failures),
        "simulated": round(shown.demonstration.seconds, 2),
    }


def per_cent(found: Iterable[bool]) -> float:
    """Per cent of them that are true."""
    values = list(found)
    return round(100 * sum(values) / len(values), 2)


# ---------------------------------------------------------------- replays of every variant


def demonstrations(
    trials: int = 1, first: int = 950_000, names: str = "all,basic", levels: str = "1-5",
    workers: int = 2,
) -> Result:  # fmt: skip
    """The expert's demonstrations, replayed."""
    seeds, chosen = range(first, first + trials), parse_tasks(names)
    jobs = [(name, n, seed) for seed in seeds for name in chosen for n in parse_levels(levels)]
    rows = gather(Path("build/demonstrations.jsonl"), jobs, made, workers)
    variants: dict[Variant, list[Found]] = {}
    for row in (row for row in rows if row.valid):
        row.share = 100 * row.actions / task(row.job[0]).levels[row.job[1]].steps
        variants.setdefault((row.job[0], row.job[1]), []).append(row)
    return Result(
        "Demonstrations",
        list(_overall(variants)),
        text="""\
An action is a recorded frame after the first; each task sets how many physics steps lie between two
frames. All variants are in `benchmarks/results/demonstrations.csv`.""",
        files={TABLE: _table(variants)},
    )


def _table(variants: dict[Variant, list[Found]]) -> str:
    """CSV, one line a variant."""
    lines = ["category,task,level,trials,shown,replayed,actions,limit,share,seconds"]
    for (name, level), some in variants.items():
        cells = (task(name).category, name, level, len(some), sum(t.shown for t in some))
        cells += (sum(t.replayed for t in some), round(mean(t.actions for t in some)))
        cells += (task(name).levels[level].steps, f"{mean(t.share for t in some):.0f}%")
        cells += (round(mean(t.simulated for t in some), 1),)
        lines.append(",".join(map(str, cells)))
    return "\n".join(lines) + "\n"


def _overall(variants: dict[Variant, list[Found]]) -> Iterator[Figure]:
    rows, count = [t for some in variants.values() for t in some], len(variants)
    solved = {v: per_cent(t.replayed for t in some) for v, some in variants.items()}
    share = {v: mean(t.share for t in some) for v, some in variants.items()}
    low = {v: value for v, value in solved.items() if value < SUCCEEDED}
    long = {v: value for v, value in share.items() if value > SHARE}
    for what, missed in (
        (f"variants with at least {SUCCEEDED:g} % of the replays successful", low),
        (f"variants whose demonstrations take at most {SHARE:g} % of the step limit", long),
    ):
        note = ", ".join(f"{name} {level}: {x:.0f} %" for (name, level), x in missed.items())
        yield Figure(what, count - len(missed), f"of {count}", at_least=count, note=note)
    note = f"of {len(rows)}; so do {sum(t.shown for t in rows)} of the demonstrations"
    solved_all = per_cent(t.replayed for t in rows)
    yield Figure("replays that succeed", solved_all, "%", at_least=SUCCEEDED, note=note)
    official = [mean(t.actions for t in some) for (name, _), some in variants.items()
                if task(name).category not in BASIC]  # fmt: skip
    if official:
        yield Figure("actions of a demonstration, mean of the 280 variants", round(mean(official)),
            note=f"official data: {OFFICIAL_FRAMES}")  # fmt: skip


# ---------------------------------------------------------------- what an episode costs


@cache
def warm_maker() -> EpisodeMaker:
    """A maker that has made an episode, which opened its renderer."""
    maker, key = EpisodeMaker(), TrialKey("Press_Stapler_Repeat", 1, 960_001, split="train")
    attempt_job(maker, EpisodeJob(key, DEFAULT_CAMERAS, "h264"))
    return maker


def collected(name: str, level: int, seed: int) -> Json:
    """One episode: frames, bytes and processor time [s] by purpose."""
    key = TrialKey(name, level, seed, split="train")
    found = attempt_job(warm_maker(), EpisodeJob(key, DEFAULT_CAMERAS, "h264"))
    times = {purpose: round(spent, 3) for purpose, spent in found.times.items()}
    return {"frames": found.frames, "size": len(found.data), "times": times,
            "reason": found.reason}  # fmt: skip


def collecting() -> Result:
    """The first and the last task of each category at three levels."""
    of = [[name for name, one in tasks().items() if one.category == c] for c in CATEGORIES]
    jobs = [
        (names[at], level, 960_000) for at in (0, -1) for level in LEVELS[2::-2] for names in of
    ]
    jobs += [(names[at], LEVELS[-1], 960_000) for at in (0, -1) for names in of]
    rows = gather(Path("build/collecting.jsonl"), jobs, collected)
    good = [row for row in rows if not row.reason]
    groups = {c: [row for row in good if task(row.job[0]).category == c] for c in CATEGORIES}
    groups = {category: some for category, some in groups.items() if some}
    with TABLE.open(encoding="utf-8") as file:
        lines = [row for row in csv.DictReader(file) if row["category"] in groups]
    frames = [(row["category"], float(row["actions"]) + 1) for row in lines]

    def whole(cost: dict[str, float]) -> float:
        """EPISODES of each variant, of a category's cost."""
        each = {c: cost[c] / sum(row.frames for row in some) for c, some in groups.items()}
        return sum(EPISODES * count * each[category] for category, count in frames)

    seconds = {c: sum(sum(row.times.values()) for row in some) for c, some in groups.items()}
    hours, count = whole(seconds) / 3600, EPISODES * len(frames)
    size = whole({c: sum(row.size for row in some) for c, some in groups.items()})
    spent = {p: sum(row.times[p] for row in good) for p in good[0].times}
    shares = ", ".join(f"{p} {100 * s / sum(spent.values()):.0f} %" for p, s in spent.items())
    figures = [
        Figure(f"{count} episodes, {EPISODES} of each variant", round(hours, 1), "core-hours",
            at_most=25.0, note=f"of the processor time {shares}"),
        Figure("their size", round(size / 1e9, 2), "GB", note="H.264, three cameras"),
        Figure("episodes an hour and core, mean of all variants", round(count / hours)),
        Figure("seeds that gave no episode", len(rows) - len(good), f"of {len(rows)}"),
    ]  # fmt: skip
    for category, some in groups.items():
        each = seconds[category] / len(some)
        count, size = (mean(getattr(row, name) for row in some) for name in ("frames", "size"))
        note = f"{count:.0f} frames, {size / 1e3:.0f} kB"
        figures.append(Figure(f"{category} episode", round(each, 1), "s", note=note))
    return Result(
        "Collecting demonstrations",
        figures,
        text="""\
Processor time of one worker after its first episode. *Pictures* are drawn and encoded; their cost
depends on what they show, not on their number of pixels.""",
    )


if __name__ == "__main__":
    main(demonstrations=demonstrations, collecting=collecting)
