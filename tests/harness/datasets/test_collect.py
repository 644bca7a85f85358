"""A collection ends with the same bytes whatever happens to it, and refuses what is not its own."""

from __future__ import annotations

import contextlib
import json
import os
import random
import shutil
import signal
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from collect_fakes import FakePool, contents, fake_pack, order

from robospa.harness.datasets import collect as module
from robospa.harness.datasets.collect import EPISODES, EpisodeStore, Order, collect
from robospa.harness.datasets.settings import Collection, command_of, expected_bytes
from robospa.harness.running.atomic_file import StorageError
from robospa.harness.running.run_lock import run_lock
from robospa.harness.seeds.attempt import Attempt
from robospa.harness.settings import SettingsError
from robospa.results.records.manifest import RunError
from robospa.tasks.seeds import ListKey

KILLS = 30
FIRST = ListKey("Pick_Blocks_Size", 1)


@pytest.fixture(autouse=True)
def _without_formats(monkeypatch: pytest.MonkeyPatch) -> None:
    def read_record(folder: Path) -> SimpleNamespace:
        return SimpleNamespace(**json.loads((folder / "robospa.json").read_text()))

    monkeypatch.setattr(module, "pack", fake_pack)
    monkeypatch.setattr(module, "read_record", read_record)


def quiet(line: str) -> None: ...


def run(wanted: Order, resume: bool = False, keep: bool = False) -> module.CollectionResult | None:
    return collect(wanted, FakePool, resume=resume, keep_episodes=keep, say=quiet)


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


def test_nothing_stays_beside_the_data_set(tmp_path: Path) -> None:
    run(order(tmp_path))
    assert set(contents(tmp_path)) == {"all.txt", "robospa.json"}


def test_several_robots_have_a_data_set_each(tmp_path: Path) -> None:
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
    rng, finished = random.Random(1), 0
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
            finished += 1
    run(order(out, tasks=FIRST.task), resume=True)
    assert contents(out) == contents(whole)
    assert finished < KILLS


def test_neither_the_number_of_workers_nor_their_order_matters(tmp_path: Path) -> None:
    run(order(tmp_path / "a"))
    collect(order(tmp_path / "b"), lambda episodes: FakePool(episodes, 7), say=quiet)
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_what_is_there_is_not_made_again(tmp_path: Path) -> None:
    run(order(tmp_path / "a"), keep=True)
    shutil.copytree(tmp_path / "a/episodes", tmp_path / "b/episodes")
    damaged = EpisodeStore(tmp_path / "b/episodes").path(FIRST, 1_000_002)
    damaged.write_bytes(damaged.read_bytes()[:-40])
    pools: list[FakePool] = []

    def open_pool(episodes: int) -> FakePool:
        pools.append(FakePool(episodes))
        return pools[0]

    collect(order(tmp_path / "b"), open_pool, resume=True, keep_episodes=True, say=quiet)
    assert pools[0].made == [1_000_002]
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_a_variant_that_the_expert_does_not_solve_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("collect_fakes.FakeMaker.__call__", lambda self, job: 1 / 0)
    result = run(order(tmp_path, tasks="Pick_Blocks_Size"))
    assert result is not None and result.episodes == 0
    (line,) = result.missing
    assert line == (
        "Pick_Blocks_Size level 1: 0 of 3 episodes; 21 seeds gave none, such as: "
        "ZeroDivisionError: division by zero"
    )


def test_no_episode_stays_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kept: list[Attempt] = []
    add = EpisodeStore.add

    def watched(store: EpisodeStore, key: ListKey, made: module.EpisodeAttempt) -> Attempt:
        kept.append(add(store, key, made))
        return kept[-1]

    monkeypatch.setattr(EpisodeStore, "add", watched)
    searches: list[module.Search] = []
    sweep = module.sweep
    monkeypatch.setattr(
        module,
        "sweep",
        lambda submit, n, some, note: (searches.extend(some), sweep(submit, n, some, note))[1],
    )
    run(order(tmp_path))
    assert kept and all(type(item) is Attempt for item in kept)
    assert {id(a) for s in searches for a in s.attempts.values()} == {id(a) for a in kept}


def refusal(wanted: Order, resume: bool = False) -> str:
    with pytest.raises((SettingsError, RunError)) as error:
        run(wanted, resume)
    assert "\n" not in str(error.value)
    return str(error.value)


def test_a_finished_data_set_is_not_written_again(tmp_path: Path) -> None:
    run(order(tmp_path))
    before = contents(tmp_path)
    assert "has a data set already; choose another --out" in refusal(order(tmp_path))
    assert "is of other settings" in refusal(order(tmp_path, episodes=4), resume=True)
    assert run(order(tmp_path), resume=True) is None
    assert {k: v for k, v in contents(tmp_path).items() if k != ".lock"} == before


def test_one_that_is_not_finished_wants_resume_and_the_same_settings(tmp_path: Path) -> None:
    EpisodeStore(tmp_path / EPISODES).begin(order(tmp_path).facts)
    assert "add --resume" in refusal(order(tmp_path))
    text = refusal(order(tmp_path, episodes=4, images="png"), resume=True)
    assert "episodes was 3 and is 4; images was 'h264' and is 'png'" in text
    other = Order(Collection(), "lerobot-v3", tmp_path, "", {"suite": "other"})
    assert "suite was 's' and is 'other'" in refusal(other, resume=True)
    (tmp_path / EPISODES / "settings.json").write_text("[]")
    assert "cannot be read" in refusal(order(tmp_path), resume=True)


def test_a_folder_with_other_files_is_refused(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").touch()
    assert "has other files, such as thesis.tex" in refusal(order(tmp_path))
    assert sorted(p.name for p in tmp_path.iterdir()) == [".lock", "thesis.tex"]


def test_two_collections_do_not_share_a_folder(tmp_path: Path) -> None:
    with run_lock(tmp_path):
        assert "another process" in refusal(order(tmp_path), resume=True)


def test_a_folder_that_cannot_be_made_is_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    assert "cannot write" in refusal(order(tmp_path / "file/out"))


def test_a_full_disk_is_one_sentence_and_nothing_is_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run(order(tmp_path / "a"))
    synced = os.fsync

    def full(handle: int) -> None:
        if len(list((tmp_path / "b").rglob("*.zip"))) == 4:
            raise OSError(28, "No space left on device")
        synced(handle)

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(StorageError, match=r"No space left on device \(.* free in .*make room"):
        run(order(tmp_path / "b"))
    monkeypatch.undo()
    _without_formats.__wrapped__(monkeypatch)  # type: ignore[attr-defined]
    run(order(tmp_path / "b"), resume=True)
    assert contents(tmp_path / "a") == contents(tmp_path / "b")


def test_the_room_that_it_takes_is_said_and_compared_with_what_is_free(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    lines: list[str] = []
    collect(order(tmp_path / "a"), FakePool, say=lines.append)
    assert lines[0].startswith("6 episodes of 2 variants: about ")
    assert "twice that while it is packed" in lines[0]
    monkeypatch.setattr(shutil, "disk_usage", lambda path: SimpleNamespace(free=1000))
    text = refusal(order(tmp_path / "b"))
    assert "are needed" in text and "1 kB are free: make room" in text


def test_impossible_settings_are_one_sentence(tmp_path: Path) -> None:
    unknown = replace(order(tmp_path), layout="lerobot")
    assert "no format 'lerobot'; did you mean lerobot-v3? known are" in refusal(unknown)
    assert "no camera 'top'" in refusal(order(tmp_path, cameras="head,top"))
    assert "frames 'all' is not one of" in refusal_of(frames="all")
    assert "shows nothing of noise" in refusal_of(frames="keyframes", noise=0.1)
    blind = replace(order(tmp_path, cameras="none"), layout="robotwin-hdf5")
    assert "robotwin-hdf5 is a format of pictures: name cameras" in refusal(blind)
    assert "images 'gif' is not one of" in refusal_of(images="gif")
    assert "more than all" in refusal_of(noise=0.6, mistakes=0.6)
    assert "must be" in refusal_of(episodes=0)


def refusal_of(**changes: object) -> str:
    with pytest.raises(SettingsError) as error:
        Collection(**changes)  # type: ignore[arg-type]
    return str(error.value)


def test_a_job_says_which_frames_and_pictures_are_kept(tmp_path: Path) -> None:
    plain = order(tmp_path).job(FIRST, 1_000_000)
    assert (len(plain.cameras), plain.keyframes, plain.environment_state) == (3, False, False)
    chosen = order(tmp_path, cameras="none", frames="keyframes", environment_state=True)
    job = chosen.job(FIRST, 1_000_000)
    assert (job.cameras, job.keyframes, job.environment_state) == ((), True, True)


def test_keyframes_take_less_room() -> None:
    few, many = (
        expected_bytes(Collection(episodes=10, frames=frames), [FIRST], "h264")
        for frames in ("keyframes", "stride")
    )
    assert few < many / 2


def test_the_command_of_a_data_set_is_what_would_be_typed() -> None:
    settings = Collection(tasks="GAC", episodes=3, cameras="none", environment_state=True)
    assert command_of(settings, "lerobot-v3") == (
        "robospa collect --tasks GAC --episodes 3 --cameras none --environment-state "
        "--format lerobot-v3 --out DIR"
    )
