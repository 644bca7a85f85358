"""What the events of a trial add up to."""

from __future__ import annotations

import pytest

from robospa.tasks.events import Event, outcome


@pytest.mark.parametrize(
    ("told", "total", "done", "best"),
    [
        (["done 0", "done 1", "undone 1", "undone 0", "done 0"], 3, 1, 2),
        (["done 0", "undone 0", "done 0"], 3, 1, 1),
        (["success"], 2, 2, 2),
        (["done 0", "failed"], 2, 1, 1),
    ],
)
def test_the_best_stays_and_a_subtask_counts_once(
    told: list[str], total: int, done: int, best: int
) -> None:
    """What is undone counts no more, and success is all."""
    events = []
    for time, text in enumerate(told):
        kind, _, index = text.partition(" ")
        events.append(
            Event(time, f"subtask_{kind}", "", int(index)) if index else Event(time, kind)
        )
    found = outcome(events, total)
    assert (found.done, found.best) == (done, best)
    assert (found.success, found.failed) == ("success" in told, "failed" in told)
