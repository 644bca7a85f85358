"""URDF files: links and joints, and what is refused."""

import math
from pathlib import Path

import numpy as np
import pytest

from robospa.harness.packs.archive import Archive, ArchiveError
from robospa.harness.packs.urdf import LARGEST_FILE, Urdf, read_urdf

TWO_LINKS = """<robot name="r">
<link name="base"/>
<link name="door"><visual><origin xyz="1 0 0"/><geometry>
  <mesh filename="{mesh}" scale="2 2 2"/></geometry></visual></link>
<joint name="j" type="revolute"><parent link="base"/><child link="door"/>
  <origin xyz="0 0 5" rpy="0 0 1.5707963267948966"/><axis xyz="0 0 1"/>
  <limit lower="0" upper="1.5"/></joint>
</robot>"""


def read(folder: Path, text: str | bytes) -> Urdf:
    path = folder / "objects" / "x" / "mobility.urdf"
    path.parent.mkdir(parents=True)
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_urdf(path, Archive(folder).inside)


def test_meshes_stand_where_their_links_are(tmp_path: Path) -> None:
    robot = read(tmp_path, TWO_LINKS.format(mesh="door.obj"))
    (use,) = robot.visuals["door"]
    assert use.file == (tmp_path / "objects" / "x" / "door.obj").resolve()
    placed = robot.in_root("door") @ use.transform @ np.array([0.5, 0, 0, 1])
    assert placed[:3] == pytest.approx((0, 2, 5))  # 1 + 2 * 0.5 along x, which points along y
    assert robot.joints["door"].limits == (0.0, 1.5)
    assert robot.moved_by("door") == {"door"}


def test_angles_turn_about_fixed_axes_in_order(tmp_path: Path) -> None:
    a = math.pi / 2
    robot = read(tmp_path, TWO_LINKS.replace("0 0 1.5707963267948966", f"{a} 0 {a}"))
    assert robot.in_root("door")[:3, :3] @ (0, 1, 0) == pytest.approx((0, 0, 1))
    assert robot.in_root("door")[:3, :3] @ (1, 0, 0) == pytest.approx((0, 1, 0))


ENTITY = '<!DOCTYPE r [<!ENTITY e SYSTEM "file:///etc/passwd">]><robot name="&e;"/>'
LAUGHS = '<!DOCTYPE r [<!ENTITY a "ha"><!ENTITY b "&a;&a;&a;">]><robot name="&b;"/>'
MANY = "<robot>" + '<link name="a"><visual/><visual/></link>' * 2100 + "</robot>"
RING = """<robot name="r"><link name="a"/><link name="b"/>
<joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>
<joint name="k" type="fixed"><parent link="b"/><child link="a"/></joint></robot>"""


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (ENTITY, "defines XML entities"),
        (LAUGHS, "defines XML entities"),
        (ENTITY.encode("utf-16"), "defines XML entities"),
        (TWO_LINKS.format(mesh="package://pots/door.obj"), "which is no path"),
        (TWO_LINKS.format(mesh="file:///etc/passwd"), "which is no path"),
        (TWO_LINKS.format(mesh="../../../../etc/passwd"), "leads out of the assets' folder"),
        (TWO_LINKS.format(mesh="/etc/passwd"), "leads out of the assets' folder"),
        (TWO_LINKS.replace("0 0 5", "0 0 inf"), "no valid URDF file"),
        (TWO_LINKS.replace('upper="1.5"', 'upper="wide"'), "no valid URDF file"),
        ("<robot><link/></robot>", "no valid URDF file"),
        ("<robot", "no valid URDF file"),
        (RING, "joints that form a ring"),
        (RING.replace('<parent link="a"/>', '<parent link="b"/>'), "joints that form a ring"),
        (" " * (LARGEST_FILE + 1), "larger than 16 MB"),
        (MANY, "4200 parts"),
    ],
)
def test_hostile_files_are_refused_in_a_sentence(
    tmp_path: Path, text: str | bytes, message: str
) -> None:
    with pytest.raises(ArchiveError, match=message) as refused:
        read(tmp_path, text)
    assert "mobility.urdf" in str(refused.value) or "leads out" in str(refused.value)
