"""Trials of the official world with the objects of a made-up archive, which our expert solves."""

from __future__ import annotations

from pathlib import Path

import pytest

pytestmark = pytest.mark.sim
pytest.importorskip("trimesh", reason="meshes need trimesh: pip install 'robospa[assets]'")

from made_archive import make_archive  # noqa: E402  (needs trimesh)

from robospa.baselines.oracle import create  # noqa: E402
from robospa.harness.official.layout import official_world_parts, parse_official  # noqa: E402
from robospa.harness.official.official_world import OfficialWorld  # noqa: E402
from robospa.harness.trial import run_trial  # noqa: E402
from robospa.tasks import packs  # noqa: E402
from robospa.tasks.objects import object_model  # noqa: E402
from robospa.trial import TrialKey  # noqa: E402


def test_a_trial_with_the_archives_objects_is_solved_in_its_own_suite(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_archive(tmp_path / "archive", ["seal"])
    monkeypatch.setenv("ROBOSPA_ASSETS", str(tmp_path / "archive"))
    monkeypatch.setenv("ROBOSPA_CACHE", str(tmp_path / "cache"))
    packs.pack.cache_clear()
    try:
        options, layout = parse_official("official?assets=official&settle=official")
        key = TrialKey("Pick_Seals_Multi_View", 2, 100000)
        parts = official_world_parts(key, layout, {})
        assert parts.scene.suite == "official-1" and layout.digest
        item = parts.scene.objects[0]
        assert item.params["pack"] == "official"
        assert object_model(item.asset, item.params).shapes != object_model(item.asset).shapes
        world = OfficialWorld(render=False, settle=options.settle)
        record = run_trial(world, create(), key, policy_seed=0, parts=lambda _: parts)
        assert record.success, record.message
    finally:
        packs.pack.cache_clear()
