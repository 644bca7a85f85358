"""What reaches the disk, in which order, and what is left when it does not."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest
from fake_runs import KEY, RECORD, other

from robospa.harness.running.atomic_file import StorageError, replace_file
from robospa.harness.running.record_store import RecordWriter, read_actions, recover_folder
from robospa.harness.running.worker import Worker, WorkerConfig
from robospa.results.records.manifest import RunError
from robospa.results.records.runs import action_path, read_file, read_records
from robospa.results.records.trial_record import TrialRecord


def full(*_: object) -> int:
    raise OSError(errno.ENOSPC, "No space left on device")


class Strict(RecordWriter):
    """Refuses a record whose actions are not on disk."""

    def write(self, record: TrialRecord) -> None:
        actions, _ = read_actions(action_path(self.path.parents[1], record.key))
        assert len(actions) == record.steps
        super().write(record)


def test_a_record_is_written_only_after_its_actions(tmp_path: Path) -> None:
    config = WorkerConfig(
        tmp_path, "run_fakes:FakePolicy", world="run_fakes:FakeWorld", parts="run_fakes:parts"
    )
    worker = Worker(config, Strict(tmp_path))
    worker.run(KEY, config.policy)
    worker.writer.close()
    worker.close()
    assert list(read_records(tmp_path)) == [KEY]


def test_names_are_on_disk_before_anybody_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced: list[str] = []
    real = os.fsync

    def fsync(file: int) -> None:
        synced.append(os.path.basename(os.readlink(f"/proc/self/fd/{file}")))
        real(file)

    monkeypatch.setattr(os, "fsync", fsync)
    replace_file(tmp_path / "actions" / "x", b"data")
    assert synced[0].endswith(".part") and synced[1:] == ["actions"]
    synced.clear()
    RecordWriter(tmp_path).write(RECORD)
    assert synced == ["trials", tmp_path.name, "0000.jsonl"]


@pytest.mark.parametrize("broken", ["write", "fsync"])
def test_a_record_that_does_not_fit_is_taken_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, broken: str
) -> None:
    writer = RecordWriter(tmp_path)
    writer.write(RECORD)
    real = os.write
    with monkeypatch.context() as patch:
        patch.setattr(os, broken, full if broken == "fsync" else lambda f, d: real(f, d[:100]))
        with pytest.raises(StorageError, match=r"cannot write .*0000\.jsonl: No space left"):
            writer.write(other(1))
    writer.write(other(2))
    assert [r.key.seed for r in read_file(writer.path)] == [KEY.seed, 2]


def test_a_full_disk_is_one_sentence_with_folder_and_free_space(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StorageError) as caught:
        replace_file(tmp_path / "x", b"data")
    text = str(caught.value)
    assert f"cannot write {tmp_path}/x: No space left on device (" in text
    assert text.endswith(f"B free in {tmp_path}); make room")
    assert list(tmp_path.iterdir()) == []


def test_a_folder_that_cannot_be_written_is_named() -> None:
    with pytest.raises(StorageError, match=r"cannot write /proc/run/trials/0000\.jsonl: "):
        RecordWriter(Path("/proc/run"))


def test_what_a_killed_worker_left_behind_is_settled(tmp_path: Path) -> None:
    writer = RecordWriter(tmp_path)
    writer.write(RECORD)
    os.close(writer._file)  # as the kernel does
    os.close(RecordWriter(tmp_path)._file)
    (tmp_path / "actions").mkdir()
    (tmp_path / "actions" / ".x.npz.12.part").touch()
    (tmp_path / ".run.json.12.part").touch()
    recover_folder(tmp_path)
    left = sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file())
    assert left == ["trials/0000.jsonl"]


def test_a_worker_that_outlives_its_driver_is_not_raced(tmp_path: Path) -> None:
    writer = RecordWriter(tmp_path)
    writer.write(RECORD)
    with pytest.raises(RunError, match=r"an earlier driver still writes to .*0000\.jsonl; end it"):
        recover_folder(tmp_path, patience=0.1)
    writer.close()
    recover_folder(tmp_path, patience=0.1)
