"""Tables as Markdown, LaTeX, HTML and CSV: whole, and safe with any name from outside."""

import csv
import io
import re
import shutil
import subprocess
from collections.abc import Iterator
from html.parser import HTMLParser
from pathlib import Path

import pytest
from command_line import robospa
from fake_runs import outcomes, record, write

from robospa.harness.progress import Progress
from robospa.harness.running.status import ServerStats, Status
from robospa.results.paper.columns import published_column
from robospa.results.paper.published import load
from robospa.results.paper.tables import FORMATS, TABLES, make_tables, write_tables
from robospa.results.records.runs import Run
from robospa.results.report.run_card import score_table
from robospa.results.scoring.scores import score_run
from robospa.results.tables import (
    Table,
    TableCell,
    TableRow,
    escape_latex,
    html_fragment,
    html_page,
    latex_document,
    show,
    to_csv,
    to_latex,
    to_markdown,
)

EVIL = "=a|b_c & 100% <script>alert(1)</script> \\input{x} $#~^{} “é” 模型"
SMALL = Table(
    "small",
    f"Title {EVIL}",
    "Model",
    ("L1", "L5"),
    (
        TableRow("A section", kind="section"),
        TableRow(
            EVIL,
            (TableCell("12.5", 12.5, 10.0, 15.0, best=True), TableCell("-1.2", -1.2, sign="*†")),
        ),
        TableRow("Average", (TableCell("–"), TableCell(EVIL)), "average"),
    ),
    groups=((EVIL, 2),),
    notes=(f"note {EVIL}",),
)


@pytest.fixture(scope="module")
def tables() -> list[Table]:
    return make_tables([published_column(model) for model in load().models])


def test_every_table_of_the_paper_is_there(tables: list[Table]) -> None:
    assert [g.name for g in tables] == list(TABLES)
    assert {g.name: len([x for x in g.rows if x.kind != "section"]) for g in tables} == {
        "main": 13,
        "onta": 6,
        "ps": 6,
        "intervals": 8,
        "sr-tasks": 56,
        "onta-tasks": 24,
        "ps-tasks": 32,
        "embodiments-spatial": 5,
        "embodiments-procedural": 5,
        "basic": 3,
        "models": 4,
        "datasets": 16,
        "assets": 121,
        "errata": 22,
    }


def latex_columns(line: str) -> int:
    """Columns that a row of a tabular fills."""
    spans = [int(n) for n in re.findall(r"\\multicolumn\{(\d+)\}", line)]
    return len(re.findall(r"(?<!\\)&", line)) + 1 + sum(n - 1 for n in spans)


def test_latex_is_balanced_and_every_row_fills_its_columns(tables: list[Table]) -> None:
    for table in (*tables, SMALL):
        text = to_latex(table)
        bare = re.sub(r"\\[\\{}]", "", text)
        assert bare.count("{") == bare.count("}"), table.name
        begun, ended = (re.findall(rf"\\{word}\{{([a-z*]+)\}}", text) for word in ("begin", "end"))
        assert begun == ended[::-1] == ["table*", "tabular"]
        rows = [x for x in text.splitlines() if x.endswith(r"\\")]
        assert {latex_columns(row) for row in rows} == {len(table.heads) + 1}, table.name
        assert text.isascii(), table.name
    whole = latex_document(tables)
    assert all(whole.count(rf"\{word}{{document}}") == 1 for word in ("begin", "end"))


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="needs pdflatex")
def test_latex_compiles(tables: list[Table], tmp_path: Path) -> None:
    (tmp_path / "all.tex").write_text(latex_document([*tables, SMALL]))
    command = ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "all.tex"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout[-2000:]
    assert "Overfull" not in done.stdout
    assert "too large" not in done.stdout


def test_what_latex_takes_for_commands_is_escaped() -> None:
    assert escape_latex("a_b & 5%") == r"a\_b \& 5\%"
    assert escape_latex(r"\input{x}") == r"\textbackslash{}input\{x\}"
    assert escape_latex("π0.5 é 模") == r"$\pi_{0.5}$ e ?"
    assert "$-1.2$" in to_latex(SMALL)


def test_markdown_rows_have_equal_columns_and_no_markup_from_outside(tables: list[Table]) -> None:
    for table in (*tables, SMALL):
        text = to_markdown(table)
        rows = [x for x in text.splitlines() if x.startswith("|")]
        assert {len(re.findall(r"(?<!\\)\|", row)) for row in rows} == {len(table.heads) + 2}
    text = to_markdown(SMALL)
    assert "**12.5**" in text
    assert "<script" not in text.replace("\\<script", "")


class Tags(HTMLParser):
    """Checks that tags nest and that every row of a table is equally wide."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.widths: list[int] = []
        self.seen: set[str] = set()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.seen.add(tag)
        if tag == "tr":
            self.widths.append(0)
        if tag in ("td", "th"):
            self.widths[-1] += int(dict(attrs).get("colspan") or 1)
        if tag not in ("meta",):
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def test_html_nests_and_takes_nothing_from_outside(tables: list[Table]) -> None:
    for table in (*tables, SMALL):
        reader = Tags()
        reader.feed(html_fragment(table))
        assert reader.open == []
        assert set(reader.widths) == {len(table.heads) + 1}, table.name
        assert "script" not in reader.seen
    whole = html_page([*tables, SMALL], EVIL)
    assert "http" not in whole
    assert 'class="best" title="95 %: 10.0 to 15.0"' in whole


def test_csv_has_a_line_a_cell_with_unrounded_numbers(tables: list[Table]) -> None:
    rows = list(csv.DictReader(io.StringIO(to_csv(tables))))
    assert len(rows) == sum(
        len(line.cells) for table in tables for line in table.rows if line.kind != "section"
    )
    first = rows[0]
    assert (first["table"], first["group"], first["column"]) == ("main", "RDT", "L1")
    cells = {(r["table"], r["group"], r["column"], r["row"]): r for r in rows}
    cell = cells["main", "RDT", "L5", "Geometric Attribute Cognition"]
    assert (cell["text"], cell["value"]) == ("4.8", "4.75")
    small = list(csv.DictReader(io.StringIO(to_csv([SMALL]))))
    assert small[0]["row"] == "'" + EVIL  # a spreadsheet does not run it
    assert (small[0]["best"], small[1]["sign"], small[0]["section"]) == ("best", "*†", "A section")


def test_tables_of_the_wrong_shape_are_refused() -> None:
    with pytest.raises(ValueError, match="wrong length"):
        Table("x", "", "", ("a", "b"), (TableRow("r", (TableCell("1"),)),))
    with pytest.raises(ValueError, match="do not span"):
        Table("x", "", "", ("a", "b"), (), groups=(("g", 3),))


def test_every_format_is_written(tmp_path: Path, tables: list[Table]) -> None:
    written = write_tables(tables[:2], tmp_path / "out", list(FORMATS))
    assert {path.name for path in written} == {
        *(f"tables.{ending}" for ending in FORMATS),
        "main.tex",
        "onta.tex",
    }
    assert all(path.read_text() for path in written)


def test_the_terminal_gets_every_cell(
    capsys: pytest.CaptureFixture[str], tables: list[Table]
) -> None:
    show(tables[0])
    out = capsys.readouterr().out
    assert re.search(r"Overall average +16\.8 +6\.9 +9\.9 +25\.6\* +8\.8", out)


ROOT = Path(__file__).parents[2]
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
    task, said = "Pick_Blocks_Size", {"message": name, "instruction": name}
    good = outcomes(task, 1, [1, 0, 1])
    bad = outcomes(task, 2, [0, 0], end="policy_error", **said)
    lost = record(task, 2, 9, 0, end="infrastructure", **said)
    settings = {"policy": {"spec": {"name": name}}}
    about = {"warnings": [name], "policy": {"target": "ws://a", "identity": {"checkpoint": ""}}}
    return write(folder, [*good, *bad, lost], settings=settings, about=about)


@pytest.fixture(params=NAMES)
def name(request: pytest.FixtureRequest) -> Iterator[str]:
    yield request.param


def output(*words: str | Path) -> str:
    """What a command prints; its exit code may be 1, but not by an exception."""
    done = robospa(*words, columns=80)
    assert "MarkupError" not in done.err and "Traceback" not in done.err
    assert not done.err.startswith("robospa: ") and done.code in (0, 1), done.err
    return done.out


@pytest.mark.usefixtures("no_figures")
def test_every_command_prints_names_as_they_are(tmp_path: Path, name: str) -> None:
    run, other = tmp_path / name.replace("/", "|"), tmp_path / "other"
    named(run, name)
    named(other, "plain")
    assert name in output("report", run)
    assert run.name in output("compare", run, other, "--variants")
    output("report", run, other, "--lint")
    output("report", run, "--failures")
    assert _unescaped(name) in _unescaped(output("report", run, "--failures", "--trials"))
    page = (run / "report" / "report.html").read_text()
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
    assert places == ["robospa/text.py"]
