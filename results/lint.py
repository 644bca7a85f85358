"""Checks of a run or a table of results for values that cannot be right, without running anything.

Numbers that cannot be (progress below success), numbers
that are too alike to be true (one row under two tasks, one sequence of actions for two seeds), and
what a reader must know before averaging (trials missing, listed twice, from mixed settings or
versions). An error makes numbers wrong, a warning asks for a look, a note says what nobody checked.
No finding proves a run right.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

from robospa.results.paper.published import load
from robospa.results.paper.rounding import rounded
from robospa.results.records.action_problems import (
    OFTEN,
    grouped,
    problem_counts,
    truncated_instructions,
)
from robospa.results.records.manifest import LIMITS, REAL_TIME, departures
from robospa.results.records.runs import Run, finished, lost_actions
from robospa.results.records.trial_record import INTERRUPTED, TrialRecord
from robospa.results.scoring import repeats
from robospa.results.scoring.first_choice import after_others
from robospa.text import counted, some
from robospa.trial import PROCEDURAL

FASTEST_STEP = 4e-6
"""Wall time of a physics step [s] that no machine known to us beats: 1000 times real time. Arms
that stand still among sleeping objects take 16 us on two cores of 2026."""
LINTED = {LIMITS: "warning", REAL_TIME: "note"}
"""Departures that a finding names, with its severity."""
INFORMATIVE, NEARLY_ALL = 3, 0.95
"""Rows with fewer different numbers between zero and nearly all may well agree by chance."""


def lint_published() -> list[Finding]:
    """What is odd about the paper's per-task tables; `paper.check` says what does not follow."""
    data, found = load(), []
    for model in data.models:
        rows: dict[str, Row] = {}
        for task, rates in data.per_task[model, "sr"].rows.items():
            progress = data.per_task[model, "ps"].rows.get(task, ())
            other = progress or data.per_task[model, "onta"].rows[task]
            rows[task] = (), (*rates, *other)
            counts = zip(progress, data.tasks[task].counts, strict=False)
            for level, (ps, total) in enumerate(counts, 1):
                if not _possible(ps, data.trials * total):
                    text = f"PS {ps:g} is no multiple of 1/{total} over {data.trials} trials"
                    where = f"{model}, {task} L{level}"
                    found.append(Finding("ps-not-a-share", "error", where, text))
        found += lint_rows(model, rows, 100.0)
    return found


Row = tuple[tuple[int, ...], tuple[float, ...]]
"""A task's levels with their numbers of trials, and its results there."""


def lint_rows(name: str, rows: Mapping[str, Row], whole: float = 1.0) -> list[Finding]:
    """Findings in results by task, of at most `whole`: rows that repeat each other."""
    same: dict[Row, list[str]] = defaultdict(list)
    for task, row in rows.items():
        if len({x for x in row[1] if 0 < x < NEARLY_ALL * whole}) >= INFORMATIVE:
            same[row].append(task)
    return [
        Finding(
            *("identical-rows", "error", name),
            f"{' and '.join(tasks)} have the same results at every level",
        )
        for tasks in same.values()
        if len(tasks) > 1
    ]


def _possible(percent: float, parts: int) -> bool:
    near = round(percent * parts / 100)
    return any(abs(rounded(100 * n / parts) - percent) < 1e-6 for n in range(near - 1, near + 2))


def lint_run(run: Run, variants: Collection[tuple[str, int]] | None = None) -> list[Finding]:
    """Findings in one run; `variants` are those that exist, if the caller knows."""
    name = run.folder.name
    results = [r for r in run.records.values() if finished(r)]
    found = [*_lint_listing(run, name, variants), *_lint_files(run, name), *_lint_limits(run, name)]
    found += _lint_actions(results, name)
    found += lint_faults(results, name)
    if text := after_others(results):
        found.append(Finding("after-other-choices", "warning", name, text))
    groups: dict[tuple[str, int], list[TrialRecord]] = defaultdict(list)
    for record in results:
        groups[record.key.variant].append(record)
    for (task, level), records in groups.items():
        found += _lint_variant(f"{name}, {task} L{level}", records)
    found += lint_rows(name, run_rows(groups))
    return found + list(_repeats(name, groups, run.manifest.settings.privileged))


def lint_actions(run: Run) -> list[Finding]:
    """Finished trials in the run's folder whose actions are not there, so that none can replay
    them. A bundle has its own place for actions."""
    lost = lost_actions(run.folder, run.records)
    return [Finding("lost-actions", "error", run.folder.name, text) for text in lost]


def lint_runs(runs: Sequence[Run]) -> list[Finding]:
    """Reasons why several runs cannot stand in one table."""
    found: list[Finding] = []
    for title, read in (
        ("code", lambda r: r.manifest.about.code),
        ("versions", lambda r: r.manifest.about.versions),
        ("list of trials", lambda r: r.manifest.seed_hash),
        ("embodiments", lambda r: sorted({k.embodiment for k in r.keys})),
        ("scene modes", lambda r: sorted({k.mode for k in r.keys})),
        ("instruction splits", lambda r: sorted({k.split for k in r.keys})),
        ("step limits", lambda r: r.manifest.settings.step_scale),
        ("clocks", lambda r: r.manifest.clock),
        ("tracks", lambda r: r.manifest.tracks),
    ):
        if len({repr(read(run)) for run in runs}) > 1:
            names = ", ".join(run.folder.name for run in runs)
            rule = "mixed-versions" if title in ("code", "versions") else "mixed-suites"
            text = f"they differ in their {title}: not for one table"
            found.append(Finding(rule, "warning", names, text))
    return found


def run_rows(groups: Mapping[tuple[str, int], Sequence[TrialRecord]]) -> dict[str, Row]:
    """The success rates and, of procedures, the progress of every task."""
    rows: dict[str, Row] = {}
    for (task, level), records in sorted(groups.items()):
        sizes, numbers = rows.get(task, ((), ()))
        rates = [sum(r.success for r in records) / len(records)]
        if all(r.category in PROCEDURAL and r.total for r in records):
            rates.append(sum(r.done / r.total for r in records) / len(records))
        rows[task] = (*sizes, level, len(records)), (*numbers, *rates)
    return rows


def _lint_listing(
    run: Run, name: str, variants: Collection[tuple[str, int]] | None
) -> Iterator[Finding]:
    listed = Counter(run.keys)
    twice = [key.slug for key, count in listed.items() if count > 1]
    if twice:
        text = f"{some(twice)} listed twice: each would count double"
        yield Finding("listed-twice", "error", name, text)
    if unlisted := [key.slug for key in run.records if key not in listed]:
        text = f"{some(unlisted)} recorded but not in the run's list"
        yield Finding("not-listed", "error", name, text)
    if variants is not None:
        unknown = [
            f"{t} L{n}" for t, n in {k.variant: 0 for k in run.keys} if (t, n) not in variants
        ]
        if unknown:
            text = f"{some(unknown)} not among the benchmark's variants"
            yield Finding("unknown-variant", "error", name, text)
    if missing := [key.slug for key in dict.fromkeys(run.missing)]:
        text = f"{len(missing)} of {len(listed)} trials have no result: {some(missing)}"
        yield Finding("missing", "warning", name, text)
    sizes = Counter(key.variant for key in listed)
    if len(set(sizes.values())) > 1:
        low, high = min(sizes.values()), max(sizes.values())
        text = f"variants have between {low} and {high} trials: their intervals differ in width"
        yield Finding("unequal-trials", "warning", name, text)
    for what in ("embodiment", "mode", "split"):
        if len(values := sorted({getattr(key, what) for key in run.keys})) > 1:
            text = f"holds {what}s {' and '.join(values)}: scores are of each alone"
            yield Finding("mixed-suites", "note", name, text)


def _lint_limits(run: Run, name: str) -> Iterator[Finding]:
    for one in departures(run.manifest):
        if one.name in LINTED:
            text = f"{one}: not the benchmark's numbers"
            yield Finding(one.name.replace(" ", "-"), LINTED[one.name], name, text)
    if unknown := [server for server, named in run.manifest.servers.items() if not named]:
        text = f"nothing says which checkpoint was served at {some(unknown)}"
        yield Finding("unknown-checkpoint", "note", name, text)
    if (drivers := run.manifest.about.drivers) > 1:
        cut = sum(x.cause == INTERRUPTED for r in run.records.values() for x in r.retries)
        text = f"{drivers} drivers ran it in turn, whose ends cut off {counted(cut, 'attempt')}"
        yield Finding("drivers", "note", name, text)


def _lint_actions(results: Sequence[TrialRecord], name: str) -> Iterator[Finding]:
    for one in problem_counts(results):
        if one.often:
            yield Finding(one.kind.name.replace("_", "-"), "warning", name, str(one))
    cut = truncated_instructions(results)
    if results and cut >= OFTEN * len(results):
        text = f"{cut} of {len(results)} trials have an instruction longer than the policy reads"
        yield Finding("truncated-instructions", "warning", name, text)


def _lint_files(run: Run, name: str) -> Iterator[Finding]:
    for file in run.torn:
        text = f"the last line of {file} was torn off: its trial has to be run again"
        yield Finding("torn-line", "warning", name, text)
    if run.repeated:
        text = f"{some([k.slug for k in run.repeated])} recorded more than once (the records agree)"
        yield Finding("recorded-twice", "warning", name, text)


def _lint_variant(where: str, records: Sequence[TrialRecord]) -> Iterator[Finding]:
    for rule, what, names in (
        ("mixed-totals", "number of subtasks", {str(r.total) for r in records}),
        ("mixed-categories", "category", {r.category for r in records}),
    ):
        if len(names) > 1:
            text = f"trials differ in their {what}: {' and '.join(sorted(names))}"
            yield Finding(rule, "error", where, text)
    if len(candidates := sorted({r.candidates for r in records})) > 1:
        text = f"trials have between {candidates[0]} and {candidates[-1]} candidates: no ONTA"
        yield Finding("mixed-candidates", "warning", where, text)
    tests: tuple[tuple[str, str, Callable[[TrialRecord], bool]], ...] = (
        ("progress-range", "more done than there is", lambda r: not 0 <= r.done <= r.total),
        ("ps-below-sr", "success without full progress", lambda r: r.success and r.done < r.total),
        (
            "end-and-success",
            "end and success disagree",
            lambda r: r.success != (r.end == "success"),
        ),
        (
            "too-fast",
            "faster than physics can be simulated",
            lambda r: r.wall_time < r.physics_steps * FASTEST_STEP,
        ),
        (
            "fewer-steps",
            "fewer physics steps than actions",  # of which a refused one took none
            lambda r: r.physics_steps < r.steps - (r.end == "policy_error"),
        ),
    )
    for rule, words, wrong in tests:
        if seeds := [f"seed {r.key.seed}" for r in records if wrong(r)]:
            yield Finding(rule, "error", where, f"{words}: {some(seeds)}")
    scenes: dict[str, set[int]] = defaultdict(set)
    for record in records:
        scenes[record.scene_digest].add(record.key.seed)
    for digest, alike in scenes.items():
        if digest and len(alike) > 1:
            text = f"one scene under {some([f'seed {seed}' for seed in sorted(alike)])}"
            yield Finding("same-scene", "error", where, text)


def _repeats(
    name: str, groups: Mapping[tuple[str, int], Sequence[TrialRecord]], privileged: bool
) -> Iterator[Finding]:
    """Different scenes of one variant with the same final state, or else with the same actions.

    Variants may share layouts, and then a deterministic policy acts alike; the seeds of one variant
    do not. A policy with privileged access is scripted, and may repeat itself.
    """
    ends = _shared(groups, lambda r: r.digest)
    if ends:
        text = f"{ends[0]} trials end in the state of another scene, {ends[1]}"
        yield Finding("same-end-state", "warning", name, f"{text}: were records copied?")
    elif not privileged and (
        acts := _shared(groups, lambda r: r.actions_digest if r.steps else "")
    ):
        text = f"{acts[0]} trials have the actions of another scene, {acts[1]}"
        yield Finding("same-actions", "warning", name, f"{text}: does the policy use its images?")


def _shared(
    groups: Mapping[tuple[str, int], Sequence[TrialRecord]], value: Callable[[TrialRecord], str]
) -> tuple[int, str] | None:
    """How many trials have a value in common with another of their variant, and two of them."""
    count, example = 0, ""
    for (task, level), records in groups.items():
        seeds: dict[str, set[int]] = defaultdict(set)
        for record in records:
            if found := value(record):
                seeds[found].add(record.key.seed)
        for alike in seeds.values():
            if len(alike) > 1:
                count += len(alike)
                first, second = sorted(alike)[:2]
                example = example or f"such as {task} L{level} seeds {first} and {second}"
    return (count, example) if count else None


SEVERITIES = ("error", "warning", "note")
"""From wrong numbers to what a reader may want to know."""


@dataclass(frozen=True)
class Finding:
    """One thing found: `rule` is its short name, `severity` is one of SEVERITIES."""

    rule: str
    severity: str
    where: str
    text: str

    def __str__(self) -> str:
        return f"{self.severity}: {self.where}: {self.text} [{self.rule}]"


MANY_ERRORS = 0.05
"""Share of policy errors that asks for a look."""


def lint_faults(results: Sequence[TrialRecord], name: str) -> Iterator[Finding]:
    """Findings in the `results` of the run called `name`."""
    whole, *levels = repeats.fault_rates(results)
    bad = [rate for rate in (whole, *levels) if rate.too_many]
    for rate in bad:
        most = repeats.MOST_AT_LEVEL if rate.level else repeats.MOST_REPEATED
        text = (
            f"{_counted(rate)}, more than {100 * most:g} % (or {repeats.FEW}): each had another "
            "chance after a fault that its policy may have caused"
        )
        yield Finding("repeated-trials", "error", name, text)
    if not bad and whole.repeated > repeats.NOTED * whole.results:
        text = f"{_counted(whole)}: each had another chance after a fault"
        yield Finding("repeated-trials", "warning", name, text)
    if whole.policy_errors > MANY_ERRORS * whole.results:
        errors = [record.message for record in results if record.end == "policy_error"]
        count, reason = grouped(errors)[0]
        text = (
            f"{len(errors)} of {len(results)} trials ended in a policy error, {count} of them: "
            f"{reason}"
        )
        yield Finding("policy-errors", "warning", name, text)


def _counted(rate: repeats.FaultRate) -> str:
    where = f" at level {rate.level}" if rate.level else ""
    return f"{rate.repeated} of {rate.results} trials{where} were repeated"
