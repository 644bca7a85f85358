"""Names, messages and instructions are text in every output: never markup, links or formulas."""

from __future__ import annotations

import io
import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree import ElementTree

import pytest
from fake_runs import outcomes, write

from robospa.harness.cli.main import main
from robospa.harness.progress import Progress
from robospa.harness.running.status import ServerStats, Status
from robospa.results.figures.charts import draw_levels, draw_radar
from robospa.results.figures.series import Series, save, styled
from robospa.results.records.runs import Run
from robospa.results.report.page import inline_svg
from robospa.results.report.score_table import score_table
from robospa.results.scoring.scores import score_run
from robospa.results.tables import (
    Table,
    TableCell,
    TableRow,
    html_page,
    to_csv,
    to_latex,
    to_markdown,
)
from robospa.text import plain_console

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROOT = Path(__file__).parents[3]
NAMES = [
    "[/bold]",
    "pi0 [lora]",
    "[link=https://evil.org]click[/link]",
    "[red]best[/]",
    "a :boom: b",
    "50% & up | down",
    "=1+1",
    "-2+3",
    "<b>x</b> *y* `z`",
]


def named(folder: Path, name: str) -> Run:
    """A run of a policy called `name`, whose sentences and messages say the same."""
    good = outcomes("Pick_Blocks_Size", 1, [1, 0, 1])
    bad = [
        replace(r, end="policy_error", message=name, instruction=name)
        for r in outcomes("Pick_Blocks_Size", 2, [0, 0])
    ]
    lost = replace(bad[0], end="infrastructure", key=replace(bad[0].key, seed=9), message=name)
    settings: dict[str, Any] = {"policy": {"spec": {"name": name}}, "privileged": False}
    about = {"warnings": [name], "policy": {"target": "ws://a", "identity": {"checkpoint": ""}}}
    return write(folder, [*good, *bad, lost], settings=settings, about=about)


@pytest.fixture(params=NAMES)
def name(request: pytest.FixtureRequest) -> Iterator[str]:
    yield request.param


def output(capsys: pytest.CaptureFixture[str], *words: str | Path) -> str:
    """What a command prints; its exit code may be 1, but not by an exception."""
    with pytest.raises(SystemExit) as stop:
        main([*map(str, words)])
    said = capsys.readouterr()
    assert "MarkupError" not in said.err and "Traceback" not in said.err
    assert not said.err.startswith("robospa: "), said.err
    assert stop.value.code in (None, 0, 1)
    return said.out


@pytest.fixture
def no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Reports without pictures: those with all names are drawn by a test of their own."""
    monkeypatch.setattr("robospa.results.report.report.draw", lambda *given: [])


@pytest.mark.usefixtures("no_figures")
def test_every_command_prints_names_as_they_are(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    run, other = tmp_path / name.replace("/", "|"), tmp_path / "other"
    named(run, name)
    named(other, "plain")
    assert name in output(capsys, "report", run)
    assert run.name in output(capsys, "compare", run, other, "--variants", "--drops")
    output(capsys, "report", run, other, "--lint")
    output(capsys, "report", run, "--failures")
    assert _unescaped(name) in _unescaped(output(capsys, "report", run, "--failures", "--trials"))
    page = (run / "report" / "report.html").read_text()
    assert "<b>x" not in page and 'evil.org"' not in page


@pytest.mark.parametrize("make", [draw_radar, draw_levels])
def test_figures_in_the_page_hold_names_as_text(
    tmp_path: Path, make: Callable[[Sequence[Series]], Figure]
) -> None:
    shown = []
    for number, name in enumerate(NAMES):
        run = named(tmp_path / str(number), name)
        shown.append(Series(name, score_run(run), tuple(run.records.values())))
    with styled():
        save(make(shown), tmp_path, "drawn", ("svg",))
    svg = (tmp_path / "drawn.svg").read_text()
    page = inline_svg(svg, "drawn", NAMES[2])
    ElementTree.fromstring(svg)  # no name breaks the file
    assert "<b>x" not in page and 'evil.org"' not in page


def _unescaped(text: str) -> str:
    return re.sub(r"\\(.)", r"\1", text)


def test_all_formats_of_a_table_hold_the_name(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    run = named(tmp_path / "run", name)
    table = score_table(run, score_run(run))
    rows = (TableRow(name, (TableCell(name),)), TableRow(name, kind="section"))
    table = Table("t", name, name, (name,), rows, ((name, 1),), (name, table.title), words=True)
    (line, *_) = to_csv([table]).splitlines()[1:]
    assert not any(re.match(r"[=+@-]", cell) for cell in line.split(",")), line
    text = to_markdown(table)
    assert _unescaped(text).count(name) >= 6
    for row in [r for r in text.splitlines() if r.startswith("|")]:
        assert len(re.findall(r"(?<!\\)\|", row)) == 3, row
    found = html_page([table], name)
    assert "<b>x" not in found
    made = to_latex(table)
    assert not re.search(r"(?<!\\)%", made.replace("{%\n", "")) or "%" not in name
    assert "evil.org" not in name or r"\textless" not in made
    capsys.readouterr()
    from robospa.results.tables import show

    show(table)
    assert capsys.readouterr().out.count(name) >= 6


def test_the_live_view_prints_names_as_they_are(name: str) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    stream = Terminal()
    server = ServerStats(name, frozenset({name}))
    server.task = name
    status = Status(0.0, workers=1, running=1, cores=1, servers=(server,))
    with Progress(3, stream=stream) as progress:
        progress.note(name)
        progress._shown = float("-inf")
        progress.update(status)
    plain = re.sub(r"\x1b\[[0-9;?]*[A-Za-z]", "", stream.getvalue())
    assert plain.count(name[:20]) >= 2, "as a note and as a server"
    assert "\x1b]8" not in stream.getvalue(), "a link"


def test_a_console_is_made_in_one_place_alone() -> None:
    places = [
        path.relative_to(ROOT).as_posix()
        for folder in ("robospa", "harness", "results", "leaderboard", "protocol", "clients")
        for path in (ROOT / folder).rglob("*.py")
        if not (folder == "robospa" and len(path.relative_to(ROOT).parts) > 2)
        and re.search(r"\bConsole\(|rich\.markup|markup=True", path.read_text())
    ]
    assert places == ["robospa/terminal.py"]


def test_a_console_takes_nothing_for_markup(capsys: pytest.CaptureFixture[str], name: str) -> None:
    plain_console().print(name)
    assert capsys.readouterr().out.strip() == name
