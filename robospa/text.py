"""Texts that are made in many places: intervals, durations, lists of names, Markdown tables; and a
terminal where what comes from outside is text, and never markup.

Names of policies, messages and instructions may hold "[/bold]", "[link=...]" or ":boom:". A console
of this module prints them as they are; what shall be coloured is a `rich.text.Text` with a style.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import IO, TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.console import Console

NAMED = 3
"""So many names of a list are given before the others are only counted."""


def interval_text(value: float, low: float, high: float, *, style: str = "z.1f") -> str:
    """`12.0 [5.6, 23.8]`: a value with the ends of its interval, each in the format `style`."""
    return f"{value:{style}} [{low:{style}}, {high:{style}}]"


def counted(count: float, word: str) -> str:
    """`1 trial`, `2 trials`."""
    return f"{count:g} {word}" + "s" * (count != 1)


def duration_text(seconds: float) -> str:
    """`3 h 05 min`, `12 min` or `40 s`, for sentences."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    hours, minutes = divmod(round(seconds / 60), 60)
    return f"{hours} h {minutes:02d} min" if hours else f"{minutes} min"


def clock_text(seconds: float) -> str:
    """`1:02:03` or `2:03`, for what is shown again and again."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"


def listed(words: Sequence[str], last: str = " and ") -> str:
    """`a, b and c`."""
    return last.join([", ".join(words[:-1]), words[-1]] if len(words) > 1 else words)


def some(names: Sequence[str], most: int = NAMED) -> str:
    """`a, b, c and 2 more`."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def plain(text: str) -> str:
    """`text` on one line."""
    return " ".join(text.split())


def markdown_table(
    heads: Sequence[str], rows: Iterable[Sequence[str]], align: Sequence[str] = ()
) -> str:
    """A table in Markdown, without a newline at its end; cells are Markdown already. `align` has
    the rule below each head, such as `---:`."""
    lines = ["| " + " | ".join(row) + " |" for row in (heads, *rows)]
    rule = "|" + "".join(f"{one}|" for one in align or ["---"] * len(heads))
    return "\n".join([lines[0], rule, *lines[1:]])


PLAIN: dict[str, Any] = {"markup": False, "emoji": False, "highlight": False}


def plain_console(
    wide: int | None = None, file: IO[str] | None = None, quiet: bool = False
) -> Console:
    """A console that takes no text for markup, an emoji or something to colour.

    `wide`: columns that it has where it is no terminal, which none would read narrowly.
    """
    from rich.console import Console

    console = Console(file=file, quiet=quiet, **PLAIN)
    if wide is None or console.is_terminal:
        return console
    return Console(width=wide, file=file, quiet=quiet, **PLAIN)


def recording_console(columns: int) -> Console:
    """The same kind of console, of so many columns: shows nothing, and exports what was printed."""
    import io

    from rich.console import Console

    shown = {**PLAIN, "force_terminal": True, "force_jupyter": False, "color_system": "truecolor"}
    return Console(record=True, file=io.StringIO(), width=columns, **shown)


def size_text(size: float) -> str:
    """`1.2 GB`, `35 MB`."""
    for unit in ("bytes", "kB", "MB", "GB"):
        if size < 1000:
            return f"{size:.3g} {unit}"
        size /= 1000
    return f"{size:.3g} TB"
