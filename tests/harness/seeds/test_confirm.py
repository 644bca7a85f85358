"""A list made with other code stands only where its trials, run again, end as they did."""

from __future__ import annotations

from concurrent.futures import Future
from pathlib import Path

from robospa.harness.seeds.attempt import Attempt, Evidence
from robospa.harness.seeds.sweep import confirm
from robospa.tasks.seeds import ListKey

SAME, CHANGED, UNKNOWN = ListKey("Same", 1), ListKey("Changed", 1), ListKey("Unknown", 1)


def submit(key: ListKey, seed: int) -> Future[Attempt]:
    """Ends every trial after as many physics steps as its seed has, one more for CHANGED."""
    future: Future[Attempt] = Future()
    future.set_result(_ended(seed, seed + (key == CHANGED)))
    return future


def _ended(seed: int, steps: int) -> Attempt:
    return Attempt(seed, seed % 2 == 0, digest="d", physics_steps=steps)


def test_what_ends_as_before_holds(tmp_path: Path) -> None:
    kept = Evidence(tmp_path)
    for key in (SAME, CHANGED):
        for seed in range(6):
            kept.add(key, "old", _ended(seed, seed))
    made = {SAME: "old", CHANGED: "old", UNKNOWN: "old"}
    same, changed, unknown = confirm(submit, made, kept, 2)
    assert same.holds and same.tried == 3  # seeds 0 and 2, and 1, which was refused
    assert not changed.holds and changed.differs == (0, 2, 1)
    assert not unknown.holds and unknown.tried == 0


def test_attempts_that_are_adopted_count_under_both_inputs(tmp_path: Path) -> None:
    kept = Evidence(tmp_path)
    kept.add(SAME, "old", _ended(4, 4))
    kept.adopt(SAME, "old", "new")
    assert kept.attempts(SAME, "new") == kept.attempts(SAME, "old") == {4: _ended(4, 4)}
