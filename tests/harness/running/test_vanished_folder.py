"""A run's folder that is moved, deleted or replaced while the run goes on stops the run."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from fake_runs import KEY, RECORD, other, outcomes, write
from run_fakes import FakePolicy, request

from robospa.harness.running.atomic_file import StorageError, run_lock
from robospa.harness.running.evaluate import evaluate
from robospa.harness.running.executor import RunAborted
from robospa.harness.running.record_store import RecordWriter, write_actions
from robospa.protocol.policy import TrialInfo
from robospa.protocol.server import ServerThread
from robospa.results.lint import lint_actions
from robospa.results.records.runs import read_file, read_run

pytestmark = pytest.mark.usefixtures("world_asked_here")


def delete(folder: Path) -> None:
    shutil.rmtree(folder)


def move(folder: Path) -> None:
    folder.rename(folder.with_name("moved"))


def replace_by_another(folder: Path) -> None:
    move(folder)
    shutil.copytree(folder.with_name("moved"), folder)


WAYS = (delete, move, replace_by_another)


@pytest.mark.parametrize("vanish", WAYS)
def test_nothing_is_recorded_in_a_folder_that_is_not_the_runs(
    tmp_path: Path, vanish: Callable[[Path], None]
) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    writer = RecordWriter(folder)
    writer.write(RECORD)
    with run_lock(folder) as lock:
        lock.check(folder)
        vanish(folder)
        for check in (writer.check, lambda: lock.check(folder), lambda: writer.write(other(1))):
            with pytest.raises(StorageError, match=r"was moved, deleted or replaced.*put it back"):
                check()
    writer.close()
    if vanish is not delete:
        assert len(read_file(tmp_path / "moved" / "trials" / "0000.jsonl")) == 1
    if vanish is not replace_by_another:
        with pytest.raises(StorageError):
            RecordWriter(folder)
        with pytest.raises(StorageError):
            write_actions(folder, KEY, np.zeros((1, 14), np.float32), "joint")
        assert not folder.exists(), "it was made anew"


def test_a_writer_without_records_removes_no_file_of_another_run(tmp_path: Path) -> None:
    folder = tmp_path / "run"
    folder.mkdir()
    writer = RecordWriter(folder)
    replace_by_another(folder)
    writer.close()
    assert (folder / "trials" / "0000.jsonl").exists()


class Vanishing(FakePolicy):
    """Does `act` to the run's folder in its third trial."""

    act: Callable[[], None]
    trials = 0

    def reset(self, trial: TrialInfo) -> None:
        Vanishing.trials += 1
        if Vanishing.trials == 3:
            Vanishing.act()
        super().reset(trial)


@pytest.mark.parametrize("vanish", [delete, move])
def test_a_run_stops_and_its_moved_folder_goes_on(
    tmp_path: Path, vanish: Callable[[Path], None]
) -> None:
    folder = tmp_path / "run"
    Vanishing.trials, Vanishing.act = 0, staticmethod(lambda: vanish(folder))  # type: ignore[assignment]
    with ServerThread(policy_factory=Vanishing) as server:
        with pytest.raises(RunAborted, match=f"folder {folder} was moved, deleted or replaced"):
            evaluate(request(server.url, folder, 6))
        assert not folder.exists()
        if vanish is move:
            moved = tmp_path / "moved"
            assert len(read_run(moved).missing) == 4
            evaluate(request(server.url, moved, 6, resume=True))
            assert not read_run(moved).missing and lint_errors(moved) == set()


def lint_errors(folder: Path) -> set[str]:
    return {f.rule for f in lint_actions(read_run(folder))}


def test_lost_actions_are_an_error_of_lint_and_named_on_resuming(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "run"
    with ServerThread(policy_factory=FakePolicy) as server:
        evaluate(request(server.url, folder, 6))
        for file in sorted((folder / "actions").iterdir())[:4]:
            file.unlink()
        assert lint_errors(folder) == {"lost-actions"}
        capsys.readouterr()
        evaluate(request(server.url, folder, 6, resume=True))
    said = capsys.readouterr().err
    assert "warning: 4 of 6 finished trials have lost the file of their actions: Pick_" in said
    assert "and 1 more; copy them back" in said


def test_a_folder_of_actions_that_is_gone_is_noticed(tmp_path: Path) -> None:
    run = write(tmp_path / "run", outcomes("Pick_Blocks_Size", 1, [1, 0, 1]))
    assert lint_errors(run.folder) == {"lost-actions"}
