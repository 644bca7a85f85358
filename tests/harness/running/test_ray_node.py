"""What runs on a node of a Ray cluster, without Ray."""

import pickle
import tempfile
from pathlib import Path

import pytest

from robospa.harness.running import ray_executor as ray_node
from robospa.harness.running.executor import (
    Heartbeat,
    Message,
    Proceed,
    RunTrial,
    Stop,
    TrialBegins,
    TrialDone,
    WorkerReady,
)
from robospa.harness.running.manifest import this_processor
from robospa.harness.running.ray_executor import WorkerActor, version_differences, versions
from robospa.harness.running.worker import WorkerConfig
from robospa.results.records.trial_record import RetryRow
from robospa.trial import TrialKey

KEY = TrialKey("Pick_Blocks_Size", 3, 100000)


def test_a_node_with_other_versions_is_named() -> None:
    assert version_differences(versions()) == ""
    assert version_differences({"numpy": "0.1"}).endswith("instead of 0.1")
    assert "unreadable" not in WorkerActor().start({"code": "x"}, b"unreadable", "worker-000")


@pytest.fixture
def actor(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> WorkerActor:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    fakes = {"world": "run_fakes:FakeWorld", "parts": "run_fakes:parts"}
    config = WorkerConfig(tmp_path / "elsewhere", "run_fakes:FakePolicy", **fakes)  # type: ignore[arg-type]
    made = WorkerActor()
    assert made.start(versions(), pickle.dumps(config), "worker-000") == ""
    assert received(made) == ([WorkerReady(None, this_processor())], set())
    return made


def received(actor: WorkerActor) -> tuple[list[Message], set[str]]:
    report = actor.report(60.0)
    return [m for m in report.messages if not isinstance(m, Heartbeat)], set(report.files)


def test_a_worker_hands_over_its_record_and_trace_and_leaves_nothing(
    actor: WorkerActor, tmp_path: Path
) -> None:
    actor.send(RunTrial(KEY, "run_fakes:FakePolicy", (RetryRow("deadline"),)))
    assert received(actor) == ([TrialBegins()], set())
    actor.send(Proceed())
    (message,), files = received(actor)
    assert isinstance(message, TrialDone)
    assert (message.record.key, message.record.attempts) == (KEY, 2)
    assert files == {f"actions/{KEY.slug}.npz"}
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
    monkeypatch.setattr(ray_node, "LOG_BYTES", 6)
    assert actor.report(0.0).output == b"x" * 6
    actor._worker.process.kill()
    report = actor.report(60.0)
    assert (report.exit_status, report.output) == ("signal 9", b"x" * 4)
    actor.close()
