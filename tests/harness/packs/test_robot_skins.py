"""Vendors' meshes of robots: every link where the URDF has it, and nothing that is drawn twice."""

from pathlib import Path

import numpy as np
import pytest
from made_archive import MOVED, READS_MESHES, make_robot

from robospa.harness.official.layout import check_robots
from robospa.harness.packs import archive as cache
from robospa.harness.packs.archive import ArchiveError, open_archive
from robospa.harness.packs.visuals import RobotSkins, robot_skins
from robospa.harness.robots import embodiment
from robospa.harness.robots.embodiment import Arm
from robospa.harness.settings import SettingsError
from robospa.tasks.objects.build import points_of
from robospa.tasks.shapes import Skin

pytestmark = READS_MESHES


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBOSPA_CACHE", str(tmp_path / "cache"))


def corners(skin: Skin) -> np.ndarray:
    """The corners (2, 3) of the box around a skin."""
    found: np.ndarray = cache.load_arrays(Path(skin.file), "box")["box"]
    return found


def made(folder: Path, robot: str, full: bool = False, rounds: int = 0) -> RobotSkins:
    archive = open_archive(make_robot(folder, robot, rounds))
    return robot_skins(archive, embodiment(robot), full)


def drawn_box(arm: Arm, link: str) -> np.ndarray:
    points = np.concatenate([points_of(shape) for shape in arm.shapes[link] if shape.visual])
    return np.stack([points.min(axis=0), points.max(axis=0)])


@pytest.mark.parametrize("robot", ["aloha-agilex", "piper", "ur5-wsg"])
def test_every_link_is_drawn_in_its_own_frame(tmp_path: Path, robot: str) -> None:
    skins = made(tmp_path, robot)
    both = robot == "aloha-agilex"
    assert skins.stand == both
    for k in range(2):
        arm = embodiment(robot).arms[k if both else 0]  # two equal arms share a URDF file
        for link in arm.links:
            if not any(shape.visual for shape in arm.shapes[link]):
                continue
            box = corners(skins.arms[k][link])
            if link == arm.base_link and not (both and k == 1):  # with what stands still
                assert (box[0] <= drawn_box(arm, link)[0] + 2e-3).all()
                assert box[0][0] == pytest.approx(-MOVED - 0.1)
            else:
                assert box == pytest.approx(drawn_box(arm, link), abs=2e-3), link


def test_meshes_are_thinned_or_full(tmp_path: Path) -> None:
    thin, full = (
        sum(
            len(cache.load_arrays(Path(skin.file), "triangles")["triangles"])
            for skin in made(tmp_path, "piper", full, rounds=2).arms[0].values()
        )
        for full in (False, True)
    )
    assert thin <= 9 * 1500 < full


def test_a_robot_whose_arms_stand_farther_apart_has_the_same_meshes(tmp_path: Path) -> None:
    archive = open_archive(make_robot(tmp_path, "piper"))
    usual, wide = (robot_skins(archive, embodiment(name)) for name in ("piper", "piper:0.75"))
    assert usual == wide and usual.arms[0]


def test_what_is_missing_is_named(tmp_path: Path) -> None:
    archive = open_archive(make_robot(tmp_path, "piper"))
    with pytest.raises(ArchiveError, match=r"no meshes of ARX-X5 in .* unpack embodiments\.zip"):
        robot_skins(archive, embodiment("ARX-X5"))
    (tmp_path / "embodiments" / "piper" / "urdf" / "robot.urdf").unlink()
    with pytest.raises(ArchiveError, match=r"no URDF file in .* has the joints joint1, joint2"):
        robot_skins(archive, embodiment("piper"))


def test_a_run_knows_before_its_first_trial_what_of_a_robot_is_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROBOSPA_ASSETS", str(make_robot(tmp_path, "piper")))
    check_robots(["piper", "piper:0.75"])
    with pytest.raises(SettingsError, match="no meshes of aloha-agilex"):
        check_robots(["piper", "aloha-agilex"])
    (tmp_path / "embodiments" / "piper" / "urdf" / "meshes" / "root.glb").unlink()
    with pytest.raises(SettingsError, match=r"the mesh '.*root.glb' is missing"):
        check_robots(["piper"])
