"""docs/benchmarks.md from benchmarks/results/*.json.

    python benchmarks/report.py

Every figure on the page comes from a file; a figure that no file holds is not on the page.
"""

from __future__ import annotations

import json
from pathlib import Path

from common import RESULTS, Json

PAGE = Path(__file__).resolve().parents[1] / "docs" / "benchmarks.md"
ORDER = (
    "wire",
    "step",
    "batching",
    "physics",
    "loading",
    "rendering",
    "scenes",
    "throughput",
    "parallel",
    "ray",
)
"""The page's order; what is not named comes after, by name."""

HEAD = """# Benchmarks

What "good" means in numbers, each beside a bare limit or a peer measured in the same run.
Scripts are in `benchmarks/`; `python benchmarks/NAME.py --json` measures again and keeps the result
in `benchmarks/results/`, from which `python benchmarks/report.py` writes this page.
"""


def load(folder: Path = RESULTS) -> list[Json]:
    """All results in the page's order."""
    found = [json.loads(p.read_text(encoding="utf-8")) for p in sorted(folder.glob("*.json"))]
    place = {name: i for i, name in enumerate(ORDER)}
    return sorted(found, key=lambda r: (place.get(r["benchmark"], len(ORDER)), r["benchmark"]))


def number(value: float | None) -> str:
    """Four digits or more, and thousands apart."""
    if value is None:
        return "not measured"
    if isinstance(value, int) or abs(value) >= 1000:
        return f"{value:,.0f}"
    return f"{value:.4g}"


def cell(text: str) -> str:
    """Text that does not end its table's cell."""
    return text.replace("|", "\\|").replace("\n", " ")


def table(head: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    """A Markdown table."""
    lines = [head, tuple("---" for _ in head), *rows]
    return "\n".join("| " + " | ".join(cell(c) for c in line) + " |" for line in lines)


def measured(row: Json, key: str = "value") -> str:
    """Value and unit."""
    value = row.get(key)
    return number(value) + (f" {row['unit']}" if value is not None and row["unit"] else "")


def bar(row: Json) -> str:
    """The bar in words."""
    for key, sign in (("at_most", "<="), ("at_least", ">=")):
        if row.get(key) is not None:
            return f"{sign} {number(row[key])}"
    return ""


def verdict(row: Json) -> str:
    """Met, or not; "" where there is nothing to meet."""
    met = row.get("met")
    if met is None:
        return "not measured" if bar(row) else ""
    return "met" if met else "**not met**"


def summary(results: list[Json]) -> str:
    """All figures that have a bar."""
    rows = [
        (
            f"[{row['what']}](#{result['benchmark']})",
            bar(row),
            measured(row),
            verdict(row),
            measured(row, "before") if "before" in row else "",
        )
        for result in results
        for row in result["rows"]
        if bar(row)
    ]
    return table(("what", "bar", "measured", "", "before"), rows)


def columns(rows: list[Json]) -> list[tuple[str, list[str]]]:
    """Heads and cells of a section's table; columns in which nothing stands are left out."""
    all_of = {
        "what": [row["what"] for row in rows],
        "measured": [measured(row) for row in rows],
        "bar": [f"{bar(row)} {verdict(row)}".strip() for row in rows],
        "before": [measured(row, "before") if "before" in row else "" for row in rows],
        "note": [
            "; ".join(w for w in (row.get("note", ""), _origin(row)) if w).strip() for row in rows
        ],
    }
    return [(head, cells) for head, cells in all_of.items() if any(cells)]


def _origin(row: Json) -> str:
    """The source of a metric that the result's own command did not measure."""
    when = f"measured {row['date']}" if row.get("date") else ""
    how = f"`{row['command']}`" if row.get("command") else ""
    return " ".join(w for w in (when, how) if w)


def section(result: Json) -> str:
    """One benchmark."""
    cells = columns(result["rows"])
    body = table(
        tuple(head for head, _ in cells), list(zip(*(column for _, column in cells), strict=True))
    )
    machine = result["machine"]
    about = [f"`{result['command']}`, {result['date']}"]
    about.append(", ".join(f"{key} {value}" for key, value in machine.items()))
    about.append(", ".join(f"{name} {value}" for name, value in result["versions"].items()))
    parts = [f'<a id="{result["benchmark"]}"></a>\n\n## {result["title"]}', result["text"], body]
    parts.append(". ".join(w for w in (*about, result["circumstances"]) if w) + ".")
    return "\n\n".join(part for part in parts if part)


def page(results: list[Json]) -> str:
    """The whole page."""
    parts = [HEAD.rstrip(), summary(results), *(section(result) for result in results)]
    return "\n\n".join(parts) + "\n"


def main() -> None:
    """Write the page."""
    PAGE.write_text(page(load()), encoding="utf-8")
    print(f"written {PAGE}")


if __name__ == "__main__":
    main()
