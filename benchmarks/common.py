"""The common form of every benchmark's result: what `benchmarks/results/*.json` holds.

A script measures, makes one `Result` with a `Row` a figure, prints it, and with `--json` writes it:

    parser = argument_parser(__doc__)              # has --json [FILE] and --circumstances TEXT
    options = parser.parse_args()
    finish(Result("wire", "What a round trip costs", rows, text="..."), options)

`python benchmarks/report.py` writes docs/benchmarks.md from these files, so what a figure means,
and why one misses its bar, is said here: in a row's `note` and in the result's `text`. Whether a
bar is met is computed from the numbers, never written by hand. What could not be measured (a peer
that does not install) is a row without value whose note says why.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import shlex
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from datetime import date
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

RESULTS = Path(__file__).parent / "results"
Json = dict[str, Any]
"""An object of a JSON file."""
PACKAGES = ("numpy", "msgpack", "websockets", "sapien")


@dataclass(frozen=True)
class Metric:
    """One figure. `at_most` or `at_least` is its bar in the same unit, if it has one."""

    what: str
    value: float | None
    unit: str = ""
    at_most: float | None = None
    at_least: float | None = None
    note: str = ""
    before: float | None = None
    """The same figure before the last work on it; kept from the file if not given."""
    command: str = ""
    """If another than the result's."""
    date: str = ""
    """If another than the result's: a figure carried over from an earlier measurement."""

    @property
    def bar(self) -> str:
        """The bar in words, "" without one."""
        if self.at_most is not None:
            return f"<= {self.at_most:g}"
        return "" if self.at_least is None else f">= {self.at_least:g}"

    @property
    def met(self) -> bool | None:
        """True if the bar is met; None without a bar or a value."""
        if self.value is None or not self.bar:
            return None
        if self.at_most is not None:
            return self.value <= self.at_most
        return self.at_least is not None and self.value >= self.at_least

    def to_json(self) -> Json:
        """All that is set, `what`, `value` and `unit` always, and with a bar whether it is met."""
        found = {"what": self.what, "value": self.value, "unit": self.unit}
        found.update(
            {k: v for k, v in vars(self).items() if k not in found and v not in ("", None)}
        )
        return {**found, "met": self.met} if self.bar else found


@dataclass(frozen=True)
class Result:
    """The metrics of one script.

    `circumstances` are what else ran, and how often was measured; `text` is Markdown for the page;
    `data` any details, kept but not shown.
    """

    name: str
    title: str
    rows: tuple[Metric, ...]
    text: str = ""
    circumstances: str = ""
    data: Mapping[str, object] = field(default_factory=dict)
    versions: Mapping[str, str] = field(default_factory=dict)
    """Besides those of Python and PACKAGES: the peers'."""
    machine: Mapping[str, object] = field(default_factory=lambda: machine())
    command: str = ""
    date: str = ""

    def to_json(self) -> Json:
        """The file's content."""
        return {
            "benchmark": self.name,
            "title": self.title,
            "command": self.command or command(),
            "date": self.date or date.today().isoformat(),
            "machine": dict(self.machine),
            "versions": {**versions(), **self.versions},
            "circumstances": self.circumstances,
            "rows": [row.to_json() for row in self.rows],
            "text": self.text,
            "data": dict(self.data),
        }


def machine() -> Json:
    """Processor, memory, kernel and Python; `load` is the machine's at this moment."""
    return {
        "cores": os.cpu_count(),
        "cpu": platform.machine(),
        "system": platform.platform(terse=True),
        "load": round(os.getloadavg()[0], 1),
    }


def versions(packages: Iterable[str] = PACKAGES) -> dict[str, str]:
    """Of Python and of those packages that are installed."""
    found = {"python": platform.python_version()}
    for name in packages:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def command() -> str:
    """The command line, without output options."""
    words = [f"benchmarks/{Path(sys.argv[0]).name}"]
    skip = False
    for word in sys.argv[1:]:
        if word.startswith("--") or not skip:
            skip = word in ("--json", "--circumstances")
            if not skip and not word.startswith(("--json=", "--circumstances=")):
                words.append(word)
        else:
            skip = False
    return f"python {shlex.join(words)}"


def argument_parser(doc: str | None) -> argparse.ArgumentParser:
    """A parser with what every script takes."""
    parser = argparse.ArgumentParser(description=(doc or "").partition("\n")[0])
    parser.add_argument(
        "--json",
        nargs="?",
        const="",
        metavar="FILE",
        help="write the result; without FILE to benchmarks/results/",
    )
    parser.add_argument("--circumstances", default="", help="what else the machine was doing")
    return parser


def finish(result: Result, options: argparse.Namespace) -> None:
    """Print the result, and write it if that was asked for."""
    circumstances = "; ".join(
        words for words in (result.circumstances, options.circumstances) if words
    )
    result = replace(result, circumstances=circumstances)
    for row in result.rows:
        print(line(row))
    if options.json is not None:
        path = Path(options.json) if options.json else RESULTS / f"{result.name}.json"
        write(result, path)
        print(f"written to {path}; now: python benchmarks/report.py")


def line(row: Metric) -> str:
    """A row for the terminal."""
    value = "not measured" if row.value is None else f"{row.value:g} {row.unit}".strip()
    bar = f"  (bar {row.bar}: {'met' if row.met else 'NOT met'})" if row.met is not None else ""
    return f"{row.what}: {value}{bar}" + (f"  {row.note}" if row.note else "")


def write(result: Result, path: Path) -> None:
    """Write the file; what its rows were `before` is kept from the file that is there."""
    content = result.to_json()
    if path.exists():
        known = {r["what"]: r for r in json.loads(path.read_text(encoding="utf-8"))["rows"]}
        for row in content["rows"]:
            kept = known.get(row["what"], {}).get("before")
            if kept is not None:
                row.setdefault("before", kept)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
