"""Scenes of a made-up archive in the simulator: solved by the expert, drawn with their pictures."""

from collections.abc import Iterator
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from made_archive import READS_MESHES, make_archive, official_pack_in
from made_robots import make_robot

from robospa.baselines.oracle import Oracle
from robospa.geometry import Pose
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.trial import TrialSetup, run_trial, task_parts
from robospa.observation import CameraSpec
from robospa.protocol.policy import TrialInfo
from robospa.tasks.packs import with_pack
from robospa.tasks.scene import Scene, SceneObject
from robospa.trial import TrialKey
from robospa.workcell import TABLE_TOP

pytestmark = [pytest.mark.sim, READS_MESHES]

ASSETS = ("can", "bread", "bread_basket", "mug")
HEAD = CameraSpec("head", 160, 120)


@pytest.fixture(scope="module", autouse=True)
def pack(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    folder = tmp_path_factory.mktemp("official")
    root = make_archive(folder / "assets", ASSETS)
    with pytest.MonkeyPatch.context() as patch, official_pack_in(root, folder / "cache", patch):
        yield


class OfficialOracle(Oracle):
    """Plans in the scene that the world has."""

    def reset(self, trial: TrialInfo) -> None:
        super().reset(trial)
        assert self._scene is not None
        self._scene = with_pack(self._scene, "official")


def parts_of(key: TrialKey) -> TrialSetup:
    parts = task_parts(key)
    scene = with_pack(parts.scene, "official")
    return TrialSetup(scene, parts.task, parts.task.goal(scene), parts.instruction)


def test_the_expert_solves_a_scene_of_the_archive() -> None:
    key = TrialKey("Click_Can_Place_Items", 2, 100_000, "aloha-agilex", "clean")
    world = SapienWorld(render=False)
    record = run_trial(world, OfficialOracle(), key, policy_seed=0, parts=parts_of)
    again = run_trial(world, OfficialOracle(), key, policy_seed=0, parts=parts_of)
    assert record.success and again.digest == record.digest
    plain = run_trial(world, Oracle(), key, policy_seed=0, parts=partial(task_parts))
    assert plain.success and plain.digest != record.digest


def test_objects_are_drawn_with_their_pictures() -> None:
    """A red, tinted mug in the middle of the table, drawn as large as its built-in likeness."""
    item = SceneObject(
        "mug", "mug", Pose((0.0, 0.0, TABLE_TOP)), {"look": 1, "tint": "red"}, fixed=True
    )
    scene = Scene("Test", 1, 100_000, "aloha-agilex", "clean", (item,), {})
    world, red = SapienWorld(render=True), []
    for shown in (scene, with_pack(scene, "official")):
        world.load(shown)
        image = world.render(HEAD).astype(int)
        red.append((image[..., 0] > 2 * image[..., 1]).sum())
    world.close()
    assert red[0] > 60 and 0.8 < red[1] / red[0] < 1.25


def test_robots_are_drawn_with_the_vendors_meshes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Stand-ins of a robot's links look as our own shapes: they are where those are."""
    monkeypatch.setenv("ROBOSPA_ASSETS", str(make_robot(tmp_path, "piper")))
    scene = Scene("Test", 1, 100_000, "piper", "clean", (), {})
    third = CameraSpec("third", 160, 120)
    pictures = []
    for name in ("builtin", "official"):
        world = SapienWorld(render=True, robot_assets=name)
        world.load(scene)
        pictures.append(world.render(third).astype(int))
        world.close()
    off = np.abs(pictures[0] - pictures[1]).max(axis=2) > 40
    assert 0 < off.mean() < 0.02  # a plate that only the vendor has, and edges
