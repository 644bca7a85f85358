"""A run's folder becomes tables and a page; text from outside stays text."""

import json
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fake_runs import EVIL, KNOWN, RECORDS, make_run, shown, write

from robospa.results.comparison.compare import compare_results
from robospa.results.paper.published import load
from robospa.results.records.runs import film_name
from robospa.results.records.trial_record import EventRow
from robospa.results.report.page import page, panels, write_report
from robospa.results.report.report import make_report
from robospa.results.report.run_card import percent
from robospa.results.report.trials import event_row, happened
from robospa.results.scoring.models import IncomparableError, results_of_run
from robospa.results.statistics.intervals import Estimate, wilson

pytestmark = pytest.mark.usefixtures("same_figures_once")


def trials_of(folder: Path) -> list[dict[str, Any]]:
    """The list of trials that the page's script reads."""
    page = (folder / "report.html").read_text()
    text = page.split('<script type="application/json" id="data">')[1].split("</script>")[0]
    return list(json.loads(text)["trials"])


@pytest.fixture(scope="module")
def known(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The report of the known trials."""
    folder = tmp_path_factory.mktemp("known")
    return write_report(make_report(make_run(folder / "run", KNOWN)), folder / "report")


def test_the_report_holds_what_other_programs_need(known: Path) -> None:
    data = json.loads((known / "report.json").read_text())["runs"][0]
    cell = data["variants"]["Pick_Blocks_Size"]["L1"]
    assert (cell["trials"], cell["successes"], cell["missing"]) == (4, 3, 0)
    for metric in ("sr", "sr1"):
        assert cell[metric] == pytest.approx([0.75, wilson(3, 4).low, wilson(3, 4).high])
    assert cell["onta"][0] == cell["onta1"][0] == pytest.approx((0.75 - 0.5) / 0.5)
    press = data["variants"]["Press_Stapler_Repeat"]["L2"]
    assert (press["ps"][0], press["idle"][0]) == (0.5, 0.0)
    assert data["ends"] == {"success": 3, "step limit": 3}
    assert data["overall"]["mean"]["sr"][0] == pytest.approx(0.375)
    tables = {line.split(",")[0] for line in (known / "tables" / "tables.csv").open()}
    assert {"sr1-tasks", "onta1-tasks", "sr-tasks"} <= tables, tables
    text = (known / "report.md").read_text()
    assert "| Pick Blocks Size | 75 |" in text and "SR@1" in text and "doing nothing" in text


def test_nothing_comes_from_outside_and_its_text_is_no_markup(known: Path) -> None:
    page = (known / "report.html").read_text()
    assert EVIL not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in page
    assert trials_of(known)[4]["message"] == EVIL
    assert EVIL not in (known / "report.md").read_text()
    assert "http" not in page.replace("http-equiv", "")
    assert "@import" not in page
    assert page.count("<svg") >= 4


def test_every_trial_is_listed_with_its_failure_type(tmp_path: Path) -> None:
    lost = replace(KNOWN[0], end="infrastructure", success=False)
    run = make_run(tmp_path / "run", [lost, *KNOWN[1:]], lost=1)
    found = trials_of(write_report(make_report(run), tmp_path / "report"))
    good, bad = ["success"] * 2, ["step limit"] * 2
    assert [t["end"] for t in found] == ["missing", *good, "step limit", "not run", *bad]
    assert ["failure" in t for t in found] == [False, False, False, True, False, True, True]


def cards_of(page: str) -> dict[str, str]:
    """The text of every card of the summary, by its name."""
    found = re.findall(
        r'<div class="card"[^>]*><h3>(.*?)</h3>(.*?)\n</div>\n</div>', page, re.DOTALL
    )
    return {name: " ".join(re.sub("<[^>]*>", " ", text).split()) for name, text in found}


def test_published_models_stand_beside_a_run_over_the_same_variants(tmp_path: Path) -> None:
    """RDT prints 3 % at Pick_Blocks_Size L1 and 3 % at Press_Stapler_Repeat L2: nothing else."""
    report = make_report(make_run(tmp_path / "run", KNOWN), ["RDT"])
    page = (write_report(report, tmp_path / "report") / "report.html").read_text()
    data = load()
    one = data.value("RDT", "sr", "Pick_Blocks_Size", 1)
    two = data.value("RDT", "sr", "Press_Stapler_Repeat", 2)
    assert one is not None and two is not None
    card = cards_of(page)["RDT (paper)"]
    assert card.startswith(f"SR {(one + two) / 2:.1f} %")
    assert "mean over 2 variants, 200 trials" in card
    overall = [model.scores.overall[0].trials for model in report.shared]
    assert overall == [6, 200]
    for table in report.tables:
        shown = [e for line in table.table.rows for e in line.cells if e.text not in ("–", "")]
        assert not any(e.best for e in shown)


def test_a_banner_says_what_differs_before_any_number_of_the_paper(
    known: Path, tmp_path: Path
) -> None:
    report = make_report(make_run(tmp_path / "run", KNOWN), ["RDT", "GO-1"])
    folder = write_report(report, tmp_path / "report")
    for name, number in (("report.html", 'class="cards"'), ("report.md", "| Pick Blocks Size")):
        before = (folder / name).read_text().split(number)[0]
        for word in ("RDT (paper) and GO-1 (paper)", "other seeds", "other object meshes",
                     "another renderer", "other sentences"):  # fmt: skip
            assert word in before, name
    assert "Another suite" not in (known / "report.html").read_text()
    rules = "Tasks, rules, thresholds, layouts, step limits and the robot are"
    assert rules in (known / "report.md").read_text()


def test_of_one_trial_a_cell_no_whiskers_are_drawn(tmp_path: Path) -> None:
    found = {}
    for trials in (1, 3):
        records = [shown("Pick_Blocks_Size", n, s, s > 0) for n in (1, 2) for s in range(trials)]
        run = make_run(tmp_path / str(trials), records)
        (found[trials],) = panels(make_report(run).models)
    ((_, line, none, first),) = found[1]["lines"]
    assert (line, first, none) == ("M10 60.0L35 60.0", "M10 60.0L35 60.0", "")
    assert found[3]["lines"][0][2].count("V") == 2 and found[1]["category"] == "GAC"


def test_variants_that_lack_trials_are_counted_without_the_reasons(tmp_path: Path) -> None:
    made = [shown("Pick_Blocks_Size", n, s, True) for n in range(1, 5) for s in (0, 1)]
    run = write(tmp_path / "run", made, [replace(r.key, seed=900) for r in made[::2]])
    assert "4 variants lack trials" in page(make_report(run), [], tmp_path)


def test_runs_of_different_variants_have_cards_of_what_both_ran(tmp_path: Path) -> None:
    """The second run has all of the first and another level, at which it always fails."""
    more = [shown("Pick_Blocks_Size", 3, n, False) for n in range(4)]
    runs = [make_run(tmp_path / "one", KNOWN), make_run(tmp_path / "two", [*KNOWN, *more])]
    report = make_report(runs)
    assert [len(model.scores.cells) for model in report.models] == [2, 3]
    one, two = (model.scores.overall[0] for model in report.shared)
    assert (one.values, one.trials) == (two.values, two.trials)
    folder = write_report(report, tmp_path / "report")
    assert {t["run"] for t in trials_of(folder)} == {0, 1}
    page = (folder / "report.html").read_text()
    assert "(one)" in page and "(two)" in page
    assert "mean over the 2 of 3 variants that all have, 6 trials" in page
    assert "Over the 2 variants that all have." in page
    apart = make_report([make_run(tmp_path / "three", KNOWN), make_run(tmp_path / "four", more)])
    assert apart.banner == [
        "No variant has results from all of them: each mean covers other variants."
    ]


@pytest.mark.parametrize(
    ("ci", "published", "said", "unsaid"),
    [
        ("wilson", [], ["Wilson's for the rate of one", "bootstrap over trials"], ["Of pub"]),
        ("wilson", ["RDT"], ["Wilson's", "rather too wide"], []),
        ("exact", [], ["Clopper and Pearson's exact for"], ["Wilson"]),
        ("bootstrap", ["RDT"], ["the paper's: a bootstrap", "rather too wide"], ["MOVER"]),
    ],
)
def test_the_note_on_intervals_names_each_method_once(
    tmp_path: Path, ci: str, published: list[str], said: list[str], unsaid: list[str]
) -> None:
    note = " ".join(make_report(make_run(tmp_path / "run", KNOWN), published, ci).method)
    assert all(note.count(words) == 1 for words in said)
    assert not any(words in note for words in unsaid)
    assert note.count("95 % intervals") == 1


def test_a_run_that_fits_no_table_says_why_and_keeps_its_trials(tmp_path: Path) -> None:
    folder = write_report(make_report(make_run(tmp_path / "run", RECORDS)), tmp_path / "report")
    assert "No tables: " in (folder / "report.html").read_text()
    assert len(trials_of(folder)) == 6


def test_videos_are_put_into_the_report_and_nothing_else_is(tmp_path: Path) -> None:
    secret = tmp_path / "secret.mp4"
    secret.write_bytes(b"secret")
    films = [
        replace(RECORDS[0], video="videos/a.mp4"),
        replace(RECORDS[1], video="../secret.mp4"),
        replace(RECORDS[2], video="videos/none.mp4"),
    ]
    run = make_run(tmp_path / "run", films)
    (run.folder / "videos").mkdir()
    (run.folder / "videos" / "a.mp4").write_bytes(b"film")
    folder = write_report(make_report(run), tmp_path / "report")
    assert [p.name for p in (folder / "videos").iterdir()] == ["a.mp4"]
    assert [t.get("video") for t in trials_of(folder)] == ["videos/a.mp4", None, None]


@pytest.mark.parametrize(("going_on", "said"), [(True, "follows"), (False, "owed")])
def test_of_a_film_that_is_wanted_the_report_says_that_it_follows(
    tmp_path: Path, going_on: bool, said: str
) -> None:
    wanted = replace(RECORDS[3], video=film_name(RECORDS[3].key))
    strange = replace(RECORDS[4], video="videos/none.mp4")
    run = make_run(tmp_path / "run", [RECORDS[0], wanted, strange])
    folder = write_report(make_report(replace(run, in_progress=going_on)), tmp_path / "report")
    assert [t.get("film") for t in trials_of(folder)] == [None, said, None]
    assert not any("video" in t for t in trials_of(folder))


def test_a_video_of_a_trial_that_was_run_again_replaces_the_old_one(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", [replace(RECORDS[0], video="videos/a.mp4")])
    (run.folder / "videos").mkdir()
    for content in (b"old", b"new"):
        (run.folder / "videos" / "a.mp4").unlink(missing_ok=True)
        (run.folder / "videos" / "a.mp4").write_bytes(content)
        folder = write_report(make_report(run), tmp_path / "report")
        assert (folder / "videos" / "a.mp4").read_bytes() == content


def test_percent_has_no_negative_zero() -> None:
    assert percent(Estimate(-0.0, -0.00001, 0.1)) == "0.0 [0.0, 10.0]"
    assert percent(None) == "–"


def test_an_event_in_words() -> None:
    event = EventRow(time=1.5, kind="wrong_object", object="object_3", index=1, note="lifted")
    old = shown("Pick_Blocks_Size", 1, 0, False)
    assert event_row(event, old) == [1.5, "wrong object:", "object_3 lifted"]
    new = replace(old, diagnostics={"objects": {"object_3": "the red cup", "object_30": "no"}})
    assert event_row(event, new) == [1.5, "wrong object:", "the red cup lifted"]
    closed = EventRow(time=2.0, kind="closed", object="object_3", index=1, note="touching")
    assert event_row(closed, new) == [2.0, "gripper closed on", "the red cup"]
    step = EventRow(time=3.0, kind="subtask_done", object="", index=1, note="")
    assert event_row(step, new) == [3.0, "step 2 done", ""]
    call = {"skill": "pick", "at": [0.25, 1], "time": 2, "step": 9, "feedback": "out of reach"}
    said = replace(new, events=(step,), diagnostics={**new.diagnostics, "calls": [call]})
    assert happened(said)[0] == [2.0, "called pick at 0.25, 1.00:", "out of reach"]
    forged = replace(said, diagnostics={"calls": [{"skill": ["pick"]}]})
    assert happened(forged) == [event_row(step, forged)]


def test_runs_at_both_ends_are_marked_under_the_bootstrap_too(tmp_path: Path) -> None:
    """Its intervals are [100, 100] and [0, 0]: the test of their difference takes others."""
    task = "Pick_Blocks_Size"
    good, bad = (
        make_run(tmp_path / name, [shown(task, 1, n, success) for n in range(10)])
        for name, success in (("good", True), ("bad", False))
    )
    report = make_report([good, bad], ci="bootstrap")
    cells = [line.cells for shown in report.tables for line in shown.table.rows if line.cells]
    assert cells and all([e.best for e in row] == [True, False] for row in cells)


def test_both_splits_of_a_run_have_a_column_beside_the_paper(tmp_path: Path) -> None:
    records = [replace(r, key=replace(r.key, split=s)) for s in ("train", "heldout") for r in KNOWN]
    report = make_report(make_run(tmp_path / "run", records), ["RDT"])
    table = next(t.table for t in report.tables if t.table.name == "sr-tasks")
    names = [name.rpartition("(")[2] for name, _ in table.groups]
    assert names == ["train)", "heldout)", "paper)"]
    assert "(train: comparable)" in report.banner[0] and "(heldout: stricter)" in report.banner[0]


def test_each_track_has_tables_of_its_own_and_none_is_compared(tmp_path: Path) -> None:
    runs = [
        make_run(
            tmp_path / action,
            [shown("Pick_Blocks_Size", level, n, n < good) for level in (1, 2) for n in range(8)],
            settings={"policy": {"spec": {"name": "model", "action": action}}},
        )
        for action, good in (("skill", 6), ("joint", 2), ("point", 7))
    ]
    report = make_report(runs)
    assert [run.manifest.tracks for run in runs] == [("skills",), ("joints",), ("points",)]
    names = [model.name for model in report.models]
    assert names == ["model (skills)", "model", "model (points)"]
    titles = [one.table.title for one in report.tables]
    assert [t for t in titles if t.endswith("track skills")] and len(titles) % 3 == 0
    marked = [e.best for one in report.tables for row in one.table.rows for e in row.cells]
    assert not any(marked)
    assert "never compared" in " ".join(report.banner)
    sides = [results_of_run(run) for run in runs[:2]]
    with pytest.raises(IncomparableError, match="they ran with the tracks skills and joints"):
        compare_results(*sides)
    page = (write_report(report, tmp_path / "out") / "report.html").read_text()
    assert "Points, skills and joints" in page and 'id="tracks-' in page
