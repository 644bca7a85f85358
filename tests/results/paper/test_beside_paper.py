"""Runs of official worlds beside the paper: ranked with it, never with this benchmark's own suites,
and every table says piece by piece what of a run is official."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from fake_runs import trial_record

from robospa.results.comparison.compare import compare_results
from robospa.results.paper.columns import Column, published_column, published_results, run_column
from robospa.results.paper.origin import (
    ORIGIN,
    RANKED,
    banner,
    origin_of,
    pieces,
    pieces_of,
    printed_note,
    told,
)
from robospa.results.paper.tables import make_tables
from robospa.results.records.manifest import RunManifest, RunSettings
from robospa.results.records.runs import Run
from robospa.results.report.report import make_report
from robospa.results.scoring.models import IncomparableError
from robospa.results.tables import Table
from robospa.schema import read
from robospa.tasks.scene import SUITE as OURS
from robospa.trial import TrialKey

ARCHIVE = {
    "layout": {"assets": "official", "digest": "0123456789abcdef", "switches": ["pale-stand"]},
    "world": {"arguments": {"settle": "official", "robot_assets": "official"}},
    "instructions": "fedcba9876543210",
}
BUILTIN = {
    "layout": {"assets": "builtin", "digest": "", "switches": []},
    "world": {"arguments": {"settle": "usual"}},
}
CHECKOUT = {"world": {"arguments": {"config": "demo_clean"}}}
WORLDS = {
    "official-1": ("official-1", ARCHIVE),
    "plain": ("official-1", {**ARCHIVE, "instructions": "", "world": {}}),
    "builtin": ("official-1-builtin", BUILTIN),
    "checkout": ("official-checkout", CHECKOUT),
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
    "checkout": (["simulator, planner and renderer", "configuration: demo_clean"], ["other seeds"]),
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
    keys = [TrialKey("Pick_Blocks_Size", 1, n) for n in range(4)]
    records = [trial_record(k, n < successes, candidates=2) for n, k in enumerate(keys)]
    others = [TrialKey("Press_Stapler_Repeat", 2, n) for n in range(4)]
    records += [trial_record(k, category="RPF", total=2) for k in others]
    said: dict[str, Any] = {"policy": {"spec": {"name": name}}, "privileged": False, **settings}
    manifest = {"settings": said, "suite": suite}
    return Run(
        Path(name), read(RunManifest, manifest, "it"), (*keys, *others), {r.key: r for r in records}
    )


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


def test_of_what_a_manifest_does_not_say_nothing_is_official() -> None:
    found = pieces("official-1", RunSettings())
    assert found.official == (
        "tasks, rules, thresholds, step limits",
        "the robot's joints and cameras",
    )


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
    columns = [column_in("official-1"), column_in("checkout", "other", 0)]
    (table,) = make_tables([*columns, published_column("RDT")], ["sr-tasks"], "highest")
    assert ("Pick Blocks Size", "mine") in marked(table)
    assert "mine (official-1) has" in table.notes[0] and "other (official-ch" in table.notes[0]
    with pytest.raises(IncomparableError, match="the suites official-1 and official-checkout"):
        make_tables(columns, ["sr-tasks"])
