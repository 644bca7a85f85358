"""Films of a whole run: made during it, after it, by a resume, or long afterwards on demand."""

from __future__ import annotations

import io
import json
import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
import typer
from fake_records import trial_record
from film_fakes import KEYS, FakeProcess, Spawned, config
from report_runs import RECORDS, make_run
from run_fakes import FakePolicy

from robospa.harness.cli import running
from robospa.harness.cli.failures import failures
from robospa.harness.running import film_stage
from robospa.harness.running import films as films_module
from robospa.harness.running.evaluate import Request, evaluate
from robospa.harness.running.film_process import FilmMaker, serve
from robospa.harness.running.film_stage import (
    FilmsInterrupted,
    film_lines,
    films_afterwards,
    films_of,
    finish_films,
    replay_config,
    unfilmed,
)
from robospa.harness.running.films import Films
from robospa.harness.running.progress import Progress
from robospa.harness.running.run_lock import run_lock
from robospa.harness.running.runner import RunOptions
from robospa.harness.running.worker import WorkerConfig
from robospa.results.records.films import film_name, films_in
from robospa.results.records.manifest import RunError
from robospa.results.records.run_io import Run, read_records, read_run

pytest.importorskip("av")


class StillPolicy(FakePolicy):
    """Fails at everything."""

    def infer(self, observation: Any) -> Any:
        return 0 * super().infer(observation)


@pytest.fixture
def spawned(monkeypatch: pytest.MonkeyPatch) -> Iterator[Spawned]:
    """Processes for films as threads of this one."""

    def work(process: FakeProcess) -> None:
        serving = (FilmMaker(process.config), process.pipe.recv, process.pipe.send)
        Thread(target=serve, args=serving, daemon=True).start()

    found = Spawned(on_start=work)
    monkeypatch.setattr(films_module, "start_process", found)
    monkeypatch.setattr(os, "setpriority", lambda *_: None)
    yield found


def request(folder: Path, policy: str = "StillPolicy", **changes: Any) -> Request:
    where = __name__ if policy == "StillPolicy" else "run_fakes"
    made = WorkerConfig(
        folder, f"{where}:{policy}", world="run_fakes:FakeWorld", parts="run_fakes:parts"
    )
    return Request(replace(made, **changes), KEYS[:2], RunOptions(workers=1, backoff=0.01))


def names(folder: Path) -> list[str]:
    return sorted(films_in(folder))


def test_failures_are_filmed_and_a_film_that_is_owed_is_made_by_the_next_resume(
    tmp_path: Path, spawned: Spawned, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = request(tmp_path, video="failures")
    evaluate(asked)
    assert names(tmp_path) == [film_name(key) for key in KEYS[:2]]
    assert {record.video for record in read_records(tmp_path).values()} == set(names(tmp_path))
    assert "2 films made" in capsys.readouterr().err
    assert spawned.alive == []
    (tmp_path / film_name(KEYS[1])).unlink()
    evaluate(replace(asked, resume=True))
    assert len(names(tmp_path)) == 2


def test_a_resume_that_wants_no_films_makes_none_that_are_owed(tmp_path: Path) -> None:
    known = {key: trial_record(key, False, video=film_name(key)) for key in KEYS}
    asked = request(tmp_path).config
    assert films_of(asked, known, 1).owed == 0
    assert films_of(replace(asked, video="first"), known, 1).owed == len(KEYS)


@pytest.mark.parametrize(
    ("video", "filmed"),
    [("none", ""), ("failures", "23"), ("first", "13"), ("all", "1234")],
)
def test_only_what_was_asked_for_is_filmed(tmp_path: Path, video: str, filmed: str) -> None:
    first, second = KEYS[:2]
    asked = request(tmp_path, video=video, samples=frozenset({first})).config
    found = [(first, True), (second, False), (first, False), (second, True)]
    wanted = [str(number) for number, trial in enumerate(found, 1) if asked.films(*trial)]
    assert "".join(wanted) == filmed


def test_a_filming_that_fails_loses_no_record_and_is_one_sentence(
    tmp_path: Path, spawned: Spawned, capsys: pytest.CaptureFixture[str]
) -> None:
    work = spawned.on_start

    def obstruct(process: FakeProcess) -> None:
        (tmp_path / "videos").write_text("in the way")
        work(process)

    spawned.on_start = obstruct
    evaluate(request(tmp_path, video="all"))
    assert len(read_records(tmp_path)) == 2
    said = capsys.readouterr().err.splitlines()
    (line,) = [text for text in said if text.startswith("warning: ")]
    assert "2 films are still to be made (cannot write" in line
    assert line.endswith(f"`robospa failures {tmp_path} --film` makes them")


class Interrupting(Films):
    def finish(self, show: Callable[[], None] = lambda: None) -> None:
        self.poll()
        raise KeyboardInterrupt


def test_ctrl_c_leaves_films_owed_and_no_process(tmp_path: Path, spawned: Spawned) -> None:
    spawned.on_start = lambda process: None
    films = Interrupting(config(tmp_path))
    films.add([trial_record(key, False, video=film_name(key)) for key in KEYS])
    with pytest.raises(FilmsInterrupted, match="6 films are still to be made: `robospa failures"):
        finish_films(films, Progress(1, 1, io.StringIO()), tmp_path)
    assert len(spawned.processes) == 1 and spawned.alive == []


def test_scores_are_shown_although_films_are_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    make_run(tmp_path, RECORDS)

    def interrupted(asked: Request) -> None:
        raise FilmsInterrupted("3 films are still to be made")

    monkeypatch.setattr(running, "evaluate", interrupted)
    with pytest.raises(typer.Exit) as ended:
        running.run_and_show(request(tmp_path))
    out, err = capsys.readouterr()
    assert ended.value.exit_code == 130 and "Pick It" in out
    assert err == "robospa: interrupted after the last trial; 3 films are still to be made\n"


def test_films_that_could_not_be_made_are_one_sentence(tmp_path: Path) -> None:
    films = Films(config(tmp_path))
    films.made, films.failed, films.troubles = 7, 2, ["a ends in another state", "b too"]
    made, failed = film_lines(films, tmp_path, 4.2)
    assert made == "7 films made; waited 4 s for them"
    assert failed == "warning: 2 films could not be made: a ends in another state"


def filmable(folder: Path, **settings: Any) -> Run:
    """A run of our own world on paper."""
    make_run(folder, RECORDS)
    path = folder / "run.json"
    manifest = json.loads(path.read_text())
    world = {"name": "sapien", "render": None, "control": "rest_to_rest"}
    manifest["settings"] |= {"world": world, "step_scale": 0.5, **settings}
    path.write_text(json.dumps(manifest))
    return read_run(folder)


def test_afterwards_the_failed_trials_without_a_film_are_filmed_as_they_were_run(
    tmp_path: Path,
) -> None:
    run = filmable(tmp_path)
    assert [r.key for r in unfilmed(run)] == sorted(r.key for r in RECORDS if not r.success)
    films = films_afterwards(run)
    assert films.owed == 3
    assert films._config.world_arguments == {"render": None, "control": "rest_to_rest"}
    assert films._config.step_scale == 0.5
    (tmp_path / "videos").mkdir()
    (tmp_path / film_name(RECORDS[3].key)).write_bytes(b"film")
    assert films_afterwards(read_run(tmp_path)).owed == 2


def test_afterwards_films_show_the_cameras_that_the_run_names(tmp_path: Path) -> None:
    run = filmable(tmp_path)
    assert replay_config(run).cameras == ("head",)
    (tmp_path / "settings.toml").write_text('[recording]\nvideo_cameras = "head,third"\n')
    assert replay_config(run).cameras == ("head", "third")
    (tmp_path / "settings.toml").write_text("[recording]\nvideo_cameras = 7\n")
    assert replay_config(run).cameras == ("head",)


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"salt_sha256": "x"}, "are hidden: resume it"),
        ({"world": {"name": "os:system", "command": "true"}}, "was run in another world"),
        ({"world": {"name": "sapien", "models": "x"}}, "was run in another world"),
    ],
)
def test_a_run_that_cannot_be_filmed_from_its_folder_is_refused(
    tmp_path: Path, settings: dict[str, Any], sentence: str
) -> None:
    with pytest.raises(RunError, match=sentence):
        films_afterwards(filmable(tmp_path, **settings))


def test_a_run_that_is_going_on_makes_its_films_itself(tmp_path: Path) -> None:
    filmable(tmp_path)
    with run_lock(tmp_path), pytest.raises(RunError, match="is going on and makes its films"):
        films_afterwards(read_run(tmp_path))


def test_the_command_makes_missing_films_before_it_counts(
    tmp_path: Path,
    spawned: Spawned,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    evaluate(request(tmp_path))
    assert names(tmp_path) == []
    monkeypatch.setattr(film_stage, "SAPIEN_NAME", "run_fakes:FakeWorld")
    monkeypatch.setattr(film_stage, "TASK_PARTS", "run_fakes:parts")
    capsys.readouterr()
    failures(tmp_path, by="task", trials=True, film=True, layout="json")
    out, err = capsys.readouterr()
    assert [row["video"] for row in json.loads(out)] == [film_name(key) for key in KEYS[:2]]
    assert err.splitlines() == ["films: 0 made, 2 to make", "2 films made"]
    failures(tmp_path, by="task", trials=True, film=True, layout="json")
    assert capsys.readouterr().err == "no film is missing\n"
