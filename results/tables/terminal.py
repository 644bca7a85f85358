"""A table on the terminal."""

from __future__ import annotations

from robospa.results.tables.table import Grid


def show(grid: Grid) -> None:
    """Print `grid`; a file gets all columns, however narrow the terminal."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(title=grid.title, title_justify="left", box=None, pad_edge=False)
    table.add_column(grid.corner, no_wrap=True)
    last = ""
    for group, head in zip(grid.group_of, grid.heads, strict=True):
        name = f"{group}\n{head}" if group != last else f"\n{head}"
        table.add_column(name, justify="left" if grid.words else "right", no_wrap=True)
        last = group
    for line in grid.lines:
        if line.kind == "section":
            table.add_section()
            table.add_row(Text(line.label, style="bold"))
            continue
        cells = [Text(e.text + e.sign, style="bold" if e.best else "") for e in line.entries]
        table.add_row(Text(line.label, style="italic" * (line.kind == "average")), *cells)
    console = Console()
    if not console.is_terminal:
        console = Console(width=220)  # rows are only as long as they need
    console.print(table, highlight=False)
    for note in grid.notes:
        console.print(Text(note, style="dim"))
