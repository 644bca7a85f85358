"""A table as HTML, and a page of several that needs nothing from elsewhere."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from robospa.results.tables.table import Table, TableCell, TableRow, plain

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


def fragment(table: Table) -> str:
    """The table with its title as caption and its notes below, to put into a page."""
    kind = ' class="words"' if table.words else ""
    parts = [
        f'<section id="{_text(table.name)}">',
        f"<h2>{_text(table.title)}</h2>",
        f'<div class="scroll"><table{kind}>',
        "<thead>",
        *_head(table),
        "</thead>",
        "<tbody>",
        *(_line(row, len(table.heads)) for row in table.rows),
        "</tbody></table></div>",
        *(f'<p class="notes">{_text(note)}</p>' for note in table.notes),
        "</section>",
    ]
    return "\n".join(parts)


def page(tables: Sequence[Table], title: str) -> str:
    """A whole page with all tables."""
    links = " · ".join(f'<a href="#{_text(g.name)}">{_text(g.name)}</a>' for g in tables)
    body = "\n".join(fragment(table) for table in tables)
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{_text(title)}</title>\n<style>{STYLE}</style></head>\n"
        f"<body>\n<h1>{_text(title)}</h1>\n<p>{links}</p>\n{body}\n</body></html>\n"
    )


def _head(table: Table) -> list[str]:
    names = "".join(f'<th scope="col">{_text(name)}</th>' for name in (table.corner, *table.heads))
    rows = [f"<tr>{names}</tr>"]
    if table.groups:
        spans = "".join(
            f'<th colspan="{width}" scope="colgroup">{_text(title)}</th>'
            for title, width in table.groups
        )
        rows.insert(0, f"<tr><td></td>{spans}</tr>")
    return rows


def _line(row: TableRow, width: int) -> str:
    if row.kind == "section":
        name = f'<th colspan="{width + 1}" scope="rowgroup">{_text(row.label)}</th>'
        return f'<tr class="section">{name}</tr>'
    kind = ' class="average"' if row.kind == "average" else ""
    cells = "".join(map(_entry, row.cells))
    return f'<tr{kind}><th scope="row">{_text(row.label)}</th>{cells}</tr>'


def _entry(entry: TableCell) -> str:
    kind = ' class="best"' if entry.best else ""
    hint = ""
    if entry.low is not None and entry.high is not None:
        lacks = f"; {entry.missing} trials missing" if entry.missing else ""
        if lacks and entry.bounds is not None:
            lacks += f", so between {entry.bounds[0]:z.1f} and {entry.bounds[1]:z.1f}"
        hint = f' title="95 %: {entry.low:.1f} to {entry.high:.1f}{lacks}"'
        hint += f' data-interval="[{entry.low:z.1f}, {entry.high:z.1f}]"'
    sign = f"<sup>{_text(entry.sign)}</sup>" if entry.sign else ""
    return f"<td{kind}{hint}>{_text(entry.text)}{sign}</td>"


def _text(text: str) -> str:
    return escape(plain(text), quote=True)
