"""A table as LaTeX (booktabs), and a document of several that compiles with pdflatex.

What LaTeX would take for a command is escaped. Characters outside ASCII become their command, their
plain letter, or a question mark, so that a model's name can never break the document.
"""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Sequence

from robospa.results.tables.table import Table, TableCell, plain

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
        *_head(table),
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
        lines.append(" & ".join([label, *map(_entry, row.cells)]) + r" \\")
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


def _head(table: Table) -> list[str]:
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


def _entry(entry: TableCell) -> str:
    text = escape_latex(entry.text)
    if re.fullmatch(r"-[\d.]+", text):
        text = f"${text}$"  # a minus sign, not a hyphen
    if entry.best:
        text = rf"\textbf{{{text}}}"
        text = re.sub(r"\$(-[\d.]+)\$", r"$\\mathbf{\1}$", text)
    return text + (rf"$^{{{_sign(entry.sign)}}}$" if entry.sign else "")


def _sign(sign: str) -> str:
    return "".join({"*": r"\ast", "†": r"\dagger"}[c] for c in sign)


def document(tables: Sequence[Table]) -> str:
    """All tables as one document."""
    body = "\n\\clearpage\n".join(to_latex(table) for table in tables)
    return f"{PREAMBLE}\\begin{{document}}\n{body}\n\\end{{document}}\n"
