"""The published results are whole, and every printed cell is accounted for."""

from __future__ import annotations

import csv
import io
import json
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

from robospa.results.paper import published
from robospa.results.paper.check import Check, checks, errata
from robospa.results.paper.columns import published_column
from robospa.results.paper.published import LEVELS, load
from robospa.results.paper.tables import make_tables
from robospa.results.tables import to_csv
from robospa.trial import CATEGORIES, CATEGORY_NAMES, SPATIAL

FOLDER = Path(published.__file__).parent
DATA = load()


def test_the_data_hold_every_task_model_and_level() -> None:
    assert list(DATA.models) == ["RDT", "GO-1", "pi0.5", "X-VLA"]
    assert [len(DATA.members[c]) for c in CATEGORIES] == [4, 5, 5, 5, 5, 4, 8, 7, 8, 5]
    assert all(len(task.counts) == 5 for task in DATA.tasks.values())
    sizes = {metric: 0 for metric in ("sr", "onta", "ps")}
    for (_, metric), table in DATA.per_task.items():
        sizes[metric] += sum(len(row) for row in table.rows.values())
    assert sizes == {"sr": 1120, "onta": 480, "ps": 640}


def test_every_file_names_the_table_it_was_read_from() -> None:
    for path in FOLDER.glob("*.json"):
        data = json.loads(path.read_text())
        source = data.get("source") or list(data["tables"])
        labels = source.values() if isinstance(source, dict) else source
        labels = [labels] if isinstance(labels, str) else list(labels)
        assert labels, path.name
        assert all(label.startswith("tab:") for label in labels), path.name


def test_candidates_and_subtasks_per_level() -> None:
    assert DATA.tasks["Pick_Blocks_Distance"].counts == (3, 6, 8, 9, 10)
    assert DATA.tasks["Pick_Seals_Multi_View"].counts == (3, 4, 4, 4, 4)
    subtasks = {t.counts for t in DATA.tasks.values() if t.category not in SPATIAL}
    assert subtasks == {LEVELS}


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
    assert sum(off) / len(off) <= 0.035
    assert max(off) < 0.1


def test_the_paper_shades_the_highest_printed_values() -> None:
    for table in (DATA.main, DATA.onta, DATA.ps):
        for row, by_column in table.best.items():
            for column, shaded in by_column.items():
                place = table.columns.index(column)
                values = {m: v[place] for m, v in table.rows[row].items()}
                assert list(shaded) == [m for m, v in values.items() if v == max(values.values())]


def test_a_check_says_what_was_printed_and_what_follows() -> None:
    check = Check("tab:x", "main", "CAC", "GO-1", "L1", 24.2, 29.3, reason="why")
    assert str(check) == "main, CAC, GO-1, L1: printed 24.2, recomputed 29.3 (why)"
