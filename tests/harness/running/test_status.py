"""Where the time goes and who holds the others up, in words; more workers than cores only as long
as that helps; what is logged elsewhere."""

from __future__ import annotations

import sys
import types
from pathlib import Path
from typing import Any

import pytest
from fake_runs import make_run, shown, trial_record
from run_fakes import FAKES

import robospa
from robospa.extras import MissingPackage
from robospa.harness.running.status import (
    MEMORY,
    PER_CORE,
    Autoscaler,
    ServerStats,
    Status,
    TimeBreakdown,
    cores,
    most_workers,
    server_text,
    shares_text,
    time_left,
)
from robospa.harness.running.tracking import WandbTracker
from robospa.trial import TrialKey

KEY = TrialKey("Pick_Fake", 1, 1)


def record(wall: float = 10.0, latency: dict[str, float] | None = None, **timing: float) -> Any:
    return trial_record(KEY, True, wall_time=wall, timing=timing, latency=latency or {})


def server(running: int = 4, p50: float = 120.0, **means: float) -> ServerStats:
    found = ServerStats("ws://a", frozenset({"Pick_Fake"}), running=running, trials=9)
    found.means = {"p50": p50, **means}
    return found


def status(waiting: float, *servers: ServerStats, workers: int = 4, cores: int = 2) -> Status:
    shares = {"physics": 1.0 - waiting, "waiting": waiting}
    return Status(0.0, workers, workers, cores, servers, shares)


def test_shares_are_those_of_the_recorded_purposes() -> None:
    shares = TimeBreakdown()
    assert shares.recent_shares() == {}
    shares.add(record(physics=3.0, goal=1.0, rendering=2.0, waiting=2.0, queueing=1.0, loading=0.5))
    assert shares.recent_shares() == pytest.approx(
        {
            "physics": 0.4,
            "rendering": 0.2,
            "waiting": 0.2,
            "queueing": 0.1,
            "scenes": 0.05,
            "other": 0.05,
        }
    )
    assert shares_text({"physics": 0.5, "rendering": 0.496, "other": 0.004}) == (
        "physics 50 %, rendering 50 %"
    )


FULL, IDLE = {"queue": 200.0, "infer": 100.0}, {"queue": 1.0, "infer": 100.0}


@pytest.mark.parametrize(
    ("waiting", "servers", "cores", "words"),
    [
        (0.3, [{}], 2, "simulators are the bottleneck: they fill all 2 cores"),
        (0.9, [FULL], 2, "the policy server is the bottleneck|wait 90 % of their time"),
        (0.9, [IDLE], 2, "room for more workers"),
        (0.9, [IDLE, FULL], 2, "room for more workers"),
        (0.9, [IDLE, {}], 2, "workers wait 90 % of their time"),  # who says nothing may be full
    ],
)
def test_what_holds_the_others_up(
    waiting: float, servers: list[dict[str, float]], cores: int, words: str
) -> None:
    found = status(waiting, *(server(**means) for means in servers), cores=cores).bottleneck
    assert all(word in found for word in words.split("|"))


def test_nothing_is_blamed_where_nothing_is_known() -> None:
    assert "bottleneck" not in status(0.09, server(**FULL), cores=8).bottleneck
    assert "bottleneck" not in status(0.9, server(), cores=0).bottleneck
    assert Status(0.0, 2, 2, 2).bottleneck == ""


def test_a_server_with_full_batches_is_full_before_its_queue_is_long() -> None:
    told = server(queue=70.0, infer=116.0, batch=7.9)
    assert not told.saturated
    told.batch = 8
    assert told.saturated
    told.means["queue"] = 10.0  # full, but idle between its calls
    assert not told.saturated


def test_a_server_that_tells_nothing_is_full_when_it_answers_slower_than_it_could() -> None:
    slow = server(p50=400.0)
    slow.fastest = 100.0
    assert slow.saturated
    slow.fastest = 390.0
    assert not slow.saturated


def test_servers_that_are_away_are_said_first() -> None:
    away = server()
    away.fail(0.0, 2.0)
    assert status(0.3, away, server()).bottleneck == (
        "a policy server is away; the others get its workers"
    )
    assert status(0.3, away).bottleneck == "a policy server is away"
    assert server_text(away, 0.5) == "away, next try in 2 s"
    assert server_text(away, 3.0) == "away, being tried"


def test_a_servers_line_says_what_it_told() -> None:
    told = server(p50=8.25, queue=1.5, infer=6.0, batch=3.96)
    assert server_text(told, 0.0) == "answers in 8.2 ms, queue 1.5 ms"
    told.batch = 8
    assert server_text(told, 0.0) == "answers in 8.2 ms, queue 1.5 ms, batch 4.0 of 8"
    assert server_text(server(p50=61000.0), 0.0) == "answers in 61 s"
    assert "no answer" in server_text(ServerStats("ws://b", frozenset()), 0.0)


def test_the_pause_of_a_server_grows_but_not_with_every_worker_that_fails_with_it() -> None:
    away = ServerStats("ws://a", frozenset())
    pauses = []
    now = 0.0
    for _ in range(6):
        for _ in range(4):
            away.fail(now, 2.0)
        pauses.append(away.retry_at - now)
        now = away.retry_at
    assert pauses == [2.0, 4.0, 8.0, 16.0, 30.0, 30.0]
    assert away.failing_since == 0.0


def test_workers_that_start_or_idle_are_named() -> None:
    assert Status(0.0, 4, 4, 2).workers_text == "4 workers on 2 cores"
    assert Status(0.0, 4, 3, 2).workers_text == "4 workers on 2 cores, 1 idle"
    assert Status(0.0, 4, 2, 2, starting=2).workers_text == "4 workers on 2 cores, 2 starting"


def test_answers_are_told_before_the_first_trial_has_ended() -> None:
    fresh = ServerStats("ws://a", frozenset({"Pick_Fake"}))
    assert server_text(fresh, 0.0) == "no answer yet"
    assert Status(0.0, 2, 0, 2, (fresh,), starting=2).first_words == "starting"
    fresh.add_answers(12, 130.0)
    fresh.add_answers(3, 130.0)
    assert server_text(fresh, 0.0) == "answers in 130 ms"
    assert Status(0.0, 2, 1, 2, (fresh,), starting=1).first_words == (
        "first trials under way, 15 answers of the policy so far"
    )


@pytest.mark.parametrize(
    ("waiting", "running", "workers", "left"),
    [
        (100.0, [], 4, 25.0),
        (0.0, [(10.0, 4.0), (10.0, 8.0)], 8, 6.0),  # the longest that is still to come
        (0.0, [(10.0, 30.0)], 8, 7.5),  # late already: nobody says that it ends now
        (0.0, [(10.0, 10.0)], 1, 2.5),
        (0.0, [], 0, 0.0),
    ],
)
def test_time_left(
    waiting: float, running: list[tuple[float, float]], workers: int, left: float
) -> None:
    assert time_left(waiting, running, workers) == left


def test_trials_that_wait_for_each_other_do_not_fill_the_cores() -> None:
    """Of six trials on two cores each computes for 20 % of its time and queues for 30 %."""
    shares = {"physics": 0.2, "waiting": 0.5, "queueing": 0.3}
    found = Status(0.0, 2, 6, 2, (server(queue=1.0, infer=100.0),), shares, places=6)
    assert "room for more workers" in found.bottleneck
    busy = Status(0.0, 2, 6, 2, (server(),), {**shares, "queueing": 0.0}, places=6)
    assert "the simulators are the bottleneck" in busy.bottleneck
    slow = Status(0.0, 8, 48, 2, (server(queue=80.0, infer=20.0),), {"waiting": 0.8}, places=48)
    assert "policy server is the bottleneck" in slow.bottleneck
    assert found.workers_text == "2 workers on 2 cores"


# --- how many workers there are


def run_round(scaler: Autoscaler, waiting: float, trials: int | None = None) -> None:
    """A round of trials of 1 s each in which a process did nothing for `waiting`."""
    record = trial_record(KEY, True, timing={"processor": 1.0 - waiting})
    for _ in range(trials or scaler.target):
        scaler.add(record)


@pytest.mark.parametrize(
    ("waiting", "saturated", "more"),
    [(0.05, False, 0), (0.4, False, 1), (0.07, False, 0), (0.95, True, 0)],
)
def test_workers_that_wait_for_a_server_with_room_leave_room_for_others(
    waiting: float, saturated: bool, more: int
) -> None:
    scaler = Autoscaler(2, 16, cores=2)
    run_round(scaler, waiting)
    assert scaler.scale_up(saturated) == more


def test_they_come_in_steps_up_to_the_most() -> None:
    scaler = Autoscaler(2, 10, cores=2)
    grown = []
    for _ in range(5):
        run_round(scaler, 0.95)
        scaler.scale_up(saturated=False)
        grown.append(scaler.target)
    assert grown == [4, 8, 10, 10, 10]


def test_a_review_takes_a_whole_round() -> None:
    scaler = Autoscaler(4, 16, cores=4)
    run_round(scaler, 0.9, trials=3)
    assert scaler.scale_up(saturated=False) == 0
    run_round(scaler, 0.9, trials=1)
    assert scaler.scale_up(saturated=False) > 0


@pytest.mark.parametrize(
    ("group", "files", "expected"),
    [
        ("0::/", {"cpu.max": "max 100000"}, 6),
        ("0::/a/b", {"a/cpu.max": "250000 100000", "a/b/cpu.max": "max 100000"}, 2),
        ("0::/", {"cpu.max": "50000 100000"}, 1),
        ("0::/", {"cpu.max": "900000 100000"}, 6),
        ("4:cpu,cpuacct:/docker/1\n0::/", {"cpu/cpu.cfs_quota_us": "300000"}, 3),
        ("4:cpu:/", {"cpu/cpu.cfs_quota_us": "-1"}, 6),
    ],
)
def test_memory_and_cores_bound_it_and_the_limits_of_a_container(
    group: str,
    files: dict[str, str],
    expected: int,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("os.sched_getaffinity", lambda process: set(range(6)), raising=False)
    made = {f"sys/fs/cgroup/{name}": text for name, text in files.items()}
    made |= {"proc/self/cgroup": group, "sys/fs/cgroup/cpu/cpu.cfs_period_us": "100000"}
    for name, text in made.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(f"{text}\n")
    assert cores(tmp_path) == most_workers(tmp_path) == expected
    (tmp_path / "proc/meminfo").write_text("MemAvailable: 90000000 kB\n")
    assert most_workers(tmp_path) == PER_CORE * expected
    (tmp_path / "sys/fs/cgroup/memory.max").write_text(f"{7 * MEMORY:.0f}\n")
    if "0::/" in group:
        assert most_workers(tmp_path) == min(max(7, expected), PER_CORE * expected)


# -------------------------------- `--log wandb`, against a W&B that only remembers what it was told


TWO = {"tasks": "Pick_Blocks_Size", "levels": 1, "seeds": "100000-100001", "trials": 2}
RUN: dict[str, Any] = {**FAKES, **TWO, "workers": 1}


class FakeWandb(types.ModuleType):
    """Remembers; `broken` says which call fails."""

    def __init__(self, broken: str = "") -> None:
        super().__init__("wandb")
        self.broken, self.started, self.logged, self.finished = broken, [], [], 0  # type: ignore[var-annotated]
        self.summary: dict[str, Any] = {}

    def init(self, **arguments: Any) -> FakeWandb:
        self.started.append(arguments)
        return self

    def log(self, row: dict[str, Any]) -> None:
        if self.broken == "log":
            raise OSError("no network")
        self.logged.append(row)

    def finish(self) -> None:
        self.finished += 1

    def Table(self, columns: list[str], data: list[list[Any]]) -> tuple[list[str], list[Any]]:
        return columns, data


def test_rates_scores_and_every_trial_are_logged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fake = FakeWandb()
    monkeypatch.setitem(sys.modules, "wandb", fake)
    run = make_run(tmp_path / "mine", [shown("Pick_It", 1, n, n < 3) for n in range(4)], lost=1)
    tracker = WandbTracker(run.folder, "arms", {"run_seed": 0})
    for one in run.records.values():
        tracker.add(one)
    tracker.finish(run)
    tracker.close()
    (started,) = fake.started
    assert (started["project"], started["name"], started["resume"]) == ("arms", "mine", "allow")
    assert started["config"] == {"run_seed": 0}
    *rows, last = fake.logged
    assert [row["trials"] for row in rows] == [1, 2, 3, 4]
    assert rows[-1]["success_rate/Pick_It"] == rows[-1]["success_rate"] == 0.75
    columns, data = last["all_trials"]
    assert len(data) == 5 and dict(zip(columns, data[0], strict=True))["success"] is True
    assert fake.summary["sr_low"] < fake.summary["sr"] == 0.75 < fake.summary["sr_high"]
    assert fake.summary["missing"] == 1 and fake.finished == 1
    WandbTracker(run.folder, "arms", {})
    assert fake.started[1]["id"] == started["id"], "a resumed run goes on where it was"


def test_a_tracker_that_fails_costs_no_trial(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    fake = FakeWandb(broken="log")
    monkeypatch.setitem(sys.modules, "wandb", fake)
    run = robospa.evaluate("run_fakes:FakePolicy", out=tmp_path, log="wandb", **RUN)
    assert len(run.records) == 2 and not run.missing
    said = capfd.readouterr().err
    assert said.count("nothing more is logged") == 1 and "no network" in said
    assert fake.started[0]["config"]["policy"]["spec"]["name"] == "fake"


def test_a_missing_package_is_named_before_anything_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "wandb", None)
    with pytest.raises(MissingPackage, match=r"wandb is not installed.*\[wandb\]'"):
        robospa.evaluate("hold", out=tmp_path / "run", log="wandb", **RUN)
    assert not (tmp_path / "run").exists()
