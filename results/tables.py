"""A table as a value, and its writers: terminal, HTML, LaTeX, Markdown, CSV.

A `Table` knows no metric and no model: labels, cells that are already text, marks and notes. What
comes from outside (names of models) is escaped by every writer.
"""

from __future__ import annotations

import csv
import io
import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import TYPE_CHECKING

from robospa.results.paper.rounding import shown
from robospa.text import interval_text, markdown_table, plain, plain_console

if TYPE_CHECKING:
    from rich.console import Console

    from robospa.results.statistics.intervals import Estimate

PRINTED_OTHERWISE = "*"
MISSING = "†"


@dataclass(frozen=True)
class TableCell:
    """One cell: its text, and for programs its value and interval in percent.

    `best` marks it; `sign` (* or †) points to the notes.
    """

    text: str = ""
    value: float | None = None
    low: float | None = None
    high: float | None = None
    best: bool = False
    sign: str = ""
    missing: int = 0
    bounds: tuple[float, float] | None = None
    """Between which values [percent] the `missing` trials leave it, where that is known."""


def estimate_cell(estimate: Estimate | None, style: str = "z.1f", sign: str = "") -> TableCell:
    """`12.0 [5.6, 23.8]`, an estimate in percent, rounded as everywhere; a dash for none."""
    if estimate is None:
        return DASH
    ends = (100 * estimate.value, 100 * estimate.low, 100 * estimate.high)
    return TableCell(interval_text(*map(shown, ends), style=style), *ends, sign=sign)


DASH = TableCell("–")


@dataclass(frozen=True)
class TableRow:
    """One row. Of a `section` only the label is shown; an `average` is set apart."""

    label: str
    cells: tuple[TableCell, ...] = ()
    kind: str = "row"


@dataclass(frozen=True)
class Table:
    """A table: `heads` name its columns; `groups` (title, width) span them, or are empty."""

    name: str
    title: str
    corner: str
    heads: tuple[str, ...]
    rows: tuple[TableRow, ...]
    groups: tuple[tuple[str, int], ...] = ()
    notes: tuple[str, ...] = ()
    words: bool = False
    """Cells are words rather than numbers: set them flush left."""

    def __post_init__(self) -> None:
        if self.groups and sum(width for _, width in self.groups) != len(self.heads):
            raise ValueError(f"the groups of table {self.name} do not span its columns")
        for row in self.rows:
            if row.kind != "section" and len(row.cells) != len(self.heads):
                raise ValueError(f"row {row.label} of table {self.name} has the wrong length")

    def __str__(self) -> str:
        """The table as it stands on a terminal."""
        out = io.StringIO()
        _print(self, plain_console(wide=WIDE, file=out))
        return out.getvalue().rstrip("\n")

    def _repr_html_(self) -> str:
        return html_fragment(self)

    @property
    def group_of(self) -> list[str]:
        """The group's title of every column."""
        names = [title for title, width in self.groups for _ in range(width)]
        return names or [""] * len(self.heads)


class ShownAsTables:
    """What `print` and a notebook show as its `tables`."""

    @property
    def tables(self) -> list[Table]:
        """All that it says."""
        raise NotImplementedError

    def __str__(self) -> str:
        return "\n\n".join(map(str, self.tables))

    def _repr_html_(self) -> str:
        return "\n".join(map(html_fragment, self.tables))


WIDE = 220
"""Columns of what is not a terminal; rows are only as long as they need."""


def show(table: Table) -> None:
    """Print `table`; a file gets all columns, however narrow the terminal."""
    _print(table, plain_console(wide=WIDE))


def _print(table: Table, console: Console) -> None:
    from rich import table as rich_table
    from rich.text import Text

    rendered = rich_table.Table(title=table.title, title_justify="left", box=None, pad_edge=False)
    rendered.add_column(table.corner)
    last = ""
    for group, head in zip(table.group_of, table.heads, strict=True):
        name = f"{group if group != last else ''}\n{head}" if table.groups else head
        rendered.add_column(name, justify="left" if table.words else "right", no_wrap=True)
        last = group
    for row in table.rows:
        if row.kind == "section":
            rendered.add_section()
            rendered.add_row(Text(row.label, style="bold"))
            continue
        cells = [Text(e.text + e.sign, style="bold" if e.best else "") for e in row.cells]
        rendered.add_row(Text(row.label, style="bold" * (row.kind == "average")), *cells)
    console.print(rendered)
    for note in table.notes:
        console.print(Text(note, style="dim"))


STYLE = """
:root { color-scheme: light dark; }
body { font: 15px/1.45 system-ui, sans-serif; }
body { margin: 2rem auto; max-width: 80rem; padding: 0 1rem; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; margin: .5rem 0; }
th, td { padding: .15rem .55rem; text-align: right; white-space: nowrap; }
th:first-child, .words td { text-align: left; }
thead th { border-bottom: 1px solid; }
thead tr:first-child th[colspan] { text-align: center; }
tr.section th { padding-top: .8rem; border-bottom: 1px solid #8888; }
tr.average { font-style: italic; }
td.best { background: #4a7dff33; font-weight: 700; }
.notes { font-size: .87em; opacity: .85; max-width: 60rem; }
"""


def html_fragment(table: Table) -> str:
    """The table with its title as caption and its notes below, to put into a page."""
    kind = ' class="words"' if table.words else ""
    parts = [
        f'<section id="{_html_text(table.name)}">',
        f"<h2>{_html_text(table.title)}</h2>",
        f'<div class="scroll"><table{kind}>',
        "<thead>",
        *_html_head(table),
        "</thead>",
        "<tbody>",
        *(_html_row(row, len(table.heads)) for row in table.rows),
        "</tbody></table></div>",
        *(f'<p class="notes">{_html_text(note)}</p>' for note in table.notes),
        "</section>",
    ]
    return "\n".join(parts)


def html_page(tables: Sequence[Table], title: str) -> str:
    """A whole page with all tables."""
    links = " · ".join(f'<a href="#{_html_text(g.name)}">{_html_text(g.name)}</a>' for g in tables)
    body = "\n".join(html_fragment(table) for table in tables)
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{_html_text(title)}</title>\n<style>{STYLE}</style></head>\n"
        f"<body>\n<h1>{_html_text(title)}</h1>\n<p>{links}</p>\n{body}\n</body></html>\n"
    )


def _html_head(table: Table) -> list[str]:
    names = "".join(
        f'<th scope="col">{_html_text(name)}</th>' for name in (table.corner, *table.heads)
    )
    rows = [f"<tr>{names}</tr>"]
    if table.groups:
        spans = "".join(
            f'<th colspan="{width}" scope="colgroup">{_html_text(title)}</th>'
            for title, width in table.groups
        )
        rows.insert(0, f"<tr><td></td>{spans}</tr>")
    return rows


def _html_row(row: TableRow, width: int) -> str:
    if row.kind == "section":
        name = f'<th colspan="{width + 1}" scope="rowgroup">{_html_text(row.label)}</th>'
        return f'<tr class="section">{name}</tr>'
    kind = ' class="average"' if row.kind == "average" else ""
    cells = "".join(map(_html_entry, row.cells))
    return f'<tr{kind}><th scope="row">{_html_text(row.label)}</th>{cells}</tr>'


def _html_entry(entry: TableCell) -> str:
    kind = ' class="best"' if entry.best else ""
    hint = ""
    if entry.low is not None and entry.high is not None:
        lacks = f"; {entry.missing} trials missing" if entry.missing else ""
        if lacks and entry.bounds is not None:
            worst, best = map(shown, entry.bounds)
            lacks += f", so between {worst:.1f} and {best:.1f}"
        low, high = shown(entry.low), shown(entry.high)
        hint = f' title="95 %: {low:.1f} to {high:.1f}{lacks}"'
        hint += f' data-interval="[{low:.1f}, {high:.1f}]"'
    sign = f"<sup>{_html_text(entry.sign)}</sup>" if entry.sign else ""
    return f"<td{kind}{hint}>{_html_text(entry.text)}{sign}</td>"


def _html_text(text: str) -> str:
    return escape(plain(text), quote=True)


PREAMBLE = r"""\documentclass[a4paper]{article}
\usepackage[margin=15mm]{geometry}
\usepackage{booktabs}
\usepackage{graphicx}
"""
PAGE = (510.0, 600.0)
"""Width and height [pt] that a table may take: the notes need the rest of the page."""

_SPECIAL = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    '"': "''",
    "π": r"$\pi$",
    "≤": r"$\leq$",
    "†": r"$\dagger$",
    "–": "--",
}


def escape_latex(text: str) -> str:
    """`text` as LaTeX that prints it."""
    made = "".join(_SPECIAL.get(c) or _ascii(c) for c in plain(text))
    return re.sub(r"\$\\pi\$(\d(?:\.\d+)?)", r"$\\pi_{\1}$", made)


def _ascii(character: str) -> str:
    if character.isascii():
        return character
    letters = unicodedata.normalize("NFKD", character).encode("ascii", "ignore").decode()
    return "".join(_SPECIAL.get(c, c) for c in letters) or "?"


def to_latex(table: Table) -> str:
    """The table as a float of two columns' width."""
    width = len(table.heads)
    align = "l" * width if table.words else "r" * width
    lines = [
        r"\begin{table*}[p]",
        r"\centering",
        rf"\caption{{{escape_latex(table.title)}}}",
        rf"\label{{tab:{re.sub(r'[^a-z0-9-]', '-', table.name)}}}",
        _fit(table),
        rf"\begin{{tabular}}{{l{align}}}",
        r"\toprule",
        *_latex_head(table),
        r"\midrule",
    ]
    for number, row in enumerate(table.rows):
        label = escape_latex(row.label)
        if row.kind == "section":
            lines += [r"\midrule"] * (number > 0)
            lines += [rf"\multicolumn{{{width + 1}}}{{l}}{{\textbf{{{label}}}}} \\", r"\midrule"]
            continue
        if row.kind == "average":
            lines.append(r"\addlinespace[2pt]")
            label = rf"\textit{{{label}}}"
        lines.append(" & ".join([label, *map(_latex_entry, row.cells)]) + r" \\")
    lines += [r"\bottomrule", r"\end{tabular}}"]
    lines += [
        rf"\par\smallskip{{\footnotesize\raggedright {escape_latex(n)}\par}}" for n in table.notes
    ]
    return "\n".join([*lines, r"\end{table*}", ""])


def _fit(table: Table) -> str:
    """A table that would not fit is scaled by whichever of width and height is the tighter."""
    texts = [(row.label, *(e.text for e in row.cells)) for row in table.rows if row.cells]
    columns = zip(*texts, (table.corner, *table.heads), strict=True)
    width = sum(5.2 * max(map(len, column)) + 12 for column in columns)
    height = sum(12.5 + 6 * (row.kind != "row") for row in table.rows) + 40
    wide, high = width / PAGE[0], height / PAGE[1]
    if max(wide, high) <= 1:
        return "{%"
    if wide >= high:
        return r"\resizebox{\textwidth}{!}{%"
    return rf"\resizebox*{{!}}{{{PAGE[1]:.0f}pt}}{{%"  # the star counts the depth as well


def _latex_head(table: Table) -> list[str]:
    lines = []
    if table.groups:
        spans, rules, place = [], [], 2
        for title, width in table.groups:
            spans.append(rf"\multicolumn{{{width}}}{{c}}{{{escape_latex(title)}}}")
            rules.append(rf"\cmidrule(lr){{{place}-{place + width - 1}}}")
            place += width
        lines += [" & ".join(["", *spans]) + r" \\", "".join(rules)]
    names = [escape_latex(name) for name in (table.corner, *table.heads)]
    return [*lines, " & ".join(names) + r" \\"]


def _latex_entry(entry: TableCell) -> str:
    text = escape_latex(entry.text)
    if re.fullmatch(r"-[\d.]+", text):
        text = f"${text}$"  # a minus sign, not a hyphen
    if entry.best:
        text = rf"\textbf{{{text}}}"
        text = re.sub(r"\$(-[\d.]+)\$", r"$\\mathbf{\1}$", text)
    sign = "".join({PRINTED_OTHERWISE: r"\ast", MISSING: r"\dagger"}[c] for c in entry.sign)
    return text + (rf"$^{{{sign}}}$" if sign else "")


def latex_document(tables: Sequence[Table]) -> str:
    """All tables as one document."""
    body = "\n\\clearpage\n".join(to_latex(table) for table in tables)
    return f"{PREAMBLE}\\begin{{document}}\n{body}\n\\end{{document}}\n"


def escape_markdown(text: str) -> str:
    """`text` with what Markdown or HTML inside it would take for markup made harmless."""
    return re.sub(r"([\\|*_`<>\[\]])", r"\\\1", plain(text))


def to_markdown(table: Table) -> str:
    """The table in Markdown, its title above and its notes below."""
    names = [
        f"{escape_markdown(group)} {escape_markdown(head)}".strip()
        for group, head in zip(table.group_of, table.heads, strict=True)
    ]
    heads, rows = [escape_markdown(table.corner), *names], []
    for row in table.rows:
        label = escape_markdown(row.label)
        if row.kind == "section":
            rows.append([f"**{label}**", *[""] * len(names)])
        else:
            heading = label if row.kind == "row" else f"*{label}*"
            rows.append([heading, *map(_markdown_entry, row.cells)])
    rule = "---" if table.words else "---:"
    body = markdown_table(heads, rows, ["---", *[rule] * len(names)])
    notes = "".join(f"\n\n{escape_markdown(note)}" for note in table.notes)
    return f"### {escape_markdown(table.title)}\n\n{body}{notes}\n"


def _markdown_entry(entry: TableCell) -> str:
    text = escape_markdown(entry.text)
    return (f"**{text}**" if entry.best else text) + escape_markdown(entry.sign)


CSV_FIELDS = ("table", "section", "row", "group", "column", "text", "value", "low", "high", "best")
CSV_LACKS = ("sign", "missing", "worst_case", "best_case")
"""Further columns: the mark, and what trials without a result leave open."""
CSV_NUMBER = r"[+-]?[\d.]+%?( [\[(±][\d.,%+ -]*[\])]?)?"
"""A number, as `-1.5` and `+2.0 [1.0, 3.0]`: no formula, though it begins like one."""


def to_csv(tables: Sequence[Table]) -> str:
    """All cells of `tables`, one a line, for programs: CSV_FIELDS, then CSV_LACKS.

    Values are not rounded. A text that a spreadsheet would run as a formula gets a quote before it.
    """
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow((*CSV_FIELDS, *CSV_LACKS))
    for table in tables:
        section = ""
        for row in table.rows:
            if row.kind == "section":
                section = row.label
                continue
            for group, head, entry in zip(table.group_of, table.heads, row.cells, strict=True):
                found = (entry.value, entry.low, entry.high)
                numbers = ("" if x is None else f"{x:.10g}" for x in found)
                words = (table.name, section, row.label, group, head, entry.text)
                best = "best" if entry.best else ""
                lacks = (entry.missing or "", *(f"{x:.10g}" for x in entry.bounds or ()))
                texts = (*map(_no_formula, words), *numbers, best, entry.sign, *lacks)
                writer.writerow((*texts, *[""] * (len(CSV_FIELDS) + len(CSV_LACKS) - len(texts))))
    return out.getvalue()


def _no_formula(text: str) -> str:
    dangerous = text[:1] in ("=", "+", "-", "@", "\t", "\r")
    return "'" + text if dangerous and not re.fullmatch(CSV_NUMBER, text) else text
