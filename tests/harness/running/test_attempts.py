"""What a policy causes counts, and what it may have caused is bounded over all resumes; one that
always fails alike or speaks another language is noticed."""

import random
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import fault_server
import pytest
from fake_runs import lines, trial_record
from fault_server import ALWAYS, ONCE, FaultyServer
from msgspec import structs
from numpy.typing import NDArray
from run_fakes import FakePolicy, fake_config, fake_task_of, trial_keys

from robospa.harness.running import manifest
from robospa.harness.running.atomic_file import run_lock
from robospa.harness.running.attempts import (
    CUT_OFF,
    FIRST,
    IN_A_ROW,
    ErrorVerdict,
    ErrorWatch,
    LossWriter,
    ProblemWatch,
)
from robospa.harness.running.evaluate import Request, evaluate
from robospa.harness.running.executor import RunAborted
from robospa.harness.running.runner import Runner, RunOptions
from robospa.harness.running.scheduler import TrialQueue
from robospa.protocol.server import ServerThread
from robospa.protocol.transport import Timeouts
from robospa.results.lint import lint_run
from robospa.results.records.manifest import RunAbout, RunError, RunSettings, make_manifest
from robospa.results.records.runs import Run, read_run
from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.repeats import fault_rates, was_repeated, worst_case
from robospa.results.scoring.scores import score_run
from robospa.trial import TrialKey

pytestmark = pytest.mark.usefixtures("world_asked_here")

TIMES = Timeouts(30, 30, 30, 30, 30, 30, 30, 0.2)


@pytest.fixture(autouse=True)
def same_code(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(manifest, "code_hash", lambda: "the same")


def request(url: str, folder: Path, count: int = 10, resume: bool = False, **more: Any) -> Request:
    config = fake_config(folder, url, options={"timeouts": TIMES})
    options = RunOptions(workers=1, backoff=0.01, **more)
    return Request(config, trial_keys(count), options, resume=resume)


def persevere(url: str, folder: Path, count: int, resumes: int) -> Run:
    """The run after an evaluation and as many resumes, whatever they end in."""
    for attempt in range(1 + resumes):
        try:
            evaluate(request(url, folder, count, resume=attempt > 0))
        except RunAborted:
            continue
        if not read_run(folder).missing:
            break
    return read_run(folder)


class Cheat(FakePolicy):
    """Would succeed in a quarter of all attempts, and reports a retriable error in the others."""

    luck = random.Random(2)

    def infer(self, observation: Mapping[str, Any]) -> NDArray[Any]:
        if Cheat.luck.random() > 0.25:
            raise RuntimeError("CUDA error: device-side assert triggered")
        return super().infer(observation)

    def reset(self, trial: Any) -> None:
        super().reset(trial)
        self.length = 20  # one query a trial


def test_errors_on_failure_do_not_raise_the_success_rate(tmp_path: Path) -> None:
    """The attack: the policy breaks down in a retriable way whenever it is about to fail."""
    spec = replace(FakePolicy().spec, horizon=20)
    with ServerThread(policy_factory=lambda: Cheat(spec)) as server:
        run = persevere(server.url, tmp_path, 100, resumes=5)
    rate = score_run(run).cells["Pick_Fake", 1].values["sr"]
    assert rate is not None and not run.missing
    assert rate.low <= 0.25 <= rate.high
    assert rate.value < 0.35
    assert all(len(record.retries) <= 2 for record in run.records.values())


class Dropping(FaultyServer):
    """Ends the connection in three of four attempts at any trial."""

    def __init__(self) -> None:
        super().__init__("first", fault_server.cut)
        self.luck = random.Random(3)

    def _strikes(self, point: str, seed: int) -> bool:
        return point == "first" and self.luck.random() > 0.25


def test_dropped_connections_are_bounded_recorded_and_worth_nothing_in_the_worst_case(
    tmp_path: Path,
) -> None:
    with Dropping() as url:
        run = persevere(url, tmp_path, 40, resumes=2)
    assert run.missing  # never scored, and no bundle
    for key in run.missing:
        record = run.records[key]
        assert [row.cause for row in record.retries] == ["connection_lost"] * 3
    for record in run.records.values():
        assert len(record.retries) <= 3
        if record.success:
            assert record.attempts == len(record.retries) + 1
    overall = fault_rates(run.records.values())[0]
    assert overall.repeated == sum(map(was_repeated, run.records.values())) - len(run.missing)
    low, _ = worst_case(run).cells["Pick_Fake", 1].bounds("sr") or (1.0, 1.0)
    assert low == pytest.approx(0.25, abs=0.15)


def test_attempts_of_a_driver_that_is_no_more_count(tmp_path: Path) -> None:
    with FaultyServer("first", fault_server.cut) as url:
        evaluate(request(url, tmp_path, attempts=1))
        lost = read_run(tmp_path).missing
        assert {key.seed for key in lost} == {ONCE, ALWAYS}
        evaluate(request(url, tmp_path, resume=True, attempts=1))  # all attempts are spent
        assert read_run(tmp_path).missing == lost
        evaluate(request(url, tmp_path, resume=True, attempts=3))
    run = read_run(tmp_path)
    assert [key.seed for key in run.missing] == [ALWAYS]
    by_seed = {key.seed: record for key, record in run.records.items()}
    assert (by_seed[ONCE].success, by_seed[ONCE].attempts) == (True, 2)
    assert len(by_seed[ALWAYS].retries) == 3


def test_a_loss_is_on_disk_before_the_next_attempt(tmp_path: Path) -> None:
    """A driver that is killed then forgets no attempt."""
    seen: list[int] = []

    class Looking(FaultyServer):
        def _strikes(self, point: str, seed: int) -> bool:
            if point == "reset" and seed == ALWAYS:
                of_it = [record for record in lines(tmp_path) if record.key.seed == ALWAYS]
                seen.append(sum(record.end == "infrastructure" for record in of_it))
            return super()._strikes(point, seed)

    with Looking("first", fault_server.cut) as url:
        evaluate(request(url, tmp_path))
    assert seen == [1, 3, 5]  # of every attempt that it began, and of its loss


def test_an_attempt_under_way_is_waited_for_until_its_driver_is_gone(tmp_path: Path) -> None:
    keys = trial_keys(1)
    manifest.write_manifest(tmp_path, make_manifest(RunSettings(), keys))
    LossWriter(tmp_path, TrialQueue(keys, fake_task_of)).write(keys[0], "", (CUT_OFF,))
    with run_lock(tmp_path):
        assert not read_run(tmp_path).missing and read_run(tmp_path).waiting
    found = read_run(tmp_path)
    assert found.missing and [f.rule for f in lint_run(found)] == ["missing"]
    more = structs.replace(found.manifest, about=RunAbout(drivers=2))
    (drivers,) = [f for f in lint_run(replace(found, manifest=more)) if f.rule == "drivers"]
    assert "2 drivers" in drivers.text and "cut off 1 attempt" in drivers.text


def test_a_server_that_is_away_costs_no_attempt_for_ever(tmp_path: Path) -> None:
    times = {"timeouts": replace(TIMES, wait=0.0)}
    config = fake_config(tmp_path, "ws://127.0.0.1:9", options=times)
    records: list[Any] = []
    options = RunOptions(backoff=0.01)
    Runner(config, trial_keys(1), options, records.append).run()
    (record,) = records
    assert [row.cause for row in record.retries] == ["unreachable"] * 3
    Runner(config, trial_keys(1), options, records.append, known={record.key: record}).run()
    assert len(records[1].retries) == 6  # it was tried again


class Optional(FakePolicy):
    """Fails alike in every trial until it is mended."""

    broken = True

    def infer(self, observation: Mapping[str, Any]) -> NDArray[Any]:
        if Optional.broken:
            raise KeyError("cam_high")
        return super().infer(observation)


def test_a_run_that_only_fails_stops_and_runs_those_trials_again(tmp_path: Path) -> None:
    Optional.broken = True
    with ServerThread(policy_factory=Optional) as server:
        with pytest.raises(RunAborted, match=r"first 5 trials of Pick_Fake .*KeyError.*cam_high"):
            evaluate(request(server.url, tmp_path))
        run = read_run(tmp_path)
        assert len(run.missing) == 10
        lost = [r for r in run.records.values() if r.retries]
        assert [r.retries[0].cause for r in lost] == ["policy_error"] * FIRST
        assert "KeyError" in lost[0].retries[0].message
        Optional.broken = False
        evaluate(request(server.url, tmp_path, resume=True))
    run = read_run(tmp_path)
    assert not run.missing and not run.repeated
    assert all(record.success for record in run.records.values())
    assert fault_rates(run.records.values())[0].repeated == FIRST


def test_failing_first_trials_cannot_be_had_back_for_ever(tmp_path: Path) -> None:
    Optional.broken = True
    with ServerThread(policy_factory=Optional) as server:
        for attempt in range(3):
            with pytest.raises(RunAborted):
                evaluate(request(server.url, tmp_path, resume=attempt > 0))
    results = [r for r in read_run(tmp_path).records.values() if r.end == "policy_error"]
    assert [len(r.retries) for r in results] == [2] * FIRST  # the third error is final


def test_a_wrong_option_is_mended_while_no_trial_has_a_result(tmp_path: Path) -> None:
    Optional.broken = True
    with ServerThread(policy_factory=Optional) as server, pytest.raises(RunAborted):
        evaluate(request(server.url, tmp_path))
    Optional.broken = False
    other = replace(FakePolicy().spec, horizon=9)
    with ServerThread(policy_factory=lambda: Optional(other)) as server:
        evaluate(request(server.url, tmp_path, resume=True))
    run = read_run(tmp_path)
    assert not run.missing and run.manifest.policy.horizon == 9
    refused = pytest.raises(RunError, match=r"spec\.horizon: 9 -> 4")
    with ServerThread(policy_factory=Optional) as server, refused:
        evaluate(request(server.url, tmp_path, resume=True))


def test_a_server_that_stops_the_run_within_a_trial_has_had_an_attempt(tmp_path: Path) -> None:
    """As by HTTP 401 in the middle: else a resume would give the trial back."""
    from standins_http import Go1, Status

    class Refusing(Go1):
        def act(self, body: bytes) -> Any:
            raise Status(401, b"who are you?")

    with Refusing() as url:
        with pytest.raises(RunAborted, match="refused the request"):
            evaluate(request(url, tmp_path, 1))
        (record,) = read_run(tmp_path).records.values()
    assert [row.cause for row in record.retries] == ["connection_lost"]


# ------------------------------------------------------------------ errors and problems in a row


def key(seed: int, task: str = "Pick_A") -> TrialKey:
    return TrialKey(task, 1, seed)


def error(seed: int, message: str = "no camera 'wrist'", task: str = "Pick_A") -> TrialRecord:
    return trial_record(key(seed, task), end="policy_error", message=message)


def watch(*records: TrialRecord, known: tuple[TrialRecord, ...] = ()) -> list[ErrorVerdict]:
    watching = ErrorWatch()
    watching.know(known)
    found = [watching.add(record, "ws://a") for record in records]
    return [verdict for verdict in found if verdict is not None]


def test_the_first_trials_of_a_task_stop_the_run_and_are_withdrawn() -> None:
    records = [
        error(n, f"the policy answered nan in action {n}, dimension 3") for n in range(FIRST)
    ]
    (verdict,) = watch(*records)
    assert verdict.withdrawn == tuple(records)
    assert verdict.text.startswith(f"the first {FIRST} trials of Pick_A all ended in the same")
    assert "nan in action 4" in verdict.text and "--policy-errors count" in verdict.text


SOUND, LOST = trial_record(key(99)), trial_record(key(5), end="infrastructure")


@pytest.mark.parametrize(
    ("records", "withdrawn"),
    [
        # A task that fails after others that work, one that once ended otherwise, and once more.
        ([trial_record(key(99, "Pick_B")), *map(error, range(FIRST))], FIRST),
        ([SOUND, *map(error, range(IN_A_ROW - 1))], None),
        ([SOUND, *map(error, range(IN_A_ROW))], 0),
        ([error(n, f"problem {'abcdefgh'[n]}") for n in range(8)], None),
        ([record for n in range(FIRST) for record in (error(n), LOST)], FIRST),
    ],
)
def test_errors_that_stop_a_run(records: list[TrialRecord], withdrawn: int | None) -> None:
    """Those of a server that breaks later count; lost trials say nothing of the policy."""
    found = watch(*records)
    assert [len(verdict.withdrawn) for verdict in found] == (
        [] if withdrawn is None else [withdrawn]
    )


def test_errors_after_a_sound_trial_of_an_earlier_driver_do_not_stop_it() -> None:
    assert watch(*map(error, range(FIRST)), known=(SOUND,)) == []


def test_a_run_of_few_trials_a_task_stops_as_well() -> None:
    (verdict,) = watch(*(error(1, task=f"Pick_{n}") for n in range(FIRST)))
    assert verdict.text.startswith(f"the first {FIRST} trials all ended")
    assert len(verdict.withdrawn) == FIRST


def test_many_unreachable_actions_are_said_once_after_five_trials() -> None:
    """Seven trials of 130 actions, nearly all of them out of reach."""
    watching = ProblemWatch()
    found = {"unreachable_actions": 128, "first_unreachable": "action 1: left pose"}
    said = [watching.add(trial_record(key(n), steps=130, diagnostics=found)) for n in range(7)]
    assert [len(lines) for lines in said] == [0, 0, 0, 0, 1, 0, 0]
    assert said[4][0].startswith(
        "warning: in the first 5 trials 640 of 650 actions (98 %) ask for a pose out of reach"
    )
    assert "are poses in the world frame" in said[4][0] and "action 1: left pose" in said[4][0]
