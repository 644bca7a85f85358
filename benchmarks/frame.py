"""The frame of all benchmarks: figures with their bars, result files, and the page made of them.

    python benchmarks/frame.py            writes docs/benchmarks.md from benchmarks/results/*.json

A script measures and hands over a `Result`:

    def measure(requests: int = 300, rounds: int = 6) -> Result: ...

    if __name__ == "__main__":
        main(wire=measure)

Keyword arguments are the options of its command line; where a script measures several things, the
first word says which. With `--json` the result is kept in `benchmarks/results/NAME.json`. Whether a
bar is met is computed from the numbers, never written by hand. What could not be measured, such as
a peer that does not install, is a figure without value whose note says why.
"""

from __future__ import annotations

import argparse
import inspect
import json
import os
import platform
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import date
from functools import partial
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from robospa.harness.pool import JobProcess, Pool
from robospa.text import markdown_table

ROOT = Path(__file__).resolve().parents[1]
RESULTS = ROOT / "benchmarks" / "results"
PAGE = ROOT / "docs" / "benchmarks.md"
sys.path.append(str(ROOT / "tests" / "helpers"))  # a world without physics, a made-up archive
PACKAGES = ("numpy", "msgpack", "websockets", "sapien")
ORDER = ["wire", "step", "batching", "physics", "rendering", "throughput", "parallel"]
"""The page's order; what is not named comes after, by name."""
HEAD = """# Benchmarks

Each figure stands beside a bare limit or a peer measured in the same run. `python
benchmarks/NAME.py --json` measures again, keeps the result in `benchmarks/results/` and writes this
page. All figures are from two x86-64 cores without a GPU, with Python 3.11, numpy 2.4, SAPIEN 3.0.3
and websockets 17.4; *load* is the machine's load average after a measurement.
"""
Json = dict[str, Any]


@dataclass(frozen=True)
class Figure:
    """One figure. `at_most` or `at_least` is its bar in the same unit, if it has one."""

    what: str
    value: float | None
    unit: str = ""
    at_most: float | None = None
    at_least: float | None = None
    note: str = ""
    command: str = ""
    """If another than the result's."""

    @property
    def bar(self) -> str:
        """The bar in words, "" without one."""
        if self.at_most is not None:
            return f"<= {number(self.at_most)}"
        return "" if self.at_least is None else f">= {number(self.at_least)}"

    @property
    def met(self) -> bool | None:
        """True if the bar is met; None without a bar or a value."""
        if self.value is None or not self.bar:
            return None
        if self.at_most is not None:
            return self.value <= self.at_most
        return self.at_least is not None and self.value >= self.at_least

    def __str__(self) -> str:
        verdict = "" if self.met is None else f"  ({self.bar}: {'met' if self.met else 'NOT met'})"
        return f"{self.what}: {measured(self)}{verdict}" + (f"  {self.note}" if self.note else "")


@dataclass(frozen=True)
class Result:
    """The figures of one measurement.

    `text` is Markdown for the page, `circumstances` what else ran and how often was measured,
    `versions` are the peers', `data` any details that are kept and not shown.
    """

    title: str
    figures: Sequence[Figure]
    text: str = ""
    circumstances: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)
    data: Mapping[str, object] = field(default_factory=dict)
    files: Mapping[Path, str] = field(default_factory=dict)
    """Written beside the result."""

    def to_json(self, name: str, command: str) -> Json:
        """The file's content."""
        rows = [{k: v for k, v in asdict(f).items() if v not in ("", None)} for f in self.figures]
        return {
            "benchmark": name,
            "title": self.title,
            "command": command,
            "date": date.today().isoformat(),
            "machine": {
                "cores": os.cpu_count(),
                "cpu": platform.machine(),
                "system": platform.platform(terse=True),
                "load": round(os.getloadavg()[0], 1),
            },
            "versions": {**_versions(), **self.versions},
            "circumstances": self.circumstances,
            "rows": [{"value": None, **row} for row in rows],
            "text": self.text,
            "data": dict(self.data),
        }


def _versions() -> dict[str, str]:
    found = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


# ---------------------------------------------------------------- the command line


def main(**measures: Callable[..., Result]) -> None:
    """Measure what the command line asks for, print it, and with `--json` keep it."""
    parser = argparse.ArgumentParser(description=sys.modules["__main__"].__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    several = parser.add_subparsers(dest="name", required=True) if len(measures) > 1 else None
    for name, measure in measures.items():
        own = several.add_parser(name) if several else parser
        own.add_argument("--json", action="store_true", help="keep the result, write the page")
        own.add_argument("--circumstances", default="", help="what else the machine was doing")
        for option in inspect.signature(measure).parameters.values():
            switch = isinstance(option.default, bool)
            how: Json = {"action": "store_true"} if switch else {"type": type(option.default)}
            own.add_argument(f"--{option.name.replace('_', '-')}", default=option.default, **how)
    options = vars(parser.parse_args())
    name = options.pop("name", None) or next(iter(measures))
    keep, circumstances = options.pop("json"), options.pop("circumstances")
    result = measures[name](**options)
    for figure in result.figures:
        print(figure)
    if keep:
        made = result.to_json(name, command(sys.argv))
        made["circumstances"] = "; ".join(w for w in (result.circumstances, circumstances) if w)
        text = json.dumps(made, indent=1, ensure_ascii=False)
        for path, content in {**result.files, RESULTS / f"{name}.json": text + "\n"}.items():
            path.write_text(content, encoding="utf-8")
        PAGE.write_text(page(load()), encoding="utf-8")


def command(words: Sequence[str]) -> str:
    """A command line without its output options."""
    kept = [f"benchmarks/{Path(words[0]).name}"]
    rest = iter(words[1:])
    for word in rest:
        if word == "--circumstances":
            next(rest, None)
        elif word != "--json":
            kept.append(word)
    return f"python {shlex.join(kept)}"


def gather(
    path: Path, jobs: Sequence[tuple[Any, ...]], run: Callable[..., Json], workers: int = 1
) -> list[SimpleNamespace]:
    """What `run(*job)` gives for each job, with the job, as objects with these attributes.

    Finished ones are kept in `path`, one JSON line each: stopped anywhere, the same command goes on
    there. Several workers find `run` in its script by its name.
    """
    lines = path.read_text(encoding="utf-8").splitlines() if path.exists() else []
    known = {tuple(row["job"]): row for row in map(json.loads, lines)}
    left = [job for job in jobs if job not in known]
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("a", encoding="utf-8") as file:
        for n, (job, found) in enumerate(zip(left, _mapped(run, left, workers), strict=True), 1):
            known[job] = {"job": job, **found}
            file.write(json.dumps(known[job]) + "\n")
            file.flush()
            print(f"{n}/{len(left)} {job}: {found}", file=sys.stderr, flush=True)
    return [SimpleNamespace(**{**known[job], "job": job}) for job in jobs]


def _mapped(run: Callable[..., Json], jobs: Sequence[tuple[Any, ...]], workers: int) -> Any:
    if workers == 1:
        yield from (run(*job) for job in jobs)
        return
    place = (Path(inspect.getfile(run)).stem, run.__name__)
    with Pool(partial(JobProcess, _spread, place, name="benchmark"), workers) as pool:
        yield from (future.result() for future in [pool.submit(job) for job in jobs])


def _spread(place: tuple[str, str]) -> Callable[[tuple[Any, ...]], Json]:
    run = getattr(import_module(place[0]), place[1])
    return lambda job: run(*job)


# ---------------------------------------------------------------- the page


def number(value: float | None) -> str:
    """Four digits or more, and thousands apart."""
    if value is None:
        return "not measured"
    return f"{value:,.0f}" if isinstance(value, int) or abs(value) >= 1000 else f"{value:.4g}"


def measured(figure: Figure) -> str:
    """Value and unit."""
    return f"{number(figure.value)} {figure.unit if figure.value is not None else ''}".strip()


def load() -> list[Json]:
    """All results in the page's order."""
    found = [json.loads(path.read_text(encoding="utf-8")) for path in RESULTS.glob("*.json")]
    place = {name: i for i, name in enumerate(ORDER)}
    return sorted(found, key=lambda r: (place.get(r["benchmark"], len(ORDER)), r["benchmark"]))


def figures(result: Json) -> list[Figure]:
    """The figures of a file."""
    return [Figure(**row) for row in result["rows"]]


def page(results: Sequence[Json]) -> str:
    """The whole page."""
    bars = [(result, figure) for result in results for figure in figures(result) if figure.bar]
    missed = [f"[{f.what}](#{r['benchmark']})" for r, f in bars if not f.met]
    met = f"{len(bars) - len(missed)} of {len(bars)} bars are met. Not met: {'; '.join(missed)}."
    return "\n\n".join([HEAD + "\n" + met, *map(section, results)]) + "\n"


def section(result: Json) -> str:
    """One measurement: its text, its table, its command."""
    rows = []
    for figure in figures(result):
        verdict = {True: "met", False: "**not met**", None: ""}[figure.met]
        source = f"`{figure.command}`" if figure.command else ""
        note = "; ".join(words for words in (figure.note, source) if words)
        cells = (figure.what, measured(figure), f"{figure.bar} {verdict}".strip(), note)
        rows.append([cell.replace("|", "\\|") for cell in cells])
    load = result["machine"].get("load")
    about = [f"`{result['command']}`, {result['date']}" + (f", load {load}" if load else "")]
    others = {k: v for k, v in result["versions"].items() if k not in ("python", *PACKAGES)}
    about += [", ".join(f"{name} {value}" for name, value in others.items())]
    about += [result["circumstances"]]
    head = f'<a id="{result["benchmark"]}"></a>\n\n## {result["title"]}'
    table = markdown_table(("what", "measured", "bar", "note"), rows)
    parts = (head, result["text"].strip(), table, "; ".join(w for w in about if w) + ".")
    return "\n\n".join(part for part in parts if part)


if __name__ == "__main__":
    PAGE.write_text(page(load()), encoding="utf-8")
