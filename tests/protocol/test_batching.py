"""When the batcher waits: arithmetic on a clock that stands still."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest

from robospa.protocol.batching import Batcher, _Pace, _Request


async def nothing(observations: Any, sessions: Any) -> Any:
    return []


@pytest.fixture
def batcher() -> Batcher:
    """A model for 4 observations that takes 1 s and became free at t = 10 s."""
    found = Batcher(nothing, size=4, queue=8)
    found._duration, found._free = 1.0, 10.0
    return found


def waiting(batcher: Batcher, *sessions: int) -> None:
    loop = asyncio.new_event_loop()
    for session in sessions:
        batcher._pending.append(_Request(session, {}, 10.0, loop.create_future()))
    loop.close()


def test_a_lone_client_never_waits(batcher: Batcher) -> None:
    waiting(batcher, 1)
    assert batcher.wait_for(10.0) == 0


def test_a_session_that_is_due_soon_is_waited_for(batcher: Batcher) -> None:
    waiting(batcher, 1)
    batcher._paces[2] = _Pace(answered=10.0, pause=0.1)
    assert batcher.wait_for(10.0) == pytest.approx(0.152)


def test_a_session_that_is_late_is_not_waited_for(batcher: Batcher) -> None:
    waiting(batcher, 1)
    batcher._paces[2] = _Pace(answered=9.0, pause=0.1)
    assert batcher.wait_for(10.0) == 0


def test_a_session_in_a_long_simulation_is_not_waited_for(batcher: Batcher) -> None:
    waiting(batcher, 1)
    batcher._paces[2] = _Pace(answered=10.0, pause=5.0)
    assert batcher.wait_for(10.0) == 0


def test_a_wait_that_costs_more_than_it_brings_is_not_made(batcher: Batcher) -> None:
    waiting(batcher, 1, 2, 3)
    batcher._paces[4] = _Pace(answered=10.0, pause=0.4)
    assert 4 / (1 + 0.602) < 3 / 1
    assert batcher.wait_for(10.0) == 0


def test_a_full_batch_goes_at_once(batcher: Batcher) -> None:
    waiting(batcher, 1, 2, 3, 4)
    batcher._paces[5] = _Pace(answered=10.0, pause=0.01)
    assert batcher.wait_for(10.0) == 0


def test_a_resting_session_is_forgotten(batcher: Batcher) -> None:
    waiting(batcher, 1)
    batcher._paces[2] = _Pace(answered=10.0, pause=0.1)
    batcher.forget(2)
    assert batcher.wait_for(10.0) == 0


def test_without_a_measured_duration_nobody_waits() -> None:
    batcher = Batcher(nothing, size=4, queue=8)
    waiting(batcher, 1)
    batcher._paces[2] = _Pace(answered=10.0, pause=0.1)
    assert batcher.wait_for(10.0) == 0


def test_a_wrong_number_of_answers_is_an_error() -> None:
    async def main() -> None:
        with pytest.raises(ValueError, match="gave 0 answers to 1 request"):
            await Batcher(nothing, size=4, queue=8).infer(1, {})

    asyncio.run(main())
