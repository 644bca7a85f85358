"""Sweeps try exactly the seeds that they need, and lose none that has finished."""

from collections.abc import Callable
from concurrent.futures import Future
from pathlib import Path

import pytest

import robospa
from robospa.harness.running.code_hash import files_of
from robospa.harness.seeds import lists
from robospa.harness.seeds.attempt import PATIENCE, Attempt, Evidence, Search, sweep
from robospa.harness.selection import list_trials, parse_embodiments, parse_modes, seed_sources
from robospa.harness.settings import Selection, SettingsError
from robospa.tasks.seeds import ListKey, NoSeedList, accepted, list_hash

ONE, OTHER = ListKey("One", 1), ListKey("Other", 2, "piper", "dark")


WORKERS = 2


class Tried:
    """Tries seeds at once, in this process."""

    def __init__(self, solved: Callable[[ListKey, int], bool]) -> None:
        self.solved = solved
        self.all: list[tuple[ListKey, int]] = []

    def __call__(self, key: ListKey, seed: int) -> Future[Attempt]:
        future: Future[Attempt] = Future()
        self.all.append((key, seed))
        future.set_result(Attempt(seed, self.solved(key, seed), "out of reach"))
        return future


def test_the_first_accepted_seeds_are_found_and_no_other_is_tried() -> None:
    tried = Tried(lambda key, seed: seed % 5 != 2)
    first, second = sweep(tried, WORKERS, [Search(ONE, 0, 10), Search(OTHER, 100, 3)])
    assert first.accepted == [0, 1, 3, 4, 5, 6, 8, 9, 10, 11]
    assert [item.seed for item in first.refused] == [2, 7]
    assert (second.key, second.accepted) == (OTHER, [100, 101, 103])
    assert sorted(tried.all) == [(ONE, n) for n in range(12)] + [
        (OTHER, n) for n in range(100, 104)
    ]


def test_known_attempts_are_not_made_again() -> None:
    known = {n: Attempt(n, n != 1) for n in (0, 1, 2, 5, 9)}
    tried = Tried(lambda key, seed: True)
    (search,) = sweep(tried, WORKERS, [Search(ONE, 0, 5, attempts=known)])
    assert search.accepted == [0, 2, 3, 4, 5]
    assert sorted(tried.all) == [(ONE, 3), (ONE, 4)]
    (again,) = sweep(tried, WORKERS, [Search(ONE, 0, 5, attempts=search.attempts)])
    assert again.accepted == search.accepted and len(tried.all) == 2


def test_a_variant_that_the_expert_does_not_solve_is_given_up() -> None:
    tried = Tried(lambda key, seed: key == OTHER)
    first, second = sweep(tried, WORKERS, [Search(ONE, 0, 100), Search(OTHER, 0, 2)])
    assert first.given_up and len(first.refused) == PATIENCE + 1
    assert len([1 for key, _ in tried.all if key == ONE]) <= PATIENCE + 1 + 2 * WORKERS
    assert second.accepted == [0, 1] and not second.given_up


def test_measuring_tries_so_many_seeds_whatever_comes_of_them() -> None:
    tried = Tried(lambda key, seed: seed < 10)
    (search,) = sweep(tried, WORKERS, [Search(ONE, 0, 60, measures=True)])
    assert (len(search.row()), len(search.accepted), search.given_up) == (60, 10, False)
    assert len(tried.all) == 60


@pytest.mark.sim
def test_an_error_is_a_reason_like_another() -> None:
    from robospa.harness.factory import policy_factory
    from robospa.harness.seeds.attempt import ORACLE, attempt
    from robospa.harness.sim.sapien_world import SapienWorld

    world, expert = SapienWorld(render=False), policy_factory(ORACLE)()
    assert attempt(world, expert, ListKey("Pick_Blocks_Size", 1), 100_000).accepted
    found = attempt(world, expert, ListKey("Pick_Blocks_Size", 1, "no-robot"), 100_000)
    assert not found.accepted and "no-robot" in found.reason


# ----------------------------------------------- what is kept of a sweep, and what it is kept under


KEY = ListKey("Pick_Blocks_Size", 1)
SOLVED, LOST = Attempt(7, True, "", 0.25), Attempt(8, False, "no arm, 3.5 cm off")


def test_finished_attempts_survive_a_torn_line_and_other_inputs_do_not_count(
    tmp_path: Path,
) -> None:
    kept = Evidence(tmp_path)
    kept.add(KEY, "a", SOLVED)
    with kept.path(KEY).open("ab") as file:
        file.write(b'{"level": 1, "inputs": "a", "se')
    kept.add(KEY, "a", LOST)
    kept.add(KEY, "b", Attempt(9, True))
    kept.add(KEY._replace(level=2), "a", Attempt(10, True))
    assert kept.attempts(KEY, "a") == {7: SOLVED, 8: LOST}
    assert kept.attempts(KEY, "b").keys() == {9}
    assert kept.attempts(ListKey("Other", 1), "a") == {}


def test_inputs_are_of_what_a_task_executes(monkeypatch: pytest.MonkeyPatch) -> None:
    root = Path(robospa.__path__[0])
    counted: list[str] = []

    def hashed(folders: tuple[str, ...], left_out: tuple[str, ...] = ()) -> str:
        counted.extend(files_of(root, folders, left_out))
        return ""

    monkeypatch.setattr(lists, "code_hash", hashed)
    lists._hash.cache_clear()
    first = lists.inputs(KEY)
    lists._hash.cache_clear()
    for path in ("harness/skills/pick.py", "tasks/objects/boxes.py", "harness/robots/piper.py",
                 "tasks/families/block_measures.py", "baselines/oracle.py"):  # fmt: skip
        assert path in counted
    for path in ("tasks/families/repeat.py", "tasks/instructions/__init__.py",
                 "harness/running/runner.py", "protocol/server.py"):  # fmt: skip
        assert (root / path).exists() and path not in counted
    assert lists.inputs(KEY._replace(level=5)) == first
    other = KEY._replace(mode="own:light")
    monkeypatch.setattr(lists, "module_of", lambda group, name: "numpy" * (name == "own"))
    assert lists.inputs(other) != first
    lists._hash.cache_clear()


def test_a_list_made_here_is_found_by_evaluations_until_its_inputs_change(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROBOSPA_CACHE", str(tmp_path))
    key = KEY._replace(mode="randomized:clutter=3")
    with pytest.raises(NoSeedList, match="--mode randomized:clutter=3"):
        lists.find_list(key)
    lists.save(lists.local_file(key), 1, [5, 6, 7])
    lists.save(lists.local_file(key), 2, [8])
    assert lists.find_list(key).origin == lists.LOCAL and lists.find_list(key).seeds == (5, 6, 7)
    assert lists.find_list(KEY).origin == lists.SHIPPED
    chosen = Selection("Pick_Blocks_Size", "1", 2, mode="randomized:clutter=3")
    trials = list_trials(chosen)
    assert [trial.seed for trial in trials] == [5, 6]
    (row,) = seed_sources(chosen, trials)
    assert (row["origin"], row["hash"]) == (lists.LOCAL, list_hash({key: (5, 6, 7)}))
    monkeypatch.setattr("robospa.harness.seeds.lists.inputs", lambda key: "other")
    with pytest.raises(
        SettingsError, match="make them with `robospa seeds Pick_Blocks_Size --levels"
    ):
        list_trials(chosen)


def test_a_run_knows_whose_seeds_it_takes() -> None:
    shipped = Selection("Pick_Blocks_Size", "1,2", 3)
    (row,) = seed_sources(shipped, list_trials(shipped))
    assert row == {
        "embodiment": "aloha-agilex",
        "mode": "clean",
        "origin": lists.SHIPPED,
        "hash": list_hash({KEY: accepted(*KEY), KEY._replace(level=2): accepted(KEY.task, 2)}),
    }
    given = Selection("Pick_Blocks_Size", "1", 2, "7-8", mode="randomized")
    (row,) = seed_sources(given, list_trials(given))
    assert (row["mode"], row["origin"]) == ("randomized", "given")
    assert row["hash"] == list_hash({KEY._replace(mode="randomized"): [7, 8]})


def test_one_command_makes_all_lists_that_are_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROBOSPA_CACHE", str(tmp_path))
    chosen = Selection("GAC,Press_Stapler_Repeat", "1,3", embodiment="aloha-agilex,piper:0.75")
    names = "Pick_Blocks_Size,Pick_Blocks_Height,Pick_Blocks_Length,Pick_Blocks_Area"
    command = rf"`robospa seeds {names},Press_Stapler_Repeat --levels 1,3 --embodiment piper:0\.75`"
    with pytest.raises(SettingsError, match=f"of 5 tasks with piper.* {command}"):
        list_trials(chosen)


def test_an_empty_list_takes_the_old_one_out(tmp_path: Path) -> None:
    path = tmp_path / "robot" / "T.json"
    for level, seeds in ((2, [1]), (1, [3, 4]), (2, [])):
        lists.save(path, level, seeds)
    assert lists.read_levels(path) == {1: (3, 4)}
    path.write_text("{")
    assert lists.read_levels(path) == {}


def test_modes_with_equal_bodies_share_their_lists() -> None:
    assert lists.find_list(KEY._replace(mode="randomized:light,texture")).origin == lists.SHIPPED
    names = "clean, randomized:light,clutter,randomized:height,randomized-seen"
    assert parse_modes(names) == [
        "clean", "randomized:light,clutter", "randomized:height", "randomized-seen"
    ]  # fmt: skip
    with pytest.raises(SettingsError, match="no scene mode 'clutter'"):
        parse_modes("clean,clutter")


def test_trials_of_several_robots_modes_and_splits() -> None:
    chosen = Selection(
        "Pick_Blocks_Size", "1", 2, split="heldout,train", embodiment="aloha-agilex,piper",
        mode="clean,randomized:light", seeds="5-6",
    )  # fmt: skip
    keys = list_trials(chosen)
    assert len(keys) == len(set(keys)) == 16
    assert {key.variant for key in keys} == {("Pick_Blocks_Size", 1)}
    assert {row["origin"] for row in seed_sources(chosen, keys)} == {"given"}
    with pytest.raises(SettingsError, match="split 'test' is not one of heldout, train"):
        Selection(split="heldout,test")


def test_robots_are_named_by_list_or_all() -> None:
    assert parse_embodiments("aloha-agilex, aloha-agilex") == ["aloha-agilex"]
    assert "aloha-agilex" in parse_embodiments("all")
    with pytest.raises(SettingsError, match="names no robot; known are"):
        parse_embodiments(" ,")
    with pytest.raises(SettingsError, match=r"did you mean aloha-agilex\?"):
        parse_embodiments("aloha-agilex,aloha_agilex")
