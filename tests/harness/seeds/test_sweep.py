"""Sweeps try exactly the seeds that they need, and lose none that has finished."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future

import pytest

from robospa.harness.seeds.attempt import Attempt
from robospa.harness.seeds.sweep import PATIENCE, Search, sweep
from robospa.tasks.seeds import ListKey

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


def test_once_stopped_no_trial_begins_and_what_is_done_is_handed_on() -> None:
    tried = Tried(lambda key, seed: True)
    seen: list[int] = []
    wanted = [Search(ONE, 0, 4), Search(OTHER, 0, 20)]
    done = list(
        sweep(
            tried, WORKERS, wanted, lambda s, item: seen.append(item.seed), lambda: len(seen) >= 6
        )
    )
    assert [search.key for search in done] == [ONE]
    assert len(wanted[0].attempts) + len(wanted[1].attempts) == len(seen) == 8


@pytest.mark.sim
def test_an_error_is_a_reason_like_another() -> None:
    from robospa.harness.factory import policy_factory
    from robospa.harness.seeds.attempt import ORACLE, attempt
    from robospa.harness.sim.sapien_world import SapienWorld

    world, expert = SapienWorld(render=False), policy_factory(ORACLE)()
    assert attempt(world, expert, ListKey("Pick_Blocks_Size", 1), 100_000).accepted
    found = attempt(world, expert, ListKey("Pick_Blocks_Size", 1, "no-robot"), 100_000)
    assert not found.accepted and "no-robot" in found.reason
