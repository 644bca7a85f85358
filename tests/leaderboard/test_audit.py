"""What the audit of a run finds suspicious, and what not."""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bundle_fakes import PICK, SEEDS, all_keys, make_run
from command_line import robospa
from fake_runs import events, run_of, trial_record
from run_fakes import FakePolicy, FakeWorld, parts

from robospa.leaderboard.audit import (
    audit,
    expert_likeness,
    faults,
    hidden_gap,
    other_sentence,
    path_distance,
    rehearse,
    sentence_reaction,
)
from robospa.results.records.runs import Run, read_run, to_line
from robospa.results.records.trial_record import RetryRow
from robospa.tasks.catalog import build_scene
from robospa.tasks.sentences import sentences
from robospa.trial import TrialKey

KEYS = [TrialKey("Pick_Fake", 1, 100000 + n) for n in range(40)]


def made(good: int, repeated: int = 0) -> Run:
    """40 trials, the first `good` of them successes and the first `repeated` of them repeated."""
    lost = {"attempts": 2, "retries": (RetryRow("connection", "it hung up", 3),)}
    return run_of(
        trial_record(key, n < good, **(lost if n < repeated else {})) for n, key in enumerate(KEYS)
    )


def test_success_far_above_the_hidden_rate() -> None:
    found = hidden_gap(made(40), made(10))
    assert found.suspicious
    assert "100.0 % succeed on public seeds and 25.0 % of 40 trials on hidden" in found.sentence
    assert not hidden_gap(made(22), made(20)).suspicious
    assert not hidden_gap(made(10), made(40)).suspicious, "lower is no cheat"


def test_repeated_trials_and_policy_errors() -> None:
    assert not any(one.suspicious for one in faults(made(40)))
    everywhere, first = faults(made(40, repeated=12))
    assert everywhere.suspicious and first.suspicious
    assert "level 1: 12 of 40 trials were repeated (12 attempts" in first.sentence


def test_successes_that_follow_other_choices(tmp_path: Path) -> None:
    """As those of a policy that tries everything do, whatever its sentence says."""
    folder = make_run(tmp_path / "run", all_keys(), policy=FakePolicy())
    run = read_run(folder)
    (before,) = [one for one in audit(folder, samples=0) if one.check == "choices"]
    other = events((0.0, "wrong_object"))
    lines = [to_line(replace(r, events=(*other, *r.events))) for r in run.records.values()]
    next((folder / "trials").glob("*.jsonl")).write_text("".join(lines))
    (after,) = [one for one in audit(folder, samples=0) if one.check == "choices"]
    assert after.suspicious and "20 of 20 successes came after" in after.sentence
    assert not before.suspicious


def path(bend: float, steps: int = 50) -> Any:
    t = np.linspace(0, 1, steps)[:, None]
    return np.hstack([t, bend * np.sin(3 * t), np.tile(t, (1, 12))]).astype(np.float32)


def test_the_experts_path_is_known_at_another_speed_and_with_noise() -> None:
    shaken = path(0.5) + np.random.default_rng(0).normal(0, 1e-4, (50, 14)).astype(np.float32)
    assert path_distance(path(0.5), path(0.5)) == 0
    assert path_distance(path(0.5), path(0.5, steps=170)) < 0.001
    assert path_distance(path(0.5), shaken) < 0.01 < path_distance(path(0.5), path(1.5))
    assert path_distance(path(0.5), path(0.5)[:, :7]) == path_distance(path(0.5)[:0], path(0.5))
    for trace, suspicious in ((shaken, True), (path(1.5), False)):
        found = expert_likeness({KEYS[0]: trace}, lambda key: path(0.5))
        assert found.suspicious == suspicious
    assert not expert_likeness({}, lambda key: path(0.5)).suspicious


class Reader(FakePolicy):
    """Does what its sentence says: as many actions of one."""

    def infer(self, observation: Any) -> Any:
        return super().infer(observation) * (observation["step"] <= self.last_digit)


@pytest.mark.parametrize(
    ("policy", "suspicious"), [(Reader(length=1), False), (FakePolicy(), True)]
)
def test_who_does_the_same_whatever_the_sentence_says(policy: Any, suspicious: bool) -> None:
    """The reader does less than its scenes ask for when it is asked for less."""
    play = partial(rehearse, FakeWorld(), policy, "s")
    found = sentence_reaction(play, KEYS[4:8], parts, lambda key: "level 1: sum to 2")
    assert found.suspicious == suspicious
    assert found.sentence.startswith("4 of 4 trials succeed with their own sentence and ")
    nothing = sentence_reaction(play, KEYS, parts, lambda key: None)
    assert not nothing.suspicious


def test_the_other_sentence_never_fits_the_scene() -> None:
    key = TrialKey("Pick_Blocks_Size", 3, 100000)
    text = other_sentence(key)
    assert text is not None
    assert text not in sentences(build_scene(key.task, key.level, key.seed), key.split)


def test_findings_as_json(tmp_path: Path) -> None:
    make_run(tmp_path / "run", [TrialKey(PICK, 1, seed) for seed in SEEDS])
    done = robospa("report", tmp_path / "run", "--audit", "--samples", 0, "--json")
    found = json.loads(done.out)
    assert done.code == 0 and found and all(one["sentence"] for one in found)
    assert not any(one["suspicious"] for one in found)
    plain = robospa("report", tmp_path / "run", "--audit", "--samples", 0).out.splitlines()
    assert plain == [f"{'ok':10} {one['check']}: {one['sentence']}" for one in found]
