"""Demonstrations are of scenes that no evaluation has and that measure nothing."""

from __future__ import annotations

import json
import re
from pathlib import Path

from robospa.harness.datasets.settings import Collection, lists_of, trial_of
from robospa.leaderboard.reproduce import FIRST as FIRST_HIDDEN
from robospa.tasks.seeds import FIRST_TRAINING_SEED, LAST_TRAINING_SEED

ROOT = Path(__file__).resolve().parents[3]
TRAINING = range(FIRST_TRAINING_SEED, LAST_TRAINING_SEED + 1)


def test_no_list_of_an_evaluation_has_a_training_seed() -> None:
    files = sorted((ROOT / "tasks/seeds").rglob("*.json"))
    lists = [seeds for path in files for seeds in json.loads(path.read_text()).values()]
    assert len(lists) >= 355
    assert all(TRAINING.stop <= min(seeds) or max(seeds) < TRAINING.start for seeds in lists)


def test_hidden_seeds_lie_beyond() -> None:
    assert TRAINING.stop <= FIRST_HIDDEN


def test_nothing_is_measured_on_training_seeds() -> None:
    for path in (*ROOT.glob("benchmarks/*.py"), *ROOT.glob("tools/*.py")):
        text = path.read_text()
        starts = re.findall(r"(?:FIRST\w*|--first\"?|--start\"?).{0,40}?(\d[\d_]{4,})", text)
        assert not [number for number in starts if int(number) in TRAINING], path.name


def test_an_episode_is_a_training_trial_with_textures_of_training() -> None:
    (key,) = lists_of(Collection("Pick_Blocks_Size", "2", embodiment="piper", mode="randomized"))
    trial = trial_of(key, FIRST_TRAINING_SEED)
    assert (trial.seed, trial.split, trial.mode) == (1_000_000, "train", "randomized-seen")
    assert (trial.task, trial.level, trial.embodiment) == ("Pick_Blocks_Size", 2, "piper")
