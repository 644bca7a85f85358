"""Staplers with counts to remember."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

from robospa.tasks.catalog import build_scene
from robospa.tasks.scene import Scene

SEEDS = range(500_000, 500_200)


def scenes(name: str, level: int, count: int = 100) -> Iterator[Scene]:
    return (build_scene(name, level, seed) for seed in SEEDS[:count])


def at(scene: Scene, name: str) -> tuple[float, float, float]:
    return scene.object(name).pose.position


def test_stapler_counts_are_uniform_and_rows_run_left_to_right() -> None:
    counts: Counter[int] = Counter()
    for scene in scenes("Press_Stapler_Memory", 5, 200):
        x = [at(scene, n)[0] for n in scene.facts["row"]]
        assert x == sorted(x)
        counts.update(scene.facts["counts"])
    assert set(counts) == {1, 2, 3, 4, 5} and min(counts.values()) > 150
