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


def to_latex(grid: Table) -> str:
    """The table as a float of two columns' width."""
    width = len(grid.heads)
    align = "l" * width if grid.words else "r" * width
    lines = [
        r"\begin{table*}[p]",
        r"\centering",
        rf"\caption{{{escape_latex(grid.title)}}}",
        rf"\label{{tab:{re.sub(r'[^a-z0-9-]', '-', grid.name)}}}",
        _fit(grid),
        rf"\begin{{tabular}}{{l{align}}}",
        r"\toprule",
        *_head(grid),
        r"\midrule",
    ]
    for number, line in enumerate(grid.lines):
        label = escape_latex(line.label)
        if line.kind == "section":
            lines += [r"\midrule"] * (number > 0)
            lines += [rf"\multicolumn{{{width + 1}}}{{l}}{{\textbf{{{label}}}}} \\", r"\midrule"]
            continue
        if line.kind == "average":
            lines.append(r"\addlinespace[2pt]")
            label = rf"\textit{{{label}}}"
        lines.append(" & ".join([label, *map(_entry, line.entries)]) + r" \\")
    lines += [r"\bottomrule", r"\end{tabular}}"]
    lines += [
        rf"\par\smallskip{{\footnotesize\raggedright {escape_latex(n)}\par}}" for n in grid.notes
    ]
    return "\n".join([*lines, r"\end{table*}", ""])


def _fit(grid: Table) -> str:
    """A table that would not fit is scaled by whichever of width and height is the tighter."""
    texts = [(line.label, *(e.text for e in line.entries)) for line in grid.lines if line.entries]
    columns = zip(*texts, (grid.corner, *grid.heads), strict=True)
    width = sum(5.2 * max(map(len, column)) + 12 for column in columns)
    height = sum(12.5 + 6 * (line.kind != "row") for line in grid.lines) + 40
    wide, high = width / PAGE[0], height / PAGE[1]
    if max(wide, high) <= 1:
        return "{%"
    if wide >= high:
        return r"\resizebox{\textwidth}{!}{%"
    return rf"\resizebox*{{!}}{{{PAGE[1]:.0f}pt}}{{%"  # the star counts the depth as well


def _head(grid: Table) -> list[str]:
    lines = []
    if grid.groups:
        spans, rules, place = [], [], 2
        for title, width in grid.groups:
            spans.append(rf"\multicolumn{{{width}}}{{c}}{{{escape_latex(title)}}}")
            rules.append(rf"\cmidrule(lr){{{place}-{place + width - 1}}}")
            place += width
        lines += [" & ".join(["", *spans]) + r" \\", "".join(rules)]
    names = [escape_latex(name) for name in (grid.corner, *grid.heads)]
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


def document(grids: Sequence[Table]) -> str:
    """All tables as one document."""
    body = "\n\\clearpage\n".join(to_latex(grid) for grid in grids)
    return f"{PREAMBLE}\\begin{{document}}\n{body}\n\\end{{document}}\n"
