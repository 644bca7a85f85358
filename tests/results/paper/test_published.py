"""The published results are whole, and every printed cell is accounted for."""

import csv
import io
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest
from fake_runs import outcomes, record, run_of

from robospa.results.comparison.compare import compare_results
from robospa.results.paper import published, rounding
from robospa.results.paper.check import checks, errata
from robospa.results.paper.columns import Column, published_column, published_results, run_column
from robospa.results.paper.origin import (
    ORIGIN,
    RANKED,
    banner,
    origin_of,
    pieces_of,
    printed_note,
    told,
)
from robospa.results.paper.published import LEVELS, load
from robospa.results.paper.tables import make_tables
from robospa.results.records.runs import Run
from robospa.results.report.report import make_report
from robospa.results.scoring.models import IncomparableError
from robospa.results.tables import Table, to_csv
from robospa.tasks.scene import SUITE as OURS
from robospa.trial import CATEGORIES, CATEGORY_NAMES

DATA = load()


def test_the_data_hold_every_task_model_and_level() -> None:
    assert list(DATA.models) == ["RDT", "GO-1", "pi0.5", "X-VLA"]
    assert [len(DATA.members[c]) for c in CATEGORIES] == [4, 5, 5, 5, 5, 4, 8, 7, 8, 5]
    assert all(len(task.counts) == 5 for task in DATA.tasks.values())


def test_all_cells_of_all_result_tables_are_walked_once() -> None:
    found = Counter(check.table for check in checks())
    assert found == {
        "per-task SR": 1120,
        "per-task ONTA": 480,
        "per-task PS": 640,
        "main": 156,
        "ONTA": 72,
        "PS": 72,
        "intervals": 36,
        "embodiments": 150,
        "basic grounding": 15,
        "model sizes": 4,
        "assets": 2,
    }
    places = Counter((c.source, c.row, c.model, c.column) for c in checks())
    assert set(places.values()) == {1}


def printed_cells() -> Iterator[tuple[str, str, str, str, str]]:
    """(table, row, group, column, printed digits) of every value that our tables redraw."""
    names = {model: published.title(model) for model in DATA.models}
    labels = {"spatial": "Average", "procedural": "Average", "overall": "Overall average"}
    labels.update(CATEGORY_NAMES)
    for name, table in (("main", DATA.main), ("onta", DATA.onta), ("ps", DATA.ps)):
        for row, by_model in table.rows.items():
            section = row if name == "main" and row in ("spatial", "procedural") else ""
            for model, values in by_model.items():
                for column, value in zip(table.columns, values, strict=True):
                    yield name, labels[row] + section, names[model], column, f"{value:.1f}"
    for (model, metric), per_task in DATA.per_task.items():
        for task, row_values in per_task.rows.items():
            for level, value in zip(LEVELS, row_values, strict=True):
                text = f"{value:.0f}" if metric == "sr" else f"{value:.1f}"
                label = DATA.tasks[task].title
                yield f"{metric}-tasks", label, names[model], f"L{level}", text


def test_our_tables_print_every_cell_to_the_digit_or_mark_it() -> None:
    columns = [published_column(model) for model in DATA.models]
    names = ["main", "onta", "ps", "sr-tasks", "onta-tasks", "ps-tasks"]
    text = to_csv(make_tables(columns, names, mark="none"))
    sections = {
        "Fine-Grained Spatial Reasoning": "spatial",
        "Long-Horizon Procedural Planning": "procedural",
    }
    ours = {}
    for row in csv.DictReader(io.StringIO(text)):
        label = row["row"]
        if row["table"] == "main" and label == "Average":
            label += sections[row["section"]]
        ours[row["table"], label, row["group"], row["column"]] = (row["text"], row["sign"])
    walked, marked = 0, []
    for *place, printed in printed_cells():
        shown, sign = ours.pop(tuple(place))  # type: ignore[arg-type]
        walked += 1
        if sign:
            marked.append(place)
        else:
            assert shown == printed, place
    assert ours == {}
    assert walked == 2240 + 156 + 72 + 72
    assert len(marked) == len(errata())


def test_interval_ends_are_within_the_noise_of_the_bootstrap() -> None:
    ends = [c for c in checks() if c.table == "intervals" and c.column != "value"]
    off = [abs(c.printed - c.recomputed) for c in ends]
    assert len(off) == 24
    assert sum(off) / len(off) <= 0.03
    assert max(off) < 0.1 and sum(d <= 0.05 for d in off) >= 20


def test_the_paper_shades_the_highest_printed_values() -> None:
    for table in (DATA.main, DATA.onta, DATA.ps):
        for row, by_column in table.best.items():
            for column, shaded in by_column.items():
                place = table.columns.index(column)
                values = {m: v[place] for m, v in table.rows[row].items()}
                assert list(shaded) == [m for m, v in values.items() if v == max(values.values())]


KNOWN = [  # from a separate check of the paper's tables: table, row, model, column, printed, right
    ("main", "CAC", "GO-1", "L1", 24.2, 29.25),
    ("main", "CAC", "GO-1", "L5", 2.6, 2.25),
    ("main", "CAC", "GO-1", "Drop", 21.6, 27.0),
    ("main", "procedural", "GO-1", "L1", 29.3, 30.32),
    ("main", "procedural", "GO-1", "Drop", 22.3, 23.36),
    ("main", "overall", "GO-1", "L1", 25.1, 25.61),
    ("main", "overall", "GO-1", "Drop", 16.3, 16.83),
    ("main", "RRR", "X-VLA", "Drop", 28.2, 26.2),
    ("main", "CAC", "X-VLA", "L1", 58.9, 57.38),
    ("main", "CAC", "X-VLA", "L5", 5.9, 5.5),
    ("main", "CAC", "X-VLA", "Drop", 53.0, 51.88),
    ("main", "procedural", "X-VLA", "L1", 58.8, 58.55),
    ("main", "procedural", "X-VLA", "Drop", 42.9, 42.68),
    ("main", "overall", "X-VLA", "L1", 50.4, 50.23),
    ("main", "overall", "X-VLA", "Drop", 30.5, 30.35),
    ("PS", "CAC", "GO-1", "L1", 24.2, 29.25),
    ("PS", "CAC", "GO-1", "L3", 26.2, 24.96),
    ("PS", "CAC", "GO-1", "L5", 22.7, 22.51),
    ("PS", "procedural", "GO-1", "L1", 29.3, 30.32),
    ("PS", "procedural", "GO-1", "L3", 26.0, 25.76),
    ("per-task ONTA", "Pick Mixed Objects Distance B", "pi0.5", "L4", 22.0, 6.4),
    ("per-task PS", "Click Open Place", "X-VLA", "L1", 15.0, 3.0),
]


@pytest.fixture
def edited(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """A function that changes the published data for one test."""
    read = published._content

    def edit(name: str, change: Any) -> None:
        def changed(asked: str) -> dict[str, Any]:
            data = read(asked)
            if asked == name:
                change(data)
            return data

        monkeypatch.setattr(published, "_content", changed)
        published.load.cache_clear()
        checks.cache_clear()

    yield edit
    monkeypatch.undo()
    published.load.cache_clear()
    checks.cache_clear()


def test_the_errata_are_the_known_ones_and_nothing_else() -> None:
    found = {(c.table, c.row, c.model, c.column): c for c in errata()}
    assert set(found) == {known[:4] for known in KNOWN}
    assert len(errata()) == len(KNOWN) == 22
    for *place, printed, right in KNOWN:
        check = found[tuple(place)]  # type: ignore[index]
        assert check.printed == printed
        assert check.recomputed == pytest.approx(right, abs=0.081)  # a drop is of rounded values


def test_a_new_misprint_in_a_task_spreads_to_what_follows_from_it(edited: Any) -> None:
    def change(data: dict[str, Any]) -> None:
        data["tables"]["tab:appendix-rdt-success"]["rows"]["Pick_Blocks_Size"][4] = 91

    edited("per_task.json", change)
    new = {(c.table, c.row, c.column) for c in errata() if c.model == "RDT"}
    assert ("main", "GAC", "L5") in new
    assert ("ONTA", "GAC", "L5") in new
    assert ("per-task ONTA", "Pick Blocks Size", "L5") in new
    assert ("intervals", "overall", "low") in new


def test_other_robots_must_agree_where_they_are_the_same(edited: Any) -> None:
    def change(data: dict[str, Any]) -> None:
        data["rows"]["aloha-agilex"]["MIP-3"][1] = 9

    edited("embodiments.json", change)
    (new,) = (c for c in errata() if c.table == "embodiments")
    assert (new.row, new.column, new.printed, new.recomputed) == ("MIP-3", "L3", 9, 8)


@pytest.mark.parametrize(
    ("value", "shown"),
    [(4.75, "4.8"), (20.25, "20.3"), (25.25, "25.3"), (-0.04, "0.0"), (-7.55, "-7.6"), (0, "0.0")],
)
def test_values_are_rounded_half_away_from_zero(value: float, shown: str) -> None:
    assert rounding.text(value) == shown


def test_a_drop_is_the_difference_of_printed_values() -> None:
    assert rounding.drop(10.0, 4.75) == 5.2
    assert rounding.drop(None, 4.75) is None


def test_a_mean_of_something_missing_is_missing() -> None:
    assert rounding.mean([1.0, None]) is None
    assert rounding.mean([]) is None
    found = rounding.summary({"a": 10.0, "b": 20.0, "c": 40.0}, {"GAC": ["a", "b"], "RPF": ["c"]})
    assert found == {"GAC": 15.0, "RPF": 40.0, "spatial": 15.0, "procedural": 40.0, "overall": 27.5}


def test_progress_is_recovered_from_its_printed_form() -> None:
    assert rounding.exact_progress(39.3, 3) == pytest.approx(118 / 3)
    assert rounding.exact_progress(6.3, 5) == 6.3  # no mean of fifths


# --- runs of official worlds beside the paper: ranked with it, never with this benchmark's own suit


ARCHIVE = {
    "layout": {"assets": "official", "digest": "0123456789abcdef", "switches": ["pale-stand"]},
    "world": {"arguments": {"settle": "official", "robot_assets": "official"}},
    "instructions": "fedcba9876543210",
}
BUILTIN = {
    "layout": {"assets": "builtin", "digest": "", "switches": []},
    "world": {"arguments": {"settle": "usual"}},
}
WORLDS = {
    "official-1": ("official-1", ARCHIVE),
    "plain": ("official-1", {**ARCHIVE, "instructions": "", "world": {}}),
    "builtin": ("official-1-builtin", BUILTIN),
    "ours": (OURS, {"split": ["heldout", "train"]}),
    "ours, their sentences": (OURS, {"instructions": "fedcba9876543210"}),
}
SAID = {
    "official-1": (
        ["objects (archive 0123456789ab)", "quirks of scenes (pale-stand)", "the start after 11 s",
         "sentences (hash fedcba987654)", "the robot's meshes (thinned)"],
        ["boxes, pads, covers", "other draws of layouts", "other seeds", "another renderer"],
    ),
    "plain": (
        ["objects (archive 0123456789ab)"],
        ["other sentences", "other robot meshes", "another start (when nothing moves)"],
    ),
    "builtin": ([], ["other object meshes", "other sentences", "other robot meshes"]),
    "ours": (
        ["layouts"],
        ["other object meshes", "other sentences (heldout: stricter; train: comparable)"],
    ),
    "ours, their sentences": (["sentences (hash fedcba987654)"], ["other object meshes"]),
}  # fmt: skip


def run_in(world: str, name: str = "mine", successes: int = 3) -> Run:
    """Four trials of two variants: `successes` of Pick_Blocks_Size L1, none of the other, of which
    RDT has 3 % as printed."""
    suite, settings = WORLDS[world]
    records = outcomes("Pick_Blocks_Size", 1, [1] * successes + [0] * (4 - successes))
    records += [record("Press_Stapler_Repeat", 2, n, 0, 2) for n in range(4)]
    said: dict[str, Any] = {"policy": {"spec": {"name": name}}, "privileged": False, **settings}
    return run_of(records, name, settings=said, suite=suite)


def column_in(world: str, name: str = "mine", successes: int = 3) -> Column:
    return run_column(run_in(world, name, successes))


def marked(table: Table) -> set[tuple[str, str]]:
    """Task and model of every mark."""
    models = [title for title, width in table.groups for _ in range(width)]
    return {
        (line.label, model)
        for line in table.rows
        for model, cell in zip(models, line.cells, strict=False)
        if cell.best
    }


@pytest.mark.parametrize("world", WORLDS)
def test_what_is_official_is_said_piece_by_piece(world: str) -> None:
    official, other = SAID[world]
    found = pieces_of(column_in(world).results)
    assert all(any(text in piece for piece in found.official) for text in official)
    assert all(any(text in piece for piece in found.other) for text in other)
    sentence = told(column_in(world).results)
    assert all(text in sentence for text in (*official, *other, WORLDS[world][0]))


@pytest.mark.parametrize("world", WORLDS)
def test_runs_of_official_worlds_are_ranked_with_the_paper_and_ours_are_not(world: str) -> None:
    columns = [column_in(world), published_column("RDT", "RDT (paper)")]
    (table,) = make_tables(columns, ["sr-tasks"], "highest")
    note = " ".join(table.notes)
    if world.startswith("ours"):
        assert not marked(table) and "another suite, with other object meshes" in note
        assert ("other sentences" in note) == (world == "ours")
    else:
        assert ("Pick Blocks Size", "mine") in marked(table)
        assert ("Press Stapler Repeat", "RDT (paper)") in marked(table)
        assert RANKED in note and "another suite" not in note
        assert all(text in note for text in SAID[world][0])


@pytest.mark.parametrize("world", WORLDS)
def test_banners_reports_and_comparisons_say_the_same(world: str) -> None:
    own = column_in(world).results
    line = compare_results(own, published_results("RDT")).banner
    assert line == banner(["RDT"], [own]) and line.startswith("RDT was") != world.startswith("ours")
    report = make_report(run_in(world), ["RDT"])
    assert report.banner[0] == banner(["RDT (paper)"], report.models[:1])
    assert report.method[0] == origin_of(report.models[:1])
    assert (report.method[0] == ORIGIN) == world.startswith("ours")
    assert all(text in printed_note([own]) for text in SAID[world][1])


@pytest.mark.parametrize("world", [name for name in WORLDS if not name.startswith("ours")])
@pytest.mark.parametrize("name", ["sr-tasks", "embodiments-spatial", "basic"])
def test_no_table_mixes_an_official_world_with_our_suite(world: str, name: str) -> None:
    columns = [column_in(world), column_in("ours", "other")]
    for more in ([], [published_column("RDT")]):
        with pytest.raises(IncomparableError, match=f"never beside other of {OURS}"):
            make_tables([*columns, *more], [name])


def test_official_worlds_stand_side_by_side_only_with_the_paper() -> None:
    """Beside the paper each says what it is; a table of two of them alone would compare worlds."""
    columns = [column_in("official-1"), column_in("builtin", "other", 0)]
    (table,) = make_tables([*columns, published_column("RDT")], ["sr-tasks"], "highest")
    assert ("Pick Blocks Size", "mine") in marked(table)
    assert "mine (official-1) has" in table.notes[0]
    assert "other (official-1-builtin) has" in table.notes[0]
    with pytest.raises(IncomparableError, match="the suites official-1 and official-1-builtin"):
        make_tables(columns, ["sr-tasks"])
