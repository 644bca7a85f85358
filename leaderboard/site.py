"""The leaderboard as a folder of static pages that open from disk: no server, nothing loaded.

`index.html` has all values as JSON and one table with views, filters and ranks; every model has a
page, made by the code of `robospa report`. Two submissions on equal seeds are compared by a script
that is loaded when they are chosen. Names and texts are escaped by Jinja or become text nodes.
"""

import json
import shutil
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from statistics import NormalDist

from robospa.harness.running.atomic_file import replace_file
from robospa.leaderboard.agreement import CELL_LIE
from robospa.leaderboard.bundle import IN_REPOSITORY, BundleError
from robospa.leaderboard.entries import (
    BADGES,
    HOW_REPRODUCED,
    MEANINGS,
    Entry,
    all_entries,
    group,
    groups_of,
    page_values,
    ranks,
)
from robospa.leaderboard.submission import left_out, read_submissions
from robospa.leaderboard.verify import paired, results_of
from robospa.results.failures.labels import NAMES, SIMULATED_PER_FILM
from robospa.results.figures.draw import draw
from robospa.results.figures.series import COLOURS, Series
from robospa.results.paper.origin import DIFFERENCES, ORIGIN
from robospa.results.paper.published import load
from robospa.results.report.page import FIGURES, card, figure, render
from robospa.results.report.report import ReportTable, for_page, method_notes, report_tables
from robospa.results.report.trials import FailureCount, put
from robospa.results.scoring.grounding import Grounding, table_of
from robospa.results.scoring.models import ModelResults
from robospa.trial import CATEGORIES, CATEGORY_NAMES, DIMENSIONS, METRIC_NAMES

MARK = ".robospa-site"
"""A file that says a folder is ours to write over."""
FORMATS = ("svg",)
TRAINING = {"single": "one model per task", "multi": "one model for all", "unstated": "not stated"}
COMPARISONS = 1000
"""Ranks among so many models are corrected exactly; beyond, as for so many."""
Note = Callable[[str], None]


def build(home: Path, out: Path, note: Note = lambda text: None) -> Path:
    """Write the site of the submissions below `home` into `out`; returns its index.html.

    Raises BundleError for the first submission that is none, before anything is written.
    """
    entries = all_entries(read_submissions(home))
    for name, why in left_out(home).items():
        note(f"{name} is left out: {why}")
    return write_site(entries, out, note)


def write_site(entries: Sequence[Entry], out: Path, note: Note = lambda text: None) -> Path:
    """Write the pages of `entries` into `out`."""
    if out.exists() and not (out.is_dir() and ((out / MARK).exists() or not any(out.iterdir()))):
        raise BundleError(f"{out} holds other things than a leaderboard; choose another --out")
    out.mkdir(parents=True, exist_ok=True)
    replace_file(out / MARK, b"")
    slugs = {entry.slug for entry in entries}
    for old in (out / "models").glob("*"):
        if old.is_dir() and old.name not in slugs:
            shutil.rmtree(old)
    for number, entry in enumerate(entries, 1):
        note(f"{entry.name} ({number} of {len(entries)})")
        write_model(entry, out / "models" / entry.slug)
    write_pairs(pairs_of(entries), out, note)
    replace_file(out / "index.html", index_page(entries).encode())
    return out / "index.html"


def index_page(entries: Sequence[Entry]) -> str:
    """The leaderboard itself."""
    # how many standard errors a lead needs among 1, 2, ... comparisons (Bonferroni)
    most, normal = min(COMPARISONS, max(100, len(entries))), NormalDist()
    critical = [round(normal.inv_cdf(1 - 0.025 / many), 4) for many in range(1, most + 1)]
    return render(
        "site.html",
        title="RoboSPA leaderboard",
        entries=[{"slug": e.slug, "name": e.name, "badge": BADGES[e.badge]} for e in entries],
        origin=ORIGIN,
        badge_meanings=[(badge, name, MEANINGS[badge]) for badge, name in BADGES.items()],
        how_reproduced=HOW_REPRODUCED,
        suites=suites(entries),
        cell_lie=f"{100 * CELL_LIE:g}",
        data={
            "models": [model_data(entry) for entry in entries],
            "groups": [
                {"key": str(one), "title": one.title, "note": one.note}
                for one in groups_of(entries)
            ],
            "apart": {load().suite: f"The paper's suite has {DIFFERENCES}."},
            "rows": row_data(),
            "badges": BADGES,
            "training": TRAINING,
            "metrics": METRIC_NAMES,
            "pairs": [f"{one.slug}/{two.slug}" for one, two in pairs_of(entries)],
            "critical": critical,
        },
    )


def row_data() -> dict[str, dict[str, str]]:
    """All rows in their order: name, kind, and the category of tasks."""
    made = {"overall": {"name": "overall", "kind": "overall"}}
    made |= {d: {"name": d, "kind": "dimension"} for d in DIMENSIONS}
    made |= {c: {"name": f"{c} {CATEGORY_NAMES[c]}", "kind": "category"} for c in CATEGORIES}
    tasks = load().tasks.values()
    return made | {t.name: {"name": t.name, "kind": "task", "category": t.category} for t in tasks}


def model_data(entry: Entry) -> dict[str, object]:
    """An entry for the table's script; see `ranks`."""
    setting = entry.setting
    return {
        "id": entry.slug,
        "name": entry.name,
        "team": entry.team,
        "badge": entry.badge,
        "badges": list(entry.badges),
        "group": str(group(entry) or ""),
        "ranks": _by_row(ranks(entry)),
        "embodiment": setting.embodiment,
        "mode": setting.mode,
        "split": setting.split,
        "suite": setting.suite,
        "track": setting.track,
        "training": entry.training,
        "scenes": entry.scenes,
        "parameters": entry.parameters,
        "count": count_of(entry.parameters),
        "values": page_values(entry),
    }


def _by_row(cells: Sequence[str]) -> dict[str, str]:
    """`cells` ("ROW/LEVEL") as the digits of their levels by row."""
    rows: dict[str, str] = {}
    for row, _, level in (cell.rpartition("/") for cell in cells):
        rows[row] = rows.get(row, "") + level
    return rows


def count_of(text: str) -> float:
    """`3.3B` as a number; 0 if it is none."""
    size = {"k": 1e3, "M": 1e6, "B": 1e9}.get(text[-1:], 1)
    try:
        return size * float(text.rstrip("kMB"))
    except ValueError:
        return 0


def suites(entries: Sequence[Entry]) -> list[dict[str, object]]:
    """The history of the suite, newest first, with the number of models on each."""
    text = files("robospa.leaderboard").joinpath("suites.json").read_text(encoding="utf-8")
    known: list[dict[str, object]] = json.loads(text)
    made = [
        {**s, "models": sum(e.setting.suite == s["name"] for e in entries)} for s in reversed(known)
    ]
    published = sum("published" in e.badges for e in entries)
    origin = "The paper's own scenes and seeds, which are not published as a suite."
    return [*made, {"name": "paper", "robospa": "–", "models": published, "text": origin}]


def write_model(entry: Entry, folder: Path) -> None:
    """The page of one model, with its figures and films, into `folder`."""
    (folder / FIGURES).mkdir(parents=True, exist_ok=True)
    films, address, chosen = list[Mapping[str, object]](), "", dict[str, Grounding]()
    if kept := entry.submission:
        films, address, chosen = list(kept.films), kept.evidence.address, {**kept.grounding}
        names = [str(film["video"]) for film in films]
        for name in (*names, IN_REPOSITORY) if address == IN_REPOSITORY else names:
            put(kept.folder / name, folder / name)
    scores, known = entry.column.scores, load().tasks
    series = Series(entry.name, scores, failures=entry.failures, grounding=chosen)
    drawings = draw([series], folder / FIGURES, FORMATS)
    shown = report_tables([entry.column])
    if table := table_of([(entry.name, {(row, 0): one for row, one in chosen.items()})]):
        shown.append(ReportTable(table, False))
    # those of all tasks are opened by hand
    shown = [replace(table, folded=table.table.name.endswith("-tasks")) for table in shown]
    ran = sum(task in known for task in scores.tasks)
    counts = sum(map(Counter, entry.failures.values()), Counter[str]())
    failures = [FailureCount(kind, NAMES[kind], [n]) for kind, n in counts.most_common()]
    sections = ["summary", "evidence", "tables", "figures"]
    sections += ["failures"] if failures else []
    sections += ["videos", "trials"] if films else []
    page = render(
        "model.html",
        title=entry.name,
        badges=[(badge, BADGES[badge]) for badge in entry.badges],
        partial=f"ran {ran} of {len(known)} tasks" if ran < len(known) else "",
        card=card(entry.name, scores),
        about=entry.about,
        evidence=entry.evidence,
        address=address,
        link=entry.link,
        tables=for_page(shown),
        scores_shown=1,
        note=" ".join(method_notes([entry.column])),
        figures=[figure(drawing, folder, FORMATS) for drawing in drawings],
        failures=failures,
        names=[entry.name],
        colours=COLOURS,
        trials=[1],
        most_failed=max(counts.values(), default=1),
        sections=sections,
        trials_title="Filmed trials",
        records_are="the videos lie beside this page",
        left_out=0,
        data={
            "names": [entry.name],
            "kinds": NAMES,
            "speed": SIMULATED_PER_FILM,
            "trials": films,
        },
    )
    replace_file(folder / "index.html", page.encode())


FOLDER = "pairs"
Pair = tuple[Entry, Entry]


def pairs_of(entries: Sequence[Entry]) -> list[Pair]:
    """All pairs of submissions that were measured alike and have a variant in common."""
    known = sorted((e for e in entries if e.submission), key=lambda entry: entry.slug)
    return [
        (one, two)
        for place, one in enumerate(known)
        for two in known[place + 1 :]
        if group(one) and group(one) == group(two) and _variants(one) & _variants(two)
    ]


def _variants(entry: Entry) -> set[str]:
    return set(entry.submission.outcomes) if entry.submission else set()


def write_pairs(pairs: Sequence[Pair], out: Path, note: Note) -> None:
    """Write the script of every pair below `out`, in place of those that were there."""
    shutil.rmtree(out / FOLDER, ignore_errors=True)
    first: tuple[str, ModelResults] | None = None
    for one, two in pairs:
        path = out / FOLDER / one.slug / f"{two.slug}.js"
        note(f"{one.name} and {two.name} on equal seeds")
        if first is None or first[0] != one.slug:
            first = one.slug, _results(one)
        key = json.dumps(f"{one.slug}/{two.slug}")
        rows = json.dumps(paired(first[1], _results(two)), separators=(",", ":"))
        replace_file(path, f"pairLoaded({key}, {rows});\n".encode())


def _results(entry: Entry) -> ModelResults:
    kept = entry.submission
    assert kept is not None
    return results_of(entry.name, kept.outcomes, kept.run)
