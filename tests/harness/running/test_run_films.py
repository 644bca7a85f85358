"""Films follow the run and nothing that goes wrong with them ends it; what becomes of one film; the
films of a whole run: made during it, after it, by a resume, or long afterwards on demand."""

import io
import json
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from threading import Event
from typing import Any

import pytest
import typer
from fake_runs import RECORDS, make_run, trial_record
from film_fakes import KEYS, Filmers, recorded
from run_fakes import FakePolicy, FakeStill, FakeWorld, NanPolicy, fake_config

from robospa.harness.cli import eval as command
from robospa.harness.cli.report import report
from robospa.harness.pool import WorkerDied, WorkerStuck
from robospa.harness.progress import Progress
from robospa.harness.running import films as module
from robospa.harness.running.atomic_file import run_lock
from robospa.harness.running.evaluate import Request, evaluate
from robospa.harness.running.films import FilmDone, FilmMaker, Films, FilmsInterrupted
from robospa.harness.running.manifest import this_processor, write_manifest
from robospa.harness.running.runner import RunOptions
from robospa.harness.running.worker import WorkerConfig
from robospa.harness.world import RenderUnavailable
from robospa.observation import CameraSpec
from robospa.results.records.manifest import RunAbout, RunError, RunSettings, make_manifest
from robospa.results.records.runs import Run, film_name, films_in, read_records, read_run
from robospa.results.records.trial_record import TrialRecord

av = pytest.importorskip("av")
pytestmark = pytest.mark.usefixtures("world_asked_here")
KEY = KEYS[5]
WANTED = [trial_record(key, False, video=film_name(key)) for key in KEYS]


@pytest.fixture
def filmers(monkeypatch: pytest.MonkeyPatch) -> Filmers:
    found = Filmers()
    monkeypatch.setattr(module, "film_process", found)
    monkeypatch.setattr(module, "cores", lambda: 2)
    return found


@pytest.fixture
def films(tmp_path: Path, filmers: Filmers) -> Films:
    return Films(fake_config(tmp_path))


# --- many films -----------------------------------------------------------------------------------


def test_beside_the_run_few_processes_of_low_priority_film_and_after_it_more(
    films: Films, filmers: Filmers
) -> None:
    go_on, began = Event(), Event()

    def film(config: WorkerConfig, record: TrialRecord) -> FilmDone:
        began.set()
        assert go_on.wait(30)
        return FilmDone(record.key)

    filmers.film = film
    films.add(WANTED)
    assert began.wait(30)
    films.poll()
    assert filmers.started == [19] and filmers.asked == KEYS[:1] and films.pending == 6
    films.finish(go_on.set)
    films.close()
    assert (films.made, films.pending, films.troubles) == (6, 0, [])
    assert filmers.started == [19, 19] and sorted(filmers.asked) == KEYS and not filmers.alive


def raising(error: Exception, key: object = None) -> Callable[..., FilmDone]:
    """A film of `key`, or any, that ends so."""

    def film(config: WorkerConfig, record: TrialRecord) -> FilmDone:
        if key is None or record.key == key:
            raise error
        return FilmDone(record.key)

    return film


@pytest.mark.parametrize(
    ("film", "trouble"),
    [
        (raising(WorkerDied("signal 11"), KEYS[0]), "died (signal 11)"),
        (raising(WorkerStuck("it took longer than 1800 s"), KEYS[0]), "took longer"),
        (lambda _, record: FilmDone(record.key, "x" * (record.key == KEYS[0])), "x"),
    ],
)
def test_a_trial_that_cannot_be_filmed_is_left_out_and_others_go_on(
    films: Films, filmers: Filmers, film: Callable[..., FilmDone], trouble: str
) -> None:
    filmers.film = film
    films.add(WANTED)
    films.finish()
    films.close()
    assert (films.made, films.failed, films.pending) == (5, 1, 0)
    assert trouble in films.troubles[0]


@pytest.mark.parametrize(
    ("film", "stopped", "failed"),
    [
        (lambda _, r: FilmDone(r.key, "cannot write x.mp4", stop=True), "cannot write x.mp4", 0),
        (raising(BlockingIOError(11, "temporarily unavailable")), "temporarily unavailable", 0),
        (raising(WorkerDied("signal 11")), "3 processes in a row died", 3),
    ],
)
def test_what_every_film_would_meet_ends_the_filming_and_the_rest_stays_wanted(
    films: Films, filmers: Filmers, film: Callable[..., FilmDone], stopped: str, failed: int
) -> None:
    filmers.film = film
    films.add(WANTED)
    films.finish()
    assert stopped in films.stopped and (films.failed, films.pending) == (failed, 6 - failed)
    films.close()
    assert not filmers.alive
    (line,) = [text for text in module.film_lines(films) if stopped in text]
    assert line.endswith(f"`robospa report {films.config.folder} --film` makes them")


def test_ctrl_c_leaves_what_is_not_made_for_later(
    films: Films, filmers: Filmers, monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupt(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(module, "wait", interrupt)
    filmers.film = lambda _, record: FilmDone(record.key, "", stop=True)
    films.add(WANTED)
    with pytest.raises(FilmsInterrupted, match="6 films are still to be made"):
        module.finish_films(films, Progress(1, 1, io.StringIO()))
    assert not filmers.alive


# --- one film -------------------------------------------------------------------------------------


def made(folder: Path, answer: FilmDone) -> list[Any]:
    """The pictures of the film that was made."""
    assert answer == FilmDone(KEY)
    with av.open(io.BytesIO((folder / film_name(KEY)).read_bytes())) as file:
        return [frame.to_ndarray(format="rgb24") for frame in file.decode(video=0)]


def test_a_film_is_made_of_a_finished_trial(tmp_path: Path) -> None:
    pictures = made(tmp_path, FilmMaker(fake_config(tmp_path)).make(recorded(tmp_path, KEY)))
    assert len(pictures) == 1 + 5  # six actions of 20 ms are over before the second frame is due
    assert pictures[0].shape == (360, 480, 3)
    assert float(pictures[-1].mean()) == pytest.approx(6, abs=2)


class StillPolicy(FakePolicy):
    """Fails at everything."""

    def infer(self, observation: Any) -> Any:
        return 0 * super().infer(observation)


@pytest.mark.parametrize("scale", [0.1, 3.0])
def test_step_limits_of_the_run_hold(tmp_path: Path, scale: float) -> None:
    record = recorded(tmp_path, KEY, StillPolicy(), scale)
    assert record.steps == round(20 * scale)
    made(tmp_path, FilmMaker(fake_config(tmp_path, step_scale=scale)).make(record))


def test_a_trial_whose_first_action_was_refused_has_a_film_too(tmp_path: Path) -> None:
    record = recorded(tmp_path, KEY, NanPolicy())
    assert (record.end, record.steps) == ("policy_error", 0)
    assert len(made(tmp_path, FilmMaker(fake_config(tmp_path)).make(record))) == 6


@pytest.mark.parametrize(
    ("field", "words"), [("digest", "another state"), ("scene_digest", "another scene")]
)
def test_another_trial_is_not_shown(tmp_path: Path, field: str, words: str) -> None:
    about = RunAbout(processors=(this_processor(),))
    write_manifest(tmp_path, make_manifest(RunSettings(), (KEY,), about))
    record = replace(recorded(tmp_path, KEY), **{field: "other"})  # type: ignore[arg-type]
    done = FilmMaker(fake_config(tmp_path)).make(record)
    assert words in done.trouble and KEY.slug in done.trouble and not done.stop
    assert not (tmp_path / film_name(KEY)).exists()


def test_lost_actions_are_named_and_do_not_end_the_filming(tmp_path: Path) -> None:
    record = recorded(tmp_path, KEY)
    (tmp_path / "actions" / f"{KEY.slug}.npz").unlink()
    maker = FilmMaker(fake_config(tmp_path))
    assert "is no action trace" in (done := maker.make(record)).trouble and not done.stop
    made(tmp_path, maker.make(recorded(tmp_path, KEY)))


class Blind(FakeWorld):
    def still(self) -> FakeStill:
        class Dark(FakeStill):
            def draw(self, cameras: Sequence[CameraSpec]) -> Any:
                raise RenderUnavailable("no Vulkan device; install mesa")

        return Dark(0)


def test_where_nothing_can_be_drawn_or_written_one_sentence_ends_the_filming(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    record = recorded(tmp_path, KEY)
    done = FilmMaker(fake_config(tmp_path, world=f"{__name__}:Blind")).make(record)
    assert (done.trouble, done.stop) == ("no Vulkan device; install mesa", True)
    (tmp_path / "videos").write_text("in the way")
    done = FilmMaker(fake_config(tmp_path)).make(record)
    assert done.stop and done.trouble.startswith(f"cannot write {tmp_path}/videos/")
    monkeypatch.setattr(module, "RESERVE", 1e18)
    done = FilmMaker(fake_config(tmp_path)).make(record)
    assert done.stop and "MB left" in done.trouble


# --- a whole run ----------------------------------------------------------------------------------


@pytest.fixture
def filming(filmers: Filmers) -> Filmers:
    """What films in this process."""
    filmers.film = lambda config, record: FilmMaker(config).make(record)
    return filmers


def request(folder: Path, policy: str = f"{__name__}:StillPolicy", **changes: object) -> Request:
    given = fake_config(folder, policy, **changes)
    return Request(given, KEYS[:2], RunOptions(workers=1, backoff=0.01))


def names(folder: Path) -> list[str]:
    return sorted(films_in(folder))


def test_failures_are_filmed_by_processes_and_what_is_missing_by_the_next_resume(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    asked = request(tmp_path, video="failures")
    evaluate(asked)
    assert names(tmp_path) == [film_name(key) for key in KEYS[:2]]
    assert {record.video for record in read_records(tmp_path).values()} == set(names(tmp_path))
    assert "2 films made" in capsys.readouterr().err
    (tmp_path / film_name(KEYS[1])).unlink()
    evaluate(replace(asked, resume=True, after_trials=lambda: False))
    assert "1 film still to be made: `robospa report" in capsys.readouterr().err
    evaluate(replace(asked, resume=True))
    assert len(names(tmp_path)) == 2


def test_of_failures_alike_three_are_filmed_with_those_that_are_there(
    tmp_path: Path, filmers: Filmers
) -> None:
    keys = [replace(KEYS[0], seed=100_000 + number) for number in range(6)]
    known = {key: trial_record(key, False, video=film_name(key)) for key in keys}
    (tmp_path / "videos").mkdir()
    (tmp_path / film_name(keys[4])).write_bytes(b"film")
    other = replace(KEYS[0], level=2)
    strange = {other: trial_record(other, False, video="../x.mp4")}
    for video, made in (("failures", 2), ("all", 5)):
        films = module.films_of(fake_config(tmp_path, video=video), known | strange, 1)
        assert films.pending == made
        films.close()


@pytest.mark.parametrize(
    ("video", "filmed"), [("none", ""), ("failures", "23"), ("first", "13"), ("all", "1234")]
)
def test_only_what_was_asked_for_is_filmed(tmp_path: Path, video: str, filmed: str) -> None:
    first, second = KEYS[:2]
    asked = fake_config(tmp_path, video=video, samples=frozenset({first}))
    found = [(first, True), (second, False), (first, False), (second, True)]
    wanted = [str(number) for number, trial in enumerate(found, 1) if asked.films(*trial)]
    assert "".join(wanted) == filmed


def test_a_filming_that_fails_loses_no_record_and_is_one_sentence(
    tmp_path: Path, filming: Filmers, capsys: pytest.CaptureFixture[str]
) -> None:
    def obstructed(config: WorkerConfig, record: TrialRecord) -> FilmDone:
        (tmp_path / "videos").write_text("in the way")
        return FilmMaker(config).make(record)

    filming.film = obstructed
    evaluate(request(tmp_path, video="all"))
    assert len(read_records(tmp_path)) == 2
    said = capsys.readouterr().err.splitlines()
    (line,) = [text for text in said if text.startswith("warning: ")]
    assert "2 films still to be made (cannot write" in line


def test_scores_are_shown_although_films_are_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    make_run(tmp_path, RECORDS)

    def interrupted(asked: Request) -> None:
        asked.after_trials()
        assert "Pick It" in capsys.readouterr().out  # before anybody waits for films
        raise FilmsInterrupted("3 films are still to be made")

    monkeypatch.setattr(command, "run_request", interrupted)
    with pytest.raises(typer.Exit) as ended:
        command.run_and_show(request(tmp_path))
    out, err = capsys.readouterr()
    assert ended.value.exit_code == 130 and out == ""
    assert err == "robospa: interrupted after the last trial; 3 films are still to be made\n"


def filmable(folder: Path, **settings: object) -> Run:
    """A run of our own world on paper."""
    make_run(folder, RECORDS)
    path = folder / "run.json"
    manifest = json.loads(path.read_text())
    arguments = {"render": None, "control": "rest_to_rest"}
    world = {"name": "sapien", "arguments": arguments}
    manifest["settings"] |= {"world": world, "step_scale": 0.5, **settings}
    path.write_text(json.dumps(manifest))
    return read_run(folder)


def test_afterwards_the_failed_trials_without_a_film_are_filmed_as_they_were_run(
    tmp_path: Path, filmers: Filmers
) -> None:
    run = filmable(tmp_path)
    assert [r.key for r in module.unfilmed(run)] == sorted(r.key for r in RECORDS if not r.success)
    films = module.films_afterwards(run)
    assert films.pending == 3 and films.config.step_scale == 0.5
    assert films.config.world_arguments == {"render": None, "control": "rest_to_rest"}
    films.finish()
    films.close()
    assert set(filmers.started) == {0}
    (tmp_path / "videos").mkdir()
    (tmp_path / film_name(RECORDS[3].key)).write_bytes(b"film")
    assert len(module.unfilmed(read_run(tmp_path))) == 2


def test_afterwards_films_show_the_cameras_that_the_run_names(tmp_path: Path) -> None:
    run, usual = filmable(tmp_path), ("third", "head")
    assert module.replay_config(run).cameras == usual
    for said, shown in (('"head"', ("head",)), ("7", usual)):
        (tmp_path / "settings.toml").write_text(f"[recording]\nvideo_cameras = {said}\n")
        assert module.replay_config(run).cameras == shown


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"salt_sha256": "x"}, "are hidden"),
        ({"world": {"name": "os:system", "arguments": {"command": "true"}}}, "another world"),
        ({"world": {"name": "sapien", "arguments": {"models": "x"}}}, "another world"),
    ],
)
def test_a_run_that_cannot_be_filmed_from_its_folder_is_refused(
    tmp_path: Path, settings: dict[str, object], words: str
) -> None:
    with pytest.raises(RunError, match=words):
        module.films_afterwards(filmable(tmp_path, **settings))


def test_a_run_that_is_going_on_makes_its_films_itself(tmp_path: Path) -> None:
    filmable(tmp_path)
    with run_lock(tmp_path), pytest.raises(RunError, match="going on"):
        module.films_afterwards(read_run(tmp_path))


def test_the_command_makes_missing_films_before_it_counts(
    tmp_path: Path,
    filming: Filmers,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    evaluate(request(tmp_path))
    assert names(tmp_path) == []
    monkeypatch.setattr(module, "SAPIEN_NAME", "run_fakes:FakeWorld")
    monkeypatch.setattr(module, "TASK_PARTS", "run_fakes:parts")
    for said in ("2 films made", "no film is missing"):
        capsys.readouterr()
        report([tmp_path], failures=True, trials=True, film=True, as_json=True)
        out, err = capsys.readouterr()
        assert [row["video"] for row in json.loads(out)] == [film_name(key) for key in KEYS[:2]]
        assert err.splitlines()[-1] == said
