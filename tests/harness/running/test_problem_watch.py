"""A policy that speaks another language than the robot is told so early."""

from __future__ import annotations

from fake_runs import record

from robospa.harness.running.attempts import ProblemWatch


def watched(actions: int, end: str = "step_limit") -> list[list[str]]:
    """What is said after each of seven trials of 130 actions, so many of them out of reach."""
    watch = ProblemWatch()
    found = {"unreachable_actions": actions, "first_unreachable": "action 1: left pose"}
    more = {"end": end, "steps": 130, "diagnostics": found}
    return [watch.add(record("Pick_Blocks_Size", 1, seed, 0, **more)) for seed in range(7)]


def test_many_unreachable_actions_are_said_once_after_five_trials() -> None:
    said = watched(128)
    assert [len(lines) for lines in said] == [0, 0, 0, 0, 1, 0, 0]
    assert said[4][0].startswith(
        "warning: in the first 5 trials 640 of 650 actions (98 %) ask for a pose out of reach"
    )
    assert "are poses in the world frame" in said[4][0] and "action 1: left pose" in said[4][0]


def test_few_and_lost_trials_say_nothing() -> None:
    assert not any(watched(3)) and not any(watched(130, "infrastructure"))
