"""The real simulator: a film made afterwards shows, to the pixel, what the trial looked like."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robospa.baselines.random import Random
from robospa.harness.pictures.video import FilmRecorder, film
from robospa.harness.running.record_store import ActionRecorder, write_actions
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.trial import run_trial
from robospa.trial import TrialKey

pytest.importorskip("av")
pytestmark = pytest.mark.sim

KEY = TrialKey("Pick_Blocks_Size", 1, 100000)


class Both(ActionRecorder):
    """Films the trial itself while its actions are kept."""

    def __init__(self) -> None:
        super().__init__()
        self.film = FilmRecorder()

    def started(self, world: Any) -> None:
        self.film.started(world)

    def polled(self, world: Any, time: float) -> None:
        self.film.polled(world, time)

    def ended(self, world: Any) -> None:
        self.film.ended(world)


def test_the_pictures_are_those_of_the_trial(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen: list[Any] = []
    monkeypatch.setattr(FilmRecorder, "add", lambda self, image: seen.append(image.copy()))
    world, both = SapienWorld(render=True), Both()
    record = run_trial(world, Random(), KEY, policy_seed=3, recorder=both, step_scale=0.02)
    write_actions(tmp_path, KEY, both.actions, "joint")
    during, seen[:] = list(seen), []
    film(world, record, tmp_path, step_scale=0.02)
    world.close()
    assert len(during) == len(seen) > 6
    assert np.ptp([image.mean() for image in during]) > 0.1  # something moves
    assert all(np.array_equal(a, b) for a, b in zip(during, seen, strict=True))
