"""Who is placed where, and what is reported when Ray loses something, without a cluster; what runs
on a node, without Ray."""

from __future__ import annotations

import pickle
import tempfile
from pathlib import Path
from typing import Any
from unittest import mock

import pytest
from run_fakes import fake_config, trial_keys

from robospa.harness.running import ray_executor
from robospa.harness.running.executor import (
    Heartbeat,
    Message,
    Proceed,
    RunAborted,
    RunTrial,
    Stop,
    TrialBegins,
    TrialDone,
    WorkerReady,
)
from robospa.harness.running.manifest import this_processor
from robospa.harness.running.ray_executor import (
    NoCluster,
    RayExecutor,
    WorkerActor,
    WorkerReport,
    version_differences,
    versions,
)
from robospa.harness.settings import Compute
from robospa.results.records.trial_record import RetryRow

pytest.importorskip("ray")


class Method:
    """An actor's method; each call is an object that a test may give a result."""

    def __init__(self) -> None:
        self.calls: list[Call] = []

    def remote(self, *_: Any) -> Call:
        self.calls.append(Call())
        return self.calls[-1]


class Call:
    result: Any = None
    done = False

    def finish(self, result: Any) -> None:
        self.result, self.done = result, True


class Actor:
    def __init__(self, node: str) -> None:
        self.node = node
        self.killed = False
        self.start, self.report, self.send, self.close = (Method() for _ in range(4))


class FakeRay:
    """As much of Ray as the executor uses; also stands for the actor's class."""

    def __init__(self, **cpus: float) -> None:
        self.cpus = dict(cpus)
        self.actors: list[Actor] = []

    def nodes(self) -> list[dict[str, Any]]:
        return [
            {
                "NodeID": name.encode().hex().ljust(56, "0"),
                "NodeManagerAddress": name,
                "Alive": True,
                "Resources": {"CPU": cpus},
            }
            for name, cpus in self.cpus.items()
        ]

    def remote(self, *cls: Any) -> Any:
        if cls:
            return self
        self.actors.append(Actor(self.node))
        return self.actors[-1]

    def options(self, scheduling_strategy: Any, **_: Any) -> FakeRay:
        self.node = bytes.fromhex(scheduling_strategy.node_id).rstrip(b"\0").decode()
        return self

    def wait(self, calls: list[Call], timeout: float, num_returns: int = 1) -> Any:
        return [call for call in calls if call.done], []

    def get(self, call: Call) -> Any:
        if isinstance(call.result, Exception):
            raise call.result
        return call.result

    def kill(self, actor: Actor) -> None:
        actor.killed = True

    def get_runtime_context(self) -> Any:
        return type("Context", (), {"gcs_address": ""})

    def shutdown(self) -> None: ...


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ray_executor, "NODES_SECONDS", 0.0)


def executor(ray: FakeRay, **given: Any) -> RayExecutor:
    with mock.patch.object(ray_executor, "join_cluster", return_value=ray):
        return RayExecutor(fake_config(Path("run")), Compute(executor="ray", **given))


def test_the_capacity_is_what_fits_and_grows_with_the_cluster() -> None:
    ray = FakeRay(small=1.0, large=3.0)
    made = executor(ray, cpus_per_worker=1.5)
    assert made.capacity() == 2
    ray.cpus["new"] = 3.1
    made.wait([], 0.0)
    assert made.capacity() == 4
    assert executor(ray, workers=3).capacity() == 3


@pytest.mark.parametrize(
    ("has", "workers"),
    [({"CPU": 8.0, "GPU": 1.0}, 8), ({"CPU": 32.0, "GPU": 1.0}, 10), ({"CPU": 32.0}, 0)],
)
def test_a_share_of_a_gpu_counts_too(has: dict[str, float], workers: int) -> None:
    assert ray_executor.fitting(has, {"CPU": 1.0, "GPU": 0.1}) == workers


def test_a_worker_that_fits_on_no_node_is_refused() -> None:
    with pytest.raises(NoCluster, match=r"4 CPUs that a worker takes \(the largest has 3 CPUs\)"):
        executor(FakeRay(small=1.0, large=3.0), cpus_per_worker=4.0)


def test_workers_go_where_most_is_free() -> None:
    ray = FakeRay(small=1.0, large=3.0)
    made = executor(ray)
    workers = [made.start(name) for name in "abcde"]
    made.wait(workers, 0.0)
    assert sorted(actor.node for actor in ray.actors) == ["large", "large", "large", "small"]
    workers[0].kill()
    assert (ray.actors[0].killed, workers[0].exit_status()) == (True, "killed")
    made.wait(workers, 0.0)
    assert [actor.node for actor in ray.actors[4:]] == [ray.actors[0].node]
    assert [worker.pending() for worker in workers] == [True] * 5


def test_a_node_that_is_unfit_is_left_out_and_named() -> None:
    ray = FakeRay(small=1.0, large=3.0)
    made = executor(ray)
    worker = made.start("a")
    made.wait([worker], 0.0)
    ray.actors[0].start.calls[0].finish("it has numpy 1 instead of 2")
    made.wait([worker], 0.0)
    made.wait([worker], 0.0)
    assert [actor.node for actor in ray.actors] == ["large", "small"]
    assert made.capacity() == 1
    assert worker.exit_status() is None
    (note,) = made.notes()
    assert "large cannot be used: it has numpy 1 instead of 2" in note


@pytest.mark.parametrize(
    ("result", "text"),
    [
        ("it has numpy 1 instead of 2", "it has numpy 1 instead of 2"),
        (RuntimeError("No module named 'robospa'"), r"do not start there \(No module named"),
    ],
)
def test_a_run_whose_nodes_are_all_unfit_cannot_go_on(result: Any, text: str) -> None:
    ray = FakeRay(only=1.0)
    made = executor(ray)
    worker = made.start("a")
    made.wait([worker], 0.0)
    ray.actors[0].start.calls[0].finish(result)
    with pytest.raises(RunAborted, match=text):
        for _ in range(3):
            made.wait([worker], 0.0)


def test_a_run_without_nodes_waits_for_a_while(monkeypatch: pytest.MonkeyPatch) -> None:
    ray = FakeRay(only=1.0)
    made = executor(ray)
    ray.cpus.clear()
    made.wait([], 0.0)
    made.wait([], 0.0)
    assert made.notes() == ["no node of the Ray cluster is left; waiting for one"]
    monkeypatch.setattr(ray_executor, "NO_NODE_SECONDS", -1.0)
    with pytest.raises(RunAborted, match="no node of the Ray cluster had room"):
        made.wait([], 0.0)


def test_a_worker_that_was_ready_ends_with_its_actor() -> None:
    ray = FakeRay(only=1.0)
    made = executor(ray)
    worker = made.start("a")
    made.wait([worker], 0.0)
    (actor,) = ray.actors
    actor.start.calls[0].finish("")
    made.wait([worker], 0.0)
    assert not worker.pending()
    actor.report.calls[0].finish(WorkerReport((WorkerReady(None),)))
    made.wait([worker], 0.0)
    assert worker.messages() == [WorkerReady(None)]
    actor.report.calls[1].finish(RuntimeError("the node is gone"))
    made.wait([worker], 0.0)
    assert worker.exit_status() == "Ray lost it on only"
    assert made.capacity() == 1  # nothing is wrong with the node as long as Ray lists it


def test_a_cluster_whose_head_does_not_answer_ends_the_run(monkeypatch: pytest.MonkeyPatch) -> None:
    made = executor(FakeRay(only=1.0))
    made._head = "127.0.0.1:1"
    made.wait([], 0.0)
    monkeypatch.setattr(ray_executor, "NO_HEAD_SECONDS", -1.0)
    with pytest.raises(RunAborted, match=r"head of the Ray cluster does not answer: .*refused"):
        made.wait([], 0.0)


# --- what runs on a node


def test_a_node_with_other_versions_is_named() -> None:
    assert version_differences(versions()) == ""
    assert version_differences({"numpy": "0.1"}).endswith("instead of 0.1")
    assert "unreadable" not in WorkerActor().start({"code": "x"}, b"unreadable", "worker-000")


@pytest.fixture
def actor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> WorkerActor:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    made, given = WorkerActor(), pickle.dumps(fake_config(tmp_path / "elsewhere"))
    assert made.start(versions(), given, "worker-000") == ""
    assert received(made) == ([WorkerReady(None, this_processor())], set())
    return made


def received(actor: WorkerActor) -> tuple[list[Message], set[str]]:
    report = actor.report(60.0)
    return [m for m in report.messages if not isinstance(m, Heartbeat)], set(report.files)


def test_a_worker_hands_over_its_record_and_trace_and_leaves_nothing(
    actor: WorkerActor, tmp_path: Path
) -> None:
    (key,) = trial_keys(1)
    actor.send(RunTrial(key, "run_fakes:FakePolicy", (RetryRow("deadline"),)))
    assert received(actor) == ([TrialBegins()], set())
    actor.send(Proceed())
    (message,), files = received(actor)
    assert isinstance(message, TrialDone)
    assert (message.record.key, message.record.attempts) == (key, 2)
    assert files == {f"actions/{key.slug}.npz"}
    (folder,) = tmp_path.iterdir()
    assert list((folder / "actions").iterdir()) == []
    actor.send(Stop())
    assert actor.report(60.0).exit_status == "exit code 0"
    actor.close()
    assert list(tmp_path.iterdir()) == []


def test_a_worker_that_is_killed_is_reported_with_its_output(
    actor: WorkerActor, monkeypatch: pytest.MonkeyPatch
) -> None:
    actor._log.write_bytes(b"x" * 10)
    monkeypatch.setattr(ray_executor, "LOG_BYTES", 6)
    assert actor.report(0.0).output == b"x" * 6
    actor._worker.process.kill()
    report = actor.report(60.0)
    assert (report.exit_status, report.output) == ("signal 9", b"x" * 4)
    actor.close()
