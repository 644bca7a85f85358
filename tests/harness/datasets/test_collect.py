"""A collection ends with the same bytes whatever happens to it, and refuses what is not its own."""

import contextlib
import json
import os
import random
import re
import shutil
import signal
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
from collect_fakes import FakePool, contents, fake_pack, order

import robospa
from robospa.harness.datasets import collect as module
from robospa.harness.datasets.collect import EPISODES, CollectionResult, EpisodeStore, Order
from robospa.harness.datasets.settings import Collection, expected_bytes, lists_of, trial_of
from robospa.harness.running.atomic_file import StorageError, run_lock
from robospa.harness.seeds.attempt import Attempt
from robospa.harness.settings import Compute, SettingsError
from robospa.leaderboard.reproduce import FIRST as FIRST_HIDDEN
from robospa.results.records.manifest import RunError
from robospa.tasks.seeds import FIRST_TRAINING_SEED, LAST_TRAINING_SEED, ListKey, read_lists

KILLS = 12
FIRST = ListKey("Pick_Blocks_Size", 1)
ROOT = Path(__file__).resolve().parents[3]
TRAINING = range(FIRST_TRAINING_SEED, LAST_TRAINING_SEED + 1)


@pytest.fixture(autouse=True)
def _without_formats(monkeypatch: pytest.MonkeyPatch) -> None:
    def read_record(folder: Path) -> SimpleNamespace:
        return SimpleNamespace(**json.loads((folder / "robospa.json").read_text()))

    monkeypatch.setattr(module, "pack", fake_pack)
    monkeypatch.setattr(module, "read_record", read_record)


def run(
    wanted: Order,
    resume: bool = False,
    keep: bool = False,
    opened: Callable[[int], FakePool] = FakePool,
) -> CollectionResult | None:
    return module.make(wanted, opened, resume=resume, keep_episodes=keep, say=lambda line: None)


def test_the_first_good_seeds_are_kept_and_the_others_named(tmp_path: Path) -> None:
    result = run(order(tmp_path), keep=True)
    assert result is not None and (result.episodes, result.missing) == (6, ())
    files = sorted((tmp_path / EPISODES).rglob("*.zip"))
    assert [int(path.stem) for path in files] == [1_000_001, 1_000_002, 1_000_003] * 2
    assert files[0].parent == tmp_path / EPISODES / "aloha-agilex/clean/Pick_Blocks_Size-L1"
    made = json.loads((tmp_path / "robospa.json").read_text())
    why = "the expert does not meet the goal: seed 1000000"
    assert made["failures"] == [[1_000_000, why]] * 2
    assert made["settings"]["images"] == "h264" and made["settings"]["format"] == "lerobot-v3"


def test_several_robots_have_a_data_set_each_and_nothing_stays_beside(tmp_path: Path) -> None:
    run(order(tmp_path, embodiment="aloha-agilex,piper", mode="clean,randomized"))
    assert set(contents(tmp_path)) == {
        f"{robot}/{name}" for robot in ("aloha-agilex", "piper") for name in
        ("all.txt", "robospa.json")
    }  # fmt: skip
    lines = (tmp_path / "piper/all.txt").read_text().splitlines()
    assert len(lines) == 12
    assert "mode='randomized-seen'" in lines[-1] and "split='train'" in lines[-1]


def test_kills_at_any_moment_change_nothing(tmp_path: Path) -> None:
    whole, out = tmp_path / "whole", tmp_path / "killed"
    began = time.perf_counter()
    run(order(whole, tasks=FIRST.task))
    lasts = time.perf_counter() - began
    rng = random.Random(1)
    for _ in range(KILLS):
        child = os.fork()
        if not child:
            with contextlib.suppress(BaseException):
                run(order(out, tasks=FIRST.task), resume=True)
            os._exit(0)
        time.sleep(rng.uniform(0, 1.2 * lasts))
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        if (out / "robospa.json").exists():
            run(order(out, tasks=FIRST.task), resume=True)
            assert contents(out) == contents(whole)
            shutil.rmtree(out)
    run(order(out, tasks=FIRST.task), resume=True)
    assert contents(out) == contents(whole)


def test_what_is_there_is_not_made_again(tmp_path: Path) -> None:
    run(order(tmp_path / "a"), keep=True)
    shutil.copytree(tmp_path / "a/episodes", tmp_path / "b/episodes")
    damaged = EpisodeStore(tmp_path / "b/episodes").path(FIRST, 1_000_002)
    damaged.write_bytes(damaged.read_bytes()[:-40])
    pool = FakePool(6)
    run(order(tmp_path / "b"), resume=True, keep=True, opened=lambda episodes: pool)
    assert pool.made == [1_000_002]
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_a_variant_that_the_expert_does_not_solve_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("collect_fakes.FakeMaker.__call__", lambda self, job: 1 / 0)
    result = run(order(tmp_path, tasks="Pick_Blocks_Size"))
    assert result is not None and result.episodes == 0
    (line,) = result.missing
    assert line.startswith("Pick_Blocks_Size level 1: 0 of 3 episodes; 21 seeds")
    assert "ZeroDivisionError" in line


def test_neither_the_number_of_workers_nor_their_order_matters(tmp_path: Path) -> None:
    run(order(tmp_path / "a"))
    run(order(tmp_path / "b"), opened=lambda episodes: FakePool(episodes, 7))
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_no_episode_stays_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    searches: list[module.Search] = []
    sweep = module.sweep
    monkeypatch.setattr(
        module,
        "sweep",
        lambda submit, n, some, note: (searches.extend(some), sweep(submit, n, some, note))[1],
    )
    run(order(tmp_path))
    kept = [attempt for search in searches for attempt in search.attempts.values()]
    assert len(kept) > 6 and {type(attempt) for attempt in kept} == {Attempt}


def refused(wanted: Order, match: str, resume: bool = False) -> None:
    with pytest.raises((SettingsError, RunError), match=match) as error:
        run(wanted, resume)
    assert "\n" not in str(error.value)


def test_a_finished_data_set_is_not_written_again(tmp_path: Path) -> None:
    """Nor the episodes that were kept of it."""
    run(order(tmp_path), keep=True)
    before = contents(tmp_path)
    assert len([name for name in before if name.endswith(".zip")]) == 6
    refused(order(tmp_path), "already")
    refused(order(tmp_path, episodes=4), "other settings", resume=True)
    assert run(order(tmp_path), resume=True) is None
    assert {k: v for k, v in contents(tmp_path).items() if k != ".lock"} == before


def test_one_that_is_not_finished_wants_resume_and_the_same_settings(tmp_path: Path) -> None:
    EpisodeStore(tmp_path / EPISODES).begin(order(tmp_path).facts)
    refused(order(tmp_path), "--resume")
    text = "episodes was 3 and is 4; images was 'h264' and is 'png'"
    refused(order(tmp_path, episodes=4, images="png"), text, resume=True)
    other = Order(Collection(), "lerobot-v3", tmp_path, {"suite": "other"})
    refused(other, "suite was 's'", resume=True)
    (tmp_path / EPISODES / "settings.json").write_text("[]")
    refused(order(tmp_path), "cannot be read", resume=True)


def test_folders_that_cannot_be_used_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "a").mkdir()
    (tmp_path / "a/thesis.tex").touch()
    refused(order(tmp_path / "a"), "thesis.tex")
    assert sorted(p.name for p in (tmp_path / "a").iterdir()) == [".lock", "thesis.tex"]
    with run_lock(tmp_path / "b"):
        refused(order(tmp_path / "b"), "another process", resume=True)
    refused(order(tmp_path / "a/thesis.tex/out"), "cannot write")
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=1000))
    refused(order(tmp_path / "c"), "1 kB are free: make room")


def test_a_full_disk_is_one_sentence_and_nothing_is_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(order(tmp_path / "a"))
    with monkeypatch.context() as patch:
        synced = os.fsync

        def full(handle: int) -> None:
            if len(list((tmp_path / "b").rglob("*.zip"))) == 4:
                raise OSError(28, "No space left on device")
            synced(handle)

        patch.setattr(os, "fsync", full)
        with pytest.raises(StorageError, match=r"No space left on device \(.* free in .*make room"):
            run(order(tmp_path / "b"))
    run(order(tmp_path / "b"), resume=True)
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_the_space_that_it_takes_is_said(tmp_path: Path) -> None:
    lines: list[str] = []
    module.make(order(tmp_path / "a"), FakePool, say=lines.append)
    assert lines[0].startswith("6 episodes of 2 variants: about ")
    few, many = (
        expected_bytes(Collection(episodes=10, frames=frames), [FIRST], "h264")
        for frames in ("keyframes", "stride")
    )
    assert few < many / 2


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[Compute]:
    """The machines that `robospa.collect` asks for; episodes are made in this process."""
    found: list[Compute] = []

    @contextmanager
    def opener(compute: Compute) -> Iterator[type[FakePool]]:
        found.append(compute)
        yield FakePool

    monkeypatch.setattr(module, "pool_opener", opener)
    monkeypatch.setattr(module, "versions", dict)
    return found


def test_lists_are_what_the_command_takes_as_text(tmp_path: Path, asked: list[Compute]) -> None:
    tasks = ["Pick_Blocks_Size", "Press_Stapler_Repeat"]
    made = robospa.collect(
        tmp_path / "a", tasks=tasks, levels=[1, 2], episodes=1, workers=3, cameras=["head"]
    )
    assert made is not None and made.episodes == 4 and made.folders == (tmp_path / "a",)
    assert asked == [Compute(workers=3)]


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"episode": 3}, "did you mean episodes"),
        ({"tasks": "Pick_Blocks_Siz"}, "did you mean Pick_Blocks_Size"),
        ({"format": "lerobot"}, "did you mean lerobot-v3"),
        ({"cameras": "head,top"}, "no camera 'top'"),
        ({"cameras": "none", "format": "robotwin-hdf5"}, "name cameras"),
        ({"frames": "all"}, "stride, keyframes"),
        ({"frames": "keyframes", "noise": 0.1}, "nothing of noise"),
        ({"images": "gif"}, "gif"),
        ({"noise": 0.6, "mistakes": 0.6}, "more than all"),
        ({"noise": 2.0}, "noise"),
        ({"episodes": 0}, "must be"),
    ],
)
def test_what_cannot_be_is_refused(
    given: dict[str, Any], match: str, tmp_path: Path, asked: list[Compute]
) -> None:
    with pytest.raises(SettingsError, match=match):
        robospa.collect(tmp_path / "b", **given)
    assert not (tmp_path / "b").exists()


def test_no_evaluation_and_no_measurement_has_a_training_seed() -> None:
    files = sorted((ROOT / "tasks/seeds").rglob("*.json"))
    lists = [seeds for path in files for seeds in read_lists(path.read_text()).values()]
    assert len(lists) >= 355 and TRAINING.stop <= FIRST_HIDDEN
    assert all(TRAINING.stop <= min(seeds) or max(seeds) < TRAINING.start for seeds in lists)
    for path in (*ROOT.glob("benchmarks/*.py"), *ROOT.glob("tools/*.py")):
        starts = re.findall(r"(?:FIRST\w*|first|start).{0,40}?(\d[\d_]{4,})", path.read_text())
        assert not [number for number in starts if int(number) in TRAINING], path.name


def test_an_episode_is_a_training_trial_with_textures_of_training() -> None:
    (key,) = lists_of(Collection("Pick_Blocks_Size", "2", embodiment="piper", mode="randomized"))
    trial = trial_of(key, FIRST_TRAINING_SEED)
    assert (trial.seed, trial.split, trial.mode) == (1_000_000, "train", "randomized-seen")
    assert (trial.task, trial.level, trial.embodiment) == ("Pick_Blocks_Size", 2, "piper")
