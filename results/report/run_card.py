"""A run on a card (what was evaluated, with what, where, how its trials ended), and its scores as
one table with what is to be said below it: on a terminal and in a notebook."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from html import escape
from itertools import compress

from msgspec import to_builtins

from robospa.results.failures.labels import NAMES, failures_of
from robospa.results.paper.origin import SPLITS
from robospa.results.paper.rounding import OVERALL, shown
from robospa.results.records.action_problems import grouped, problem_lines
from robospa.results.records.manifest import RunAbout, departures
from robospa.results.records.runs import (
    TRIALS,
    Run,
    by_setting,
    finished,
    setting_name,
    setting_parts,
)
from robospa.results.records.trial_record import PROCESSOR
from robospa.results.scoring import repeats
from robospa.results.scoring.comparable import comparable_table
from robospa.results.scoring.first_choice import after_others
from robospa.results.scoring.grounding import grounding_table
from robospa.results.scoring.models import ModelResults
from robospa.results.scoring.scores import (
    IDLE,
    AverageScore,
    Scores,
    VariantScore,
    level_name,
    score_run,
)
from robospa.results.scoring.usage import usage_line, usage_table
from robospa.results.statistics.intervals import Estimate
from robospa.results.tables import (
    MISSING,
    Table,
    TableCell,
    TableRow,
    estimate_cell,
    html_fragment,
    show,
)
from robospa.text import counted, plain_console, some
from robospa.trial import BASIC, CATEGORIES, CATEGORY_NAMES, DIMENSIONS, REFERENCE

END_NAMES = {
    "success": "success",
    "step_limit": "step limit",
    "done": "said done",
    "time_limit": "time limit",
    "policy_error": "policy error",
    "goal_lost": "goal lost",
    "infrastructure": "missing",
}
SPOKEN = {"heldout": "held-out"}
NOT_RUN, STILL_TO_RUN = "not run", "still to run"
ACTIONS = {"action": "", "horizon": "chunks of at most ", "execute": "executed of each: "}
"""Fields of the spec about actions, and the words before each."""


def names_of(runs: Sequence[Run]) -> list[str]:
    """A name for every run: its policy's, where two would be equal with what they differ in of
    their settings, and then with their folder."""
    names = [run.manifest.policy.name or "unknown" for run in runs]
    settings = [setting_parts(run) for run in runs]
    differ = [len(set(values)) > 1 for values in zip(*settings, strict=True)]
    told = [", ".join(filter(None, compress(parts, differ))) for parts in settings]
    for extra in (told, [run.folder.name for run in runs]):
        names = [
            f"{name} ({text})" if text and _differ(names, extra, name) else name
            for name, text in zip(names, extra, strict=True)
        ]
    for place in range(len(names)):
        while names[place] in names[:place]:
            names[place] += "'"
    return names


def _differ(names: Sequence[str], extra: Sequence[str], name: str) -> bool:
    """Whether several of `names` are `name`, and what is `extra` tells some of them apart."""
    return len({text for other, text in zip(names, extra, strict=True) if other == name}) > 1


def headline(runs: Sequence[Run]) -> str:
    """When and on what `runs` were made, in a line."""
    made = sorted({max([p.stat().st_mtime for p in (run.folder / TRIALS).glob("*.jsonl")] or [0])
                   for run in runs} - {0})  # fmt: skip
    days = [datetime.fromtimestamp(time, UTC).strftime("%-d %B %Y") for time in made]
    cut = [run.manifest.settings for run in runs]
    tasks = len({key.task for run in runs for key in run.keys})
    parts = (
        " to ".join(dict.fromkeys((*days[:1], *days[-1:]))),
        "suite " + some(sorted({run.manifest.suite for run in runs})),
        ", ".join(dict.fromkeys(name for one in cut for name in one.embodiment)),
        some(list(dict.fromkeys(mode for one in cut for mode in one.mode))) + " scenes",
        some(list(dict.fromkeys(SPOKEN.get(s, s) for one in cut for s in one.split)))
        + " sentences",
        f"{sum(len(run.keys) for run in runs):,} trials of {counted(tasks, 'task')}",
    )
    return " · ".join(part for part in parts if part)


def about(run: Run) -> dict[str, object]:
    """The facts of the manifest that a reader needs."""
    manifest, data = run.manifest, run.manifest.to_json()
    settings, about = manifest.settings, to_builtins(manifest.about)
    return {
        "policy": manifest.policy.name or "unknown",
        "privileged": settings.privileged,
        "needs_trial_key": settings.needs_trial_key,
        "profile": settings.profile,
        "seeded": bool(manifest.policy.seeded),
        "spec": settings.policy.spec,
        "trials": len(run.keys),
        "results": len(run.keys) - len(run.without_result),
        "missing": len(run.missing),
        "to_run": len(run.waiting),
        "settings": data["settings"],
        "seed_hash": manifest.seed_hash,
        **{name: about[name] for name in ("versions", "git", "machine", "world")},
    }


def ends(run: Run) -> dict[str, int]:
    """Number of trials by end; trials that were never run count as "not run"."""
    not_run = STILL_TO_RUN if run.in_progress else NOT_RUN
    records = map(run.records.get, run.keys)
    counts = Counter(not_run if r is None else END_NAMES[r.end] for r in records)
    return dict(counts.most_common())


def timing(run: Run) -> dict[str, float]:
    """Share of the trials' wall time by purpose."""
    total = sum(r.wall_time for r in run.records.values())
    sums: dict[str, float] = {}
    for record in run.records.values():
        for name, seconds in record.timing.items():
            if name != PROCESSOR:
                sums[name] = sums.get(name, 0.0) + seconds
    longest = sorted(sums.items(), key=lambda part: -part[1])
    return {name: seconds / total for name, seconds in longest} if total else {}


def facts(run: Run) -> list[tuple[str, str]]:
    """The run's card, as name and text; facts that are not known are left out."""
    manifest, about = run.manifest, run.manifest.about
    settings, policy = manifest.settings, manifest.policy
    spec, errors = settings.policy.spec, repeats.policy_errors(run)
    seeded = "honours the trial's policy seed" if policy.seeded else "ignores the policy seed"
    cameras = ", ".join(str(c.get("name", c)) if isinstance(c, Mapping) else c
                        for c in policy.cameras) or "no camera"  # fmt: skip
    found = [
        ("policy", policy.name or "unknown"),
        ("sees", "the exact state" if settings.privileged else f"observations: {cameras}"),
        ("actions", ", ".join(f"{words}{spec[n]}" for n, words in ACTIONS.items() if spec.get(n))),
        ("seeding", f"{seeded}; the run's is {str(settings.run_seed)[:8]}" if spec else ""),
        ("trials", _trials(run)),
        ("ends", ", ".join(f"{count} {name}" for name, count in ends(run).items())),
        ("not executed as sent", "; ".join(problem_lines(run.records.values()))),
        ("setting", ", ".join(" ".join(x) for x in
                           (settings.embodiment, settings.mode, settings.split) if x)),
        ("beside the paper", ", ".join(f"sentences of {split} are {SPLITS[split]}"
                                    for split in settings.split if split in SPLITS)),
        ("suite", manifest.suite),
        ("departures", "; ".join(map(str, departures(manifest)))),
        ("list of trials", f"hash {manifest.seed_hash}" if manifest.seed_hash else ""),
        ("software", _software(about)),
        ("machine", _pairs(about.machine)),
        ("processor", "; ".join(map(str, about.processors))),
        ("world", _pairs(about.world)),
        ("policy latency", _latency(run)),
        ("time spent on", ", ".join(f"{name} {100 * share:.0f} %" for name, share in
                                 timing(run).items() if share >= 0.005)),
        ("policy errors", "; ".join([repeats.error_rates_text(run)] * bool(errors) +
                                    [f"{n} {why}" for n, why in errors])),
        ("repeated trials", repeats.repeats_text(run)),
    ]  # fmt: skip
    return [(name, text) for name, text in found if text]


def _trials(run: Run) -> str:
    text = f"{len(run.keys) - len(run.without_result)} of {len(run.keys)} with a result"
    return f"{text}, {len(run.waiting)} still to run" if run.waiting else text


def _software(about: RunAbout) -> str:
    parts = [f"{name} {version}" for name, version in about.versions.items()]
    if about.git and about.git.commit:
        parts.append(f"commit {about.git.commit[:12]}" + " with changes" * about.git.dirty)
    return ", ".join(parts)


def _latency(run: Run) -> str:
    """How long the policy took to answer: the median of the trials' p50, the largest p99 and of
    all; the means in its model and queue and of the size of a batch where its server tells them."""
    found = [r.latency for r in run.records.values() if r.latency]
    if not found:
        return ""
    middle = sorted(x["p50"] for x in found)[len(found) // 2]
    p99, most = (max(x[name] for x in found) for name in ("p99", "max"))
    means = {
        name: sum(values) / len(values)
        for name in ("queue", "infer", "batch")
        if (values := [x[name] for x in found if name in x])
    }
    text = f"median {middle:.1f} ms, p99 {p99:.1f} ms, most {most:.1f} ms"
    if "queue" in means and "infer" in means:
        text += f"; {means['infer']:.1f} ms in the model, {means['queue']:.1f} ms in its queue"
    if means.get("batch", 1.0) > 1.0:
        text += f"; {means['batch']:.1f} observations a call"
    return text


def _pairs(values: Mapping[str, object]) -> str:
    return ", ".join(f"{name} {_line(v)}" for name, v in values.items() if v not in (None, "", {}))


def _line(value: object) -> str:
    """`value` as text without line breaks; of a mapping or a list, its values."""
    if isinstance(value, Mapping):
        value = list(value.values())
    if isinstance(value, (list, tuple)):
        return " ".join(dict.fromkeys(_line(v) for v in value if v is not None))
    return " ".join(str(value).split())


# what its scores are, as one table


def missing_lines(scores: Scores) -> list[str]:
    """One sentence for every variant that lacks trials."""
    lines = []
    for cell in scores.cells.values():
        ends = zip(*(cell.bounds(metric) or (0.0, 1.0) for metric in ("sr", "sr1")), strict=True)
        worst, best = ([f"{shown(100 * x):.1f}" for x in side] for side in ends)
        text = (
            f"{cell.task} L{cell.level}: {cell.missing} of {cell.listed} trials are missing; if "
            f"all had failed SR would be {worst[0]} and SR@1 {worst[1]}, if all had succeeded "
            f"{best[0]} and {best[1]}"
        )
        lines += [text] * bool(cell.missing)
    return lines


def loss_lines(run: Run) -> list[str]:
    """The reasons for missing trials, one sentence a reason, the most frequent first."""
    records = [run.records.get(key) for key in run.missing]
    reasons = ["not run yet" if r is None else r.message for r in records]
    return [f"missing {count}: {reason}" for count, reason in grouped(reasons)]


def percent(estimate: Estimate | None) -> str:
    """`12.0 [5.6, 23.8]`, or a dash."""
    return estimate_cell(estimate).text


def short(estimate: Estimate | None) -> str:
    """The value alone."""
    return percent(estimate).partition(" ")[0]


def rows(scores: Scores) -> list[tuple[str, str]]:
    """(row, label) of tasks by category, then categories, dimensions and the overall value; basic
    grounding comes last among tasks, and its categories after all else: they enter no average.

    Without categories if each would repeat its task.
    """
    category = scores.category_of
    made = [(t, f"{category[t]} {t.replace('_', ' ')}") for t in scores.tasks_by_category]
    several = len(made) > len(set(category.values()))
    categories = [(c, f"{c} {CATEGORY_NAMES[c]}") for c in CATEGORIES + BASIC if several]
    made += [row for row in categories if row[0] in CATEGORIES]
    made += [*((d, f"{d} categories") for d in DIMENSIONS), (OVERALL, OVERALL)]
    made += [row for row in categories if row[0] in BASIC]
    return [row for row in made if scores.part(row[0], 0)]


TAIL = ("SR [95 %]", "SR@1 [95 %]", "ONTA", "ONTA@1", "PS", "idle PS", "trials")
"""Heads of what is told of the mean over levels."""


def score_table(run: Run, scores: Scores) -> Table:
    """The success rates of `run` by level, with the metrics of the mean over levels that it has.

    Its title has the robot and the scene mode where they are not the benchmark's usual ones."""
    departs = "".join(f" ({one})" for one in departures(run.manifest))
    name = setting_name(run)
    where = f", {name}" * (name != REFERENCE)
    title = f"{run.manifest.policy.name or 'policy'}{departs}{where}"
    heads = (*map(level_name, scores.levels), *TAIL)
    lines = [_table_row(scores, *row) for row in rows(scores)]
    filled = [any(line.cells[i].text for line in lines) for i in range(len(heads))]
    lines = [replace(line, cells=tuple(compress(line.cells, filled))) for line in lines]
    return Table("scores", title, "", tuple(compress(heads, filled)), tuple(lines))


def _table_row(scores: Scores, row: str, label: str) -> TableRow:
    cells = [_level_cell(scores.part(row, level)) for level in scores.levels]
    mean = scores.part(row, 0)
    assert mean is not None, "rows have a mean"
    lost = f" -{mean.missing}" if mean.missing else ""
    tail = [percent(mean.values.get(metric)) for metric in ("sr", "sr1")]
    others = ("onta", "onta1", "ps", IDLE)
    tail += [short(mean.values[m]) if m in mean.values else "" for m in others]
    kind = "row" if row in scores.category_of else "average"
    return TableRow(label, (*cells, *map(TableCell, (*tail, f"{mean.trials}{lost}"))), kind)


def _level_cell(part: VariantScore | AverageScore | None) -> TableCell:
    if part is None:
        return TableCell()
    return TableCell(short(part.values.get("sr")), sign=MISSING * bool(part.missing))


BESIDE = (grounding_table, comparable_table, usage_table)
"""Tables that a report has beside the paper's."""


def print_scores(run: Run, results: ModelResults, beside: bool = True) -> None:
    """Print the scores of `run` on the terminal: how its trials ended, why some are missing, are
    policy errors or were repeated, which actions could not be executed as they were sent; `beside`:
    the smaller tables, too."""
    scores = results.scores
    for table in (score_table(run, scores), *(of([results]) for of in BESIDE if beside)):
        if table is not None:
            show(table)
    console = plain_console(wide=130)
    note = f" ({MISSING} lacks trials)" if run.missing else ""
    console.print(_ends_line(run) + note, style="dim", soft_wrap=True)
    if used := usage_line(run.records.values()):
        console.print(f"used: {used}", style="dim", soft_wrap=True)
    lines = [*missing_lines(scores), *loss_lines(run), *repeats.policy_error_lines(run)]
    odd = after_others([r for r in run.records.values() if finished(r)])
    lines += [*[odd] * bool(odd), *repeats.repeat_lines(run), *problem_lines(run.records.values())]
    for line in lines:
        console.print(line, style="yellow", soft_wrap=True)


def _ends_line(run: Run) -> str:
    counts = ", ".join(f"{count} {name}" for name, count in ends(run).items())
    return f"{counted(len(run.keys), 'trial')}: {counts}"


def run_table(run: Run) -> Table:
    """The scores of `run`, and below them why trials ended in policy errors and what could not be
    executed as sent; of several robots, scene modes or splits a section each."""
    table = _scores(run)
    return replace(table, notes=(*table.notes, *_hindrances(run)))


def _scores(run: Run) -> Table:
    parts = by_setting(run)
    tables = [score_table(part, score_run(part)) for part in parts]
    if len(tables) == 1:
        return tables[0]
    found = {head for table in tables for head in table.heads}
    heads = (*sorted(found.difference(TAIL)), *(head for head in TAIL if head in found))
    rows: list[TableRow] = []
    for part, table in zip(parts, tables, strict=True):
        rows.append(TableRow(setting_name(part), kind="section"))
        rows += [_spread(row, table.heads, heads) for row in table.rows]
    title = run.manifest.policy.name or "policy"
    return replace(tables[0], title=title, heads=heads, rows=tuple(rows))


def _spread(row: TableRow, heads: tuple[str, ...], wanted: tuple[str, ...]) -> TableRow:
    """`row` with its cells below the columns `wanted`, empty where it has none."""
    cells = dict(zip(heads, row.cells, strict=True))
    return replace(row, cells=tuple(cells.get(head, TableCell()) for head in wanted))


def run_html(run: Run) -> str:
    """Scores, how trials ended, types of failure, and what was executed otherwise than sent."""
    kinds = Counter(NAMES[f.kind] for f in failures_of(run.records.values()).values())
    found = ", ".join(f"{count} {name}" for name, count in kinds.most_common())
    failures = [f"failures: {found}"] if found else []
    lines = [_ends_line(run), *failures, *_hindrances(run)]
    lines.append(f"folder: {run.folder}")
    notes = "<br>".join(escape(line) for line in lines)
    return f"{html_fragment(_scores(run))}\n<p>{notes}</p>"


def _hindrances(run: Run) -> list[str]:
    return [*repeats.policy_error_lines(run), *problem_lines(run.records.values())]
