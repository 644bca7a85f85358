"""Runs in real time: settings, manifest, suite, workers, and what they are held against."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from fake_runs import make_run, shown
from msgspec import structs
from run_fakes import fake_config, run_here, trial_keys

from robospa.harness.clock.policy_clock import PolicyClock, parse_latency, parse_switching
from robospa.harness.clock.real_time import ENTRY
from robospa.harness.running.evaluate import Request, about_machine, make_manifest
from robospa.harness.running.policy_probe import check_clock, probe_policies
from robospa.harness.running.request import make_request
from robospa.harness.settings import EvaluationSettings, SettingsError, updated
from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.rules import Reference, check_settings
from robospa.protocol.policy import PolicySpec
from robospa.results.comparison.compare import by_axis, compare_results
from robospa.results.lint import lint_run
from robospa.results.paper.columns import column_of
from robospa.results.records.manifest import PolicySettings, RunError, WorldSettings
from robospa.results.records.runs import Run, differences, read_run
from robospa.results.records.trial_record import TrialRecord
from robospa.results.report.run_card import score_table
from robospa.results.scoring.models import IncomparableError, results_of_run
from robospa.tasks.scene import SUITE
from robospa.trial import TrialKey

KEYS = trial_keys(6)


def settings(out: Path, **given: Any) -> EvaluationSettings:
    own = {"policy": "clock_fakes:walker", "out": out, "parts": "run_fakes:parts"}
    return updated(EvaluationSettings(), {**own, "world": "clock_fakes:TargetWorld", **given})


def manifest_of(out: Path, **given: Any) -> tuple[dict[str, Any], Request]:
    """The manifest of a run of fakes, and its request."""
    request = make_request(settings(out, **given), keys=KEYS)
    return make_manifest(request, probe_policies(request.config, KEYS)).to_json(), request


@pytest.mark.usefixtures("world_asked_here")
def test_the_manifest_has_the_latency_itself_and_a_suite_of_its_own(tmp_path: Path) -> None:
    file = tmp_path / "measured.json"
    file.write_text(json.dumps({"latency_ms": [100.0, 200.0, 500.0]}))
    given = {"action_rate": 16.67, "clock": f"real:{file}", "switch": "after:4"}
    made, request = manifest_of(tmp_path / "run", **given)
    assert made["settings"]["clock"] == {
        "latency": "p0=100ms,p50=200ms,p100=500ms",
        "latency_ms": None,
        "switching": "after:4",
        "action_steps": 15,
        "seconds": None,
    }
    assert made["suite"].endswith("-16.67hz")
    assert made["about"]["arguments"]["clock"] == "real:p0=100ms,p50=200ms,p100=500ms"
    assert any("every action takes 60 ms, in real time" in w for w in made["about"]["warnings"])
    clock = request.config.clock
    assert clock is not None and clock.latency == parse_latency("p0=100ms,p50=200ms,p100=500ms")


@pytest.mark.usefixtures("world_asked_here")
def test_the_paused_clock_leaves_no_trace(tmp_path: Path) -> None:
    made, request = manifest_of(tmp_path, action_rate=50)
    assert "clock" not in made["settings"] and made["suite"].endswith("-50hz")
    assert made["settings"]["world"]["arguments"]["action_steps"] == 5
    assert request.config.clock is None


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"clock": "real:200ms"}, "add the rate"),
        ({"switch": "arrival"}, "go with a real clock"),
        ({"time_limit": 30}, "go with a real clock"),
        ({"action_rate": 30}, "nearest rates are 27.78 and 31.25"),
        ({"clock": "real:200"}, "write 200ms"),
        ({"clock": "real:1ms", "switch": "blend", "action_rate": 50}, "after:K"),
        ({"clock": "real:1ms", "action_rate": 0.5}, "at least 1"),
    ],
)
def test_settings_that_cannot_be_are_refused_in_a_sentence(
    tmp_path: Path, given: dict[str, Any], says: str
) -> None:
    with pytest.raises(SettingsError, match=says):
        make_request(settings(tmp_path, **given), keys=KEYS)


def test_a_rate_sets_the_duration_of_actions_in_the_built_in_world(tmp_path: Path) -> None:
    given = {"policy": "hold", "out": tmp_path, "action_rate": 16.67, "clock": "real:0.2s"}
    request = make_request(updated(EvaluationSettings(), given), keys=KEYS)
    assert request.config.world_arguments == {
        "render": None,
        "control": "fixed_rate",
        "action_steps": 15,
    }
    assert request.config.clock == PolicyClock(parse_latency("200ms"))


def run_all(folder: Path, keys: list[TrialKey]) -> list[TrialRecord]:
    clock = PolicyClock(parse_latency("p0=0ms,p100=400ms"))
    fakes = {"policy": "clock_fakes:walker", "world": "clock_fakes:TargetWorld"}
    return run_here(fake_config(folder, **fakes, clock=clock), keys)


def test_records_are_equal_to_the_bit_whatever_the_worker_and_the_order(tmp_path: Path) -> None:
    one = {r.key: r for r in run_all(tmp_path / "one", KEYS)}
    again = run_all(tmp_path / "left", KEYS[:2]), run_all(tmp_path / "right", KEYS[:1:-1])
    two = {r.key: r for part in again for r in part}
    assert len(two) == len(KEYS)
    assert [differences(one[key], two[key]) for key in KEYS] == [[] for _ in KEYS]
    assert [one[k].diagnostics[ENTRY] for k in KEYS] == [two[k].diagnostics[ENTRY] for k in KEYS]
    delays = {tuple(record.diagnostics[ENTRY]["arrived"]) for record in one.values()}
    assert len(delays) > 1, "every trial has latencies of its own"


def timed(folder: Path, clock: str, good: int, suite: str = "robospa-2-16.67hz") -> Run:
    """A run of eight trials under a clock, of which `good` succeed."""
    make_run(folder, [shown("Pick_Blocks_Size", 1, n, n < good) for n in range(8)])
    manifest = json.loads((folder / "run.json").read_text())
    manifest["suite"] = suite
    manifest["about"]["world"] = {"control": "fixed_rate", "action_steps": 15}
    if clock:
        manifest["settings"]["clock"] = {"latency": clock, "switching": "wait"}
    (folder / "run.json").write_text(json.dumps(manifest))
    return read_run(folder)


def test_two_latencies_stand_in_one_table_paired_by_seed(tmp_path: Path) -> None:
    runs = [timed(tmp_path / "a", "0", 7), timed(tmp_path / "b", "200ms", 2)]
    sides = [results_of_run(run) for run in runs]
    table = by_axis(sides)
    assert table is not None and table.title == "SR by clocks"
    assert table.heads[:2] == ("real:0", "real:200ms")
    assert "paired by seed" in table.notes[0]
    found = compare_results(*sides)
    assert found.paired and "Latency comparison" in found.banner
    assert found.cells[0].p < 0.1


def test_another_rate_or_the_benchmark_is_another_suite(tmp_path: Path) -> None:
    slow = results_of_run(timed(tmp_path / "a", "200ms", 5))
    for suite in ("robospa-2", "robospa-2-50hz"):
        other = results_of_run(timed(tmp_path / suite, "", 5, suite))
        with pytest.raises(IncomparableError, match=f"the suites robospa-2-16.67hz and {suite}"):
            compare_results(slow, other)


def test_tables_and_lint_say_that_it_is_real_time_and_rank_it_never(tmp_path: Path) -> None:
    run = timed(tmp_path / "a", "200ms", 5)
    results = results_of_run(run)
    assert "real:200ms" in score_table(run, results.scores).title
    column = column_of(results)
    assert not column.ranked and column.title.endswith("(real time)")
    assert "real-time" in {finding.rule for finding in lint_run(run)}


def test_no_bundle_is_made_of_it(tmp_path: Path) -> None:
    run = timed(tmp_path / "a", "200ms", 5).manifest
    settings = structs.replace(
        run.settings,
        **{name: ("x",) for name in ("embodiment", "mode")},
        split=("heldout",),
        policy=PolicySettings({"name": "x", "action": "joint"}),
        world=WorldSettings("x"),
    )
    made = structs.replace(run, suite=SUITE, settings=settings, about=about_machine({}))
    unused = lambda *_: ()  # noqa: E731
    reference = Reference(unused, unused, unused, "x", robots=("x",), modes=("x",))
    with pytest.raises(BundleError, match="real time"):
        check_settings(made, reference)
    world = WorldSettings("x", {"control": "fixed_rate"})
    made = structs.replace(made, settings=structs.replace(settings, clock=None, world=world))
    with pytest.raises(BundleError, match="at a fixed rate"):
        check_settings(made, reference)


def test_the_mean_of_poses_is_refused_before_the_first_trial() -> None:
    spec = PolicySpec("poses", action="ee")
    clock = PolicyClock(switching=replace(PolicyClock().switching, kind="ensemble", after=1))
    with pytest.raises(RunError, match="'poses' answers ee actions"):
        check_clock(clock, [spec])
    check_clock(clock, [PolicySpec("joints")])
    check_clock(None, [spec])


def test_real_time_chunking_needs_a_policy_that_reads_committed_actions() -> None:
    clock = PolicyClock(switching=parse_switching("rtc:4"))
    with pytest.raises(RunError, match="choose --switch after:4"):
        check_clock(clock, [PolicySpec("plain")])
    check_clock(clock, [PolicySpec("chunker", committed_actions=True)])
