"""The report as one HTML page that opens from disk: no server, nothing loaded from elsewhere.

Text from outside (instructions, messages of servers, names) is escaped by Jinja or reaches the page
as JSON that the script turns into text nodes. Figures are put into the page as SVG whose text takes
the page's colours; only videos lie beside it.
"""

from __future__ import annotations

import json
import re
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

from robospa.results.failures.labels import NAMES, SIMULATED_PER_FILM
from robospa.results.figures.charts import chance_levels
from robospa.results.figures.draw import draw_profile
from robospa.results.figures.series import COLOURS, FORMATS, GRID, INK, DrawnFigure, spread
from robospa.results.paper.origin import origin_of
from robospa.results.paper.tables import write_tables
from robospa.results.records.action_problems import problem_data
from robospa.results.records.manifest import departures
from robospa.results.records.runs import Run
from robospa.results.report.report import Report, draw_figures, for_page
from robospa.results.report.run_card import about, ends, facts, headline, percent
from robospa.results.report.trials import failure_counts, pair_rows, trial_rows
from robospa.results.scoring.comparable import comparable
from robospa.results.scoring.grounding import grounding_data
from robospa.results.scoring.models import ModelResults
from robospa.results.scoring.scores import Scores, to_json
from robospa.results.statistics.intervals import Estimate
from robospa.results.tables import escape_markdown, to_markdown
from robospa.trial import BASIC, CATEGORIES, CATEGORY_NAMES, DIMENSIONS, METRIC_NAMES

FIGURES = "figures"


def page(
    report: Report,
    drawings: Sequence[DrawnFigure],
    folder: Path,
    drawn: Path | None = None,
    formats: Sequence[str] = FORMATS,
    live: bool = False,
) -> str:
    """The page of `report`.

    Videos are put into `folder`, figures are read from `drawn` or else from there, with links to
    their `formats`. A `live` page asks its server for what is new.
    """
    runs, names = report.runs, [name for name, _ in report.named_runs]
    trials = trial_rows(runs, folder, report.failures)
    failures = failure_counts(report.failures)
    sizes = [len(run.keys) for run in runs]
    sections = ["summary", "tables", "trials", "runs"]
    sections += ["figures"] if any(d.name != "success" for d in drawings) else []
    sections += ["failures"] if failures else []
    pairs = pair_rows(report.flipped, runs, folder)
    sections += ["flipped"] if pairs else []
    sections += ["videos"] if any("video" in t for t in trials) else []
    return render(
        "report.html",
        title="RoboSPA evaluation of " + ", ".join(names),
        headline=headline(runs),
        badges=badges(runs, names),
        scores_shown=len(report.models),
        banner=report.banner,
        cards=[
            card(model.name, model.scores, len(whole.scores.cells), progress)
            for model, whole, progress in zip(
                report.shared, report.models, progress_of(report), strict=True
            )
        ],
        missing=report.missing,
        lacking=sum(bool(c.missing) for m in report.models for c in m.scores.cells.values()),
        errors=[line for line in report.findings if line.startswith("error")],
        warnings=[line for line in report.findings if not line.startswith("error")],
        tables=for_page(report.tables),
        note=" ".join(report.method),
        panels=panels(report.shared),
        colours=COLOURS,
        figures=[figure(d, drawn or folder, formats) for d in drawings if d.name != "success"],
        formats=formats,
        failures=failures,
        trials=sizes,
        most_failed=max(
            (n / of for row in failures for n, of in zip(row.counts, sizes, strict=True)), default=1
        ),
        rate_words=RATE_WORDS,
        names=names,
        runs=[{"name": name, "facts": facts(run)} for name, run in report.named_runs],
        sections=sections,
        left_out=sum(sizes) - len(trials),
        live=live,
        data={
            "names": names,
            "kinds": NAMES,
            "speed": SIMULATED_PER_FILM,
            "folders": [shlex.quote(str(run.folder)) for run in runs],
            "live": live,
            "trials": trials,
            "pairs": pairs,
        },
    )


def render(template: str, **context: object) -> str:
    """A page from one of our templates; whatever is put into it is escaped."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("robospa.results.report", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.policies["json.dumps_kwargs"] = {}  # keep the order of what a script shows
    return environment.get_template(template).render(version=own_version(), **context)


def badges(runs: Sequence[Run], names: Sequence[str]) -> list[str]:
    """Warnings above all numbers: policies that know too much, and missing trials."""
    made = []
    for run, name in zip(runs, names, strict=True):
        of = f"{name}: " if len(runs) > 1 else ""
        made += [f"{of}{one}" for one in departures(run.manifest)]
        if run.missing:
            made.append(f"{of}{len(run.missing)} of {len(run.keys)} trials are missing")
    return made


def progress_of(report: Report) -> list[str]:
    """How much of each model is still to run, in words; empty of one that is not in progress."""
    texts = [
        f"{len(run.waiting)} of {len(run.keys)} trials still to run" if run.waiting else ""
        for run in report.runs
    ]
    return texts + [""] * (len(report.models) - len(texts))


def card(name: str, scores: Scores, listed: int = 0, progress: str = "") -> dict[str, object]:
    """The `rates` over all, official and by the first choice, with their intervals, and `lines` for
    below them; of `listed` variants, those that all models have, if that are more than the `scores`
    are of. `progress` says what is still to be run: the values are of what has finished."""
    overall = scores.overall.get(0)
    lack = "no result yet" if progress else "no value: results are missing"
    rates = [
        _rate(metric, overall.values.get(metric) if overall else None, lack)
        for metric in FIRST_RATES
    ]
    lines = []
    names = {d: scores.dimensions.get((d, 0)) for d in DIMENSIONS}
    names |= {CATEGORY_NAMES[c]: scores.categories.get((c, 0)) for c in BASIC}
    for name_of, part in names.items():
        known = [m for m in FIRST_RATES if part is not None and part.values.get(m)]
        texts = [f"{METRIC_NAMES[m]} {percent(part.values[m])}" for m in known if part is not None]
        lines += [f"{name_of}: " + ", ".join(texts)] * bool(texts)
    if overall is not None:
        count = sum(cell.category not in BASIC for cell in scores.cells.values())
        covered = f"{count} variant{'' if count == 1 else 's'}"
        if listed > len(scores.cells) and not progress:
            covered = f"the {count} of {listed} variants that all have"
        lines.append(f"mean over {covered}, {overall.trials} trials" + " so far" * bool(progress))
    lines += [progress] if progress else []
    shown = [rate for rate in rates if rate["bar"] or rate["name"] == "SR"]
    return {"name": name, "rates": shown, "lines": lines}


FIRST_RATES = ("sr", "sr1")
RATE_WORDS = {
    "SR": "success rate by the official rule",
    "SR@1": "success rate with nothing else tried before",
}


def _rate(metric: str, found: Estimate | None, lack: str) -> dict[str, object]:
    """A rate of a card; `bar` has the value and the ends of its interval in percent, None without
    results."""
    name = METRIC_NAMES[metric]
    if found is None:
        return {"name": name, "value": "–", "interval": lack, "bar": None}
    text, _, interval = percent(found).partition(" ")
    value, low, high = (round(100 * x, 1) for x in (found.value, found.low, found.high))
    bar = (value, max(0.0, low), min(100.0, high))
    return {"name": name, "value": f"{text} %", "interval": f"95 % interval {interval}", "bar": bar}


def panels(models: Sequence[ModelResults]) -> list[dict[str, Any]]:
    """Success by level of `models`, a panel a category that any of them has: `lines` are, of each
    model that has any, its number and the paths of SR, its intervals and SR@1, in a field of
    120 x 70 where y is 10 for 100 %, 60 for 0."""
    made = []
    for category in (*CATEGORIES, *BASIC):
        lines: list[tuple[int, str, str, str]] = []
        guessed: dict[int, float] = {}
        for number, scores in enumerate(model.scores for model in models):
            guessed |= {n: v for (c, n), v in chance_levels(scores).items() if c == category}
            found = {n: a.values for (c, n), a in scores.categories.items() if c == category and n}
            sr, first = ({n: e for n, v in found.items() if (e := v.get(m))} for m in FIRST_RATES)
            bars = [f"M{_x(n)} {_y(100 * e.low)}V{_y(100 * e.high)}" for n, e in sr.items()
                    if spread(scores, category, n)]  # fmt: skip
            if sr:
                paths = (_path({n: 100 * e.value for n, e in one.items()}) for one in (sr, first))
                lines.append((number, next(paths), "".join(bars), next(paths)))
        if lines:
            title, chance = CATEGORY_NAMES[category], _path(guessed)
            made.append({"category": category, "title": title, "lines": lines, "chance": chance})
    return made


def _path(values: Mapping[int, float]) -> str:
    """A line through percents by level."""
    points = [f"{_x(n)} {_y(value)}" for n, value in sorted(values.items())]
    return "M" + "L".join(points) + "h0" * (len(points) == 1) if points else ""  # a dot


def _x(level: int) -> float:
    return 10 + 25 * (level - 1)


def _y(value: float) -> float:
    return round(60 - value / 2, 1)


def figure(
    drawing: DrawnFigure, folder: Path, formats: Sequence[str] = FORMATS
) -> dict[str, object]:
    """A figure for the page: its `svg` as markup, and the path of its files without ending, from
    the page's folder."""
    from markupsafe import Markup

    svg = (folder / FIGURES / f"{drawing.name}.svg").read_text(encoding="utf-8")
    markup = Markup(inline_svg(svg, drawing.name, f"{drawing.title}. {drawing.caption}"))
    file = f"{FIGURES}/{drawing.name}"
    return {**asdict(drawing), "file": file, "formats": formats, "svg": markup}


def inline_svg(svg: str, prefix: str, label: str) -> str:
    """Matplotlib's file as an element of a page: ids of its own, the page's colours, a label."""
    from markupsafe import escape

    body = svg[svg.index("<svg") :]
    body = re.sub(r"<metadata>.*?</metadata>", "", body, count=1, flags=re.DOTALL)
    body = re.sub(r"<style.*?</style>", "", body, count=1, flags=re.DOTALL)  # would hold page-wide
    body = re.sub(r' xmlns(:xlink)?="[^"]*"', "", body)
    body = re.sub(r'\bid="([^"]+)"', rf'id="{prefix}-\1"', body)
    body = re.sub(r'href="#([^"]+)"', rf'href="#{prefix}-\1"', body)
    body = re.sub(r"url\(#([^)]+)\)", rf"url(#{prefix}-\1)", body)
    body = body.replace(INK, "currentColor").replace(GRID, "var(--line)")
    body = re.sub(r'\b(width|height)="[0-9.]+pt" ?', "", body, count=2)
    # Glyphs have no colour of their own: they are black by default.
    style = "fill: currentColor; stroke-linejoin: round; stroke-linecap: butt"
    return body.replace(
        "<svg ", f'<svg role="img" style="{style}" aria-label="{escape(label)}" ', 1
    )


def own_version() -> str:
    """The installed version of robospa."""
    try:
        return version("robospa")
    except PackageNotFoundError:
        return ""


TABLES_FOLDER = "tables"


def write_report(report: Report, folder: Path) -> Path:
    """Write `report` into `folder` and return it."""
    (folder / FIGURES).mkdir(parents=True, exist_ok=True)
    drawings = draw_figures(report.runs, report.columns, folder / FIGURES, failures=report.failures)
    for number, found in enumerate(report.profiles, 1):
        drawings += draw_profile(found, folder / FIGURES, number)
    if report.tables:  # the same for papers and programs
        write_tables([t.table for t in report.tables], folder / TABLES_FOLDER, ("tex", "csv"))
    (folder / "report.md").write_text(markdown(report), encoding="utf-8")
    (folder / "report.json").write_text(json.dumps(to_data(report), indent=1) + "\n")
    (folder / "report.html").write_text(page(report, drawings, folder), encoding="utf-8")
    return folder


def markdown(report: Report) -> str:
    """report.md: the cards, what is missing or odd, and all tables."""
    lines = ["# " + escape_markdown(", ".join(name for name, _ in report.named_runs)), ""]
    for name, run in report.named_runs:
        lines += [f"## {escape_markdown(name)}", ""]
        lines += [f"* {title}: {escape_markdown(text)}" for title, text in facts(run)] + [""]
    for what, found in (
        ("note", report.banner),
        ("missing", report.missing),
        ("findings", [text for text in report.findings if text.startswith("error")]),
    ):
        lines += [f"* **{what}**: {escape_markdown(text)}" for text in found]
    for table in report.tables:
        lines += ["", to_markdown(table.table)]
    warnings = [text for text in report.findings if not text.startswith("error")]
    lines += ["", *(f"* **findings**: {escape_markdown(text)}" for text in warnings)]
    return "\n".join([*lines, "", " ".join(report.method), ""])


def to_data(report: Report) -> dict[str, object]:
    """report.json: facts, scores, ends and action problems of every run."""
    return {
        "origin": origin_of([model for model in report.models if not model.published]),
        "runs": [
            {
                "name": model.name,
                "run": about(run),
                **to_json(model.scores),
                "comparable": to_json(comparable(model).scores),
                "grounding": grounding_data(model.records),
                "ends": ends(run),
                "problems": problem_data(run.records.values()),
            }
            for model, run in zip(report.models, report.runs, strict=False)
        ],
    }
