"""An example of the docs as an installed package: its entry points, found as any other's."""

from collections.abc import Mapping
from pathlib import Path

EXAMPLES = Path(__file__).resolve().parents[2] / "docs" / "examples"


def installed(folder: Path, groups: Mapping[str, Mapping[str, str]]) -> Path:
    """`folder`, with the note that an installer leaves there: entry points by group and name."""
    note = folder / "worked_example-1.0.dist-info"
    note.mkdir()
    (note / "METADATA").write_text("Metadata-Version: 2.1\nName: worked-example\nVersion: 1.0\n")
    lines = [
        line
        for group, entries in groups.items()
        for line in (f"[{group}]", *(f"{name} = {value}" for name, value in entries.items()))
    ]
    (note / "entry_points.txt").write_text("\n".join(lines) + "\n")
    return folder
