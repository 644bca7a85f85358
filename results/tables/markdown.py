"""A table in Markdown."""

from __future__ import annotations

import re

from robospa.results.tables.table import Table, TableCell, plain


def escape_markdown(text: str) -> str:
    """`text` with what Markdown or HTML inside it would take for markup made harmless."""
    return re.sub(r"([\\|*_`<>\[\]])", r"\\\1", plain(text))


def to_markdown(table: Table) -> str:
    """The table in Markdown, its title above and its notes below."""
    names = [
        f"{escape_markdown(group)} {escape_markdown(head)}".strip()
        for group, head in zip(table.group_of, table.heads, strict=True)
    ]
    rule = "---" if table.words else "---:"
    lines = [
        f"### {escape_markdown(table.title)}",
        "",
        f"| {escape_markdown(table.corner)} | " + " | ".join(names) + " |",
        "|---|" + f"{rule}|" * len(names),
    ]
    for row in table.rows:
        label = escape_markdown(row.label)
        heading = label if row.kind == "row" else f"*{label}*"
        if row.kind == "section":
            lines.append(f"| **{label}** | " + " | ".join([""] * len(names)) + " |")
        else:
            lines.append(f"| {heading} | " + " | ".join(map(_markdown_entry, row.cells)) + " |")
    for note in table.notes:
        lines += ["", escape_markdown(note)]
    return "\n".join(lines) + "\n"


def _markdown_entry(entry: TableCell) -> str:
    text = escape_markdown(entry.text)
    return (f"**{text}**" if entry.best else text) + escape_markdown(entry.sign)
