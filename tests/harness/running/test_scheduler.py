"""Which server gets which trial, driven by a small simulation without processes or clocks; which
trial of a base task comes next, and what a trial is expected to take."""

import heapq
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import pytest
from fake_runs import trial_record
from run_fakes import LIMIT, fake_task_of, trial_keys

from robospa.harness.running.scheduler import Scheduler, TrialJob, TrialQueue
from robospa.harness.running.worker import task_finder
from robospa.harness.worlds import TASK_PARTS
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

Targets = Callable[[str], Sequence[str]]
TASKS = ("Pick_A", "Press_B", "Push_C", "Stack_D", "Turn_E", "Open_F")


def keys(tasks: Sequence[str] = TASKS, trials: int = 20) -> list[TrialKey]:
    return [TrialKey(task, level, n) for task in tasks for level in (1, 2) for n in range(trials)]


def record(key: TrialKey, latency: float) -> TrialRecord:
    return trial_record(key, True, wall_time=0.1, latency={"p50": latency})


@dataclass
class Simulation:
    """Workers that act for 1 s a trial, and wait as long as their server makes them.

    A server answers one request at a time, `speed` [s] each; it is away in `gone` (from, until).
    """

    scheduler: Scheduler
    workers: int
    speed: Mapping[str, float]
    gone: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    now: float = 0.0
    order: list[TrialJob] = field(default_factory=list)
    settled: list[TrialJob] = field(default_factory=list)
    after: Callable[[int], None] = lambda count: None

    def run(self) -> None:
        """Until every trial is settled."""
        queue = self.scheduler.queue
        at = [""] * self.workers
        busy: list[tuple[float, int, float, TrialJob]] = []
        free = list(range(self.workers))
        while queue.unsettled:
            for worker in list(free):
                job = self.scheduler.next(self.now, at[worker])
                if job is None:
                    break
                free.remove(worker)
                at[worker] = job.target
                self.order.append(job)
                waits = self.speed[job.target] * self.scheduler.servers[job.target].running
                heapq.heappush(busy, (self.now + 1.0 + waits, worker, waits, job))
            if not busy:
                then = self.scheduler.next_time(self.now)
                assert then is not None, "nobody works and nobody pauses"
                self.now = then
                continue
            begun = self.now
            self.now, worker, waits, job = heapq.heappop(busy)
            free.append(worker)
            away = self.gone.get(job.target, (0.0, 0.0))
            if away[0] <= self.now < away[1]:
                fault = "unreachable" if begun >= away[0] else "disconnected"
                charged = self.scheduler.lost(job, self.now, fault, "gone")
                self.scheduler.requeue(job, self.now, charged)
                continue
            done = record(job.key, 1000 * waits)
            self.scheduler.done(job, done, self.now, 1.0 + waits)
            self.after(len(self.settled))
            self.settled.append(job)
            queue.settle()

    def share(self) -> dict[str, float]:
        """Part of the trials that each server did."""
        counts = Counter(job.target for job in self.settled)
        return {target: count / len(self.settled) for target, count in counts.items()}


def schedule(trials: list[TrialKey], targets: Targets) -> Scheduler:
    return Scheduler(TrialQueue(trials, fake_task_of), targets)


def equal(*names: str) -> Targets:
    return lambda task: names


def next_job(scheduler: Scheduler, now: float = 0.0, at: str = "") -> TrialJob:
    job = scheduler.next(now, at)
    assert job is not None
    return job


def switches(simulation: Simulation, target: str) -> int:
    tasks = [job.key.task for job in simulation.order if job.target == target]
    return sum(a != b for a, b in pairwise(tasks))


@pytest.mark.parametrize("servers", [2, 3, 4])
def test_equal_servers_share_the_tasks_and_hardly_change_them(servers: int) -> None:
    names = [f"s{n}" for n in range(servers)]
    simulation = Simulation(schedule(keys(), equal(*names)), 8, dict.fromkeys(names, 0.1))
    simulation.run()
    # No fewer than tasks - servers are possible; each server may help once at the end of others'.
    least = len(TASKS) - servers
    assert least <= sum(switches(simulation, name) for name in names) <= least + 2 * servers
    assert max(simulation.share().values()) < 1.4 / servers


def test_with_a_server_for_every_task_no_server_sees_a_change() -> None:
    scheduler = schedule(keys(), lambda task: (f"ws://{task}",))
    simulation = Simulation(scheduler, 4, {f"ws://{task}": 0.1 for task in TASKS})
    simulation.run()
    assert all(switches(simulation, f"ws://{task}") == 0 for task in TASKS)
    assert all(job.target == f"ws://{job.key.task}" for job in simulation.order)


def test_a_server_that_gets_slow_is_left_and_asked_again_later() -> None:
    speed = {"a": 0.2, "b": 0.2}

    def change(count: int) -> None:
        speed["a"] = 4.0 if 100 < count < 300 else 0.2

    simulation = Simulation(schedule(keys(trials=80), equal("a", "b")), 6, speed, after=change)
    simulation.run()
    slow = Counter(job.target for job in simulation.settled[130:300])
    again = Counter(job.target for job in simulation.settled[-300:])
    assert slow["b"] > 10 * slow["a"]
    assert again["a"] > 100


def test_a_worker_stays_where_it_is_if_the_other_server_is_not_clearly_better() -> None:
    scheduler = schedule(keys(), equal("a", "b"))
    first, second = next_job(scheduler), next_job(scheduler)
    assert second.target != first.target
    assert next_job(scheduler, at="b").target == "b"


def test_trials_of_a_server_that_goes_away_are_done_by_the_other() -> None:
    simulation = Simulation(
        schedule(keys(), equal("a", "b")), 6, {"a": 0.1, "b": 0.1}, {"a": (5.0, 1e9)}
    )
    simulation.run()
    assert sorted(job.key for job in simulation.settled) == sorted(keys())
    # Its line broke under the trials that were running there: one attempt each, and no more.
    assert {job.attempt for job in simulation.settled} == {1, 2}
    assert sum(job.attempt == 2 for job in simulation.settled) <= 6
    tried = [job for job in simulation.order if job.target == "a"]
    assert len(tried) - len([j for j in simulation.settled if j.target == "a"]) < 20


def test_a_server_that_comes_back_gets_its_workers_back() -> None:
    simulation = Simulation(
        schedule(keys(trials=60), equal("a", "b")), 6, {"a": 0.1, "b": 0.1}, {"a": (5.0, 20.0)}
    )
    simulation.run()
    late = Counter(job.target for job in simulation.settled[-300:])
    assert late["a"] > 100
    assert len(simulation.settled) == len(keys(trials=60))


def test_one_worker_tries_a_server_before_the_others_follow() -> None:
    scheduler = schedule(keys(), equal("a", "b"))
    job = next_job(scheduler)
    assert not scheduler.lost(job, 0.0, "unreachable")
    scheduler.requeue(job, 0.0, False)
    pause = scheduler.servers[job.target].retry_at
    jobs = [next_job(scheduler, pause) for _ in range(6)]
    assert [j.target for j in jobs].count(job.target) == 1


def test_waiting_for_the_only_server_of_a_task_is_charged_when_all_else_is_done() -> None:
    where = {"Pick_A": "a", "Press_B": "b"}
    scheduler = schedule(keys(("Pick_A", "Press_B"), 1), lambda task: (where[task],))
    jobs = {job.target: job for job in (next_job(scheduler), next_job(scheduler))}
    assert not scheduler.lost(jobs["a"], 0.0, "unreachable")  # just gone
    scheduler.requeue(jobs["a"], 0.0, False)
    later = next_job(scheduler, 61.0)
    assert later.target == "a"
    assert not scheduler.lost(later, 61.0, "unreachable")  # the other server still runs a trial
    scheduler.requeue(later, 61.0, False)
    scheduler.done(jobs["b"], record(jobs["b"].key, 1.0), 61.0, 1.0)
    rest = next_job(scheduler, 99.0)
    if rest.target == "b":
        scheduler.done(rest, record(rest.key, 1.0), 99.0, 1.0)
        rest = next_job(scheduler, 99.0)
    assert rest.target == "a"
    assert scheduler.lost(rest, 99.0, "unreachable")  # nobody else has anything to do


def test_a_server_that_came_back_as_another_one_is_left_out() -> None:
    scheduler = schedule(keys(), equal("a", "b"))
    job = next_job(scheduler)
    assert not scheduler.lost(job, 0.0, "incompatible", "another spec")
    scheduler.requeue(job, 0.0, False)
    assert scheduler.tasks_without_server() == ()
    assert all(j.target != job.target for _ in range(20) if (j := scheduler.next(1e6)))
    (left,) = (s for s in scheduler.servers.values() if not s.excluded)
    other = next_job(scheduler, 1e6)
    assert other.target == left.target
    scheduler.lost(other, 1e6, "incompatible", "another spec, too")
    scheduler.requeue(other, 1e6, False)
    assert set(scheduler.tasks_without_server()) == set(TASKS)


def test_a_server_with_one_state_for_all_does_one_trial_at_a_time() -> None:
    """Also under two URLs, as with other options for another task."""
    trials = [TrialKey(task, 1, seed) for task in ("Pick_A", "Pick_B") for seed in range(3)]
    where = {"Pick_A": ("x://h:1?space=ee",), "Pick_B": ("x://h:1", "ws://free")}
    shared = {"x://h:1?space=ee": "h:1", "x://h:1": "h:1"}
    queue = TrialQueue(trials, fake_task_of)
    scheduler = Scheduler(queue, lambda task: where[task], one_trial=shared)
    jobs = [scheduler.next(0.0) for _ in range(5)]
    taken = [job.target for job in jobs if job is not None]
    assert sum(target in shared for target in taken) == 1
    assert taken.count("ws://free") == 3 and jobs[-1] is None
    first = next(job for job in jobs if job is not None and job.target in shared)
    scheduler.done(first, record(first.key, 1.0), 1.0, 1.0)
    assert next_job(scheduler, 1.0).target in shared


# --- the queue

KEYS = trial_keys(3)


def test_a_retry_waits_for_its_time_and_then_goes_first() -> None:
    queue = TrialQueue(KEYS, fake_task_of)
    first = queue.take("Pick_Fake", 0.0)
    assert first is not None
    queue.requeue(replace(first, attempt=2), due=5.0)
    assert queue.next_due(4.0) == 5.0
    second, third = queue.take("Pick_Fake", 4.0), queue.take("Pick_Fake", 6.0)
    assert second is not None and third is not None
    assert (second.key, third.key, third.attempt) == (KEYS[1], first.key, 2)


def test_the_level_that_takes_longest_goes_first() -> None:
    slow, quick = TrialKey("Pick_Fake", 1, 7), TrialKey("Pick_Fake", 2, 7)
    queue = TrialQueue([slow, quick, replace(slow, seed=8), replace(quick, seed=8)], fake_task_of)
    assert queue.take("Pick_Fake", 0.0) == TrialJob(slow)  # equal limits: in order
    queue.durations.add(slow, 9.0)
    queue.durations.add(quick, 1.0)
    assert queue.take("Pick_Fake", 0.0) == TrialJob(replace(slow, seed=8))
    assert queue.take("Pick_Fake", 0.0) == TrialJob(quick)


def test_what_is_expected_moves_from_the_step_limit_to_what_was_measured() -> None:
    queue = TrialQueue(KEYS, fake_task_of)
    key, other = KEYS[0], TrialKey("Pick_Fake", 3, 1)
    assert (queue.durations.expect(key), queue.durations.known) == (LIMIT, False)
    queue.durations.add(key, 10.0)
    assert queue.durations.expect(key) == pytest.approx(10.0)
    assert queue.durations.expect(other) == pytest.approx(10.0)  # as many seconds a step
    queue.durations.add(other, 2.0)
    assert queue.durations.expect(key) == pytest.approx((10.0 + 6.0) / 2)
    assert queue.left() == pytest.approx(3 * 8.0)


def test_a_task_that_nobody_knows_still_counts() -> None:
    def unknown(key: TrialKey) -> object:
        raise KeyError(key.task)

    queue = TrialQueue(KEYS, unknown)
    assert queue.due(0.0) == {"Pick_Fake": 3.0}


def test_the_catalog_is_asked_for_the_task_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    def built(*_: object) -> None:
        raise AssertionError("a scene was built")

    monkeypatch.setattr("robospa.harness.trial.build_scene", built)
    found = task_finder(TASK_PARTS)(TrialKey("Put_Bottles_Dustbin", 3, 100000))
    assert (found.name, found.levels[3].subtasks) == ("Put_Bottles_Dustbin", 3)
