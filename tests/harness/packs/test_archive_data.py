"""URDF files and the JSON of points: links, joints and scales, in new and old files, and what is
refused."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from robospa.harness.packs.archive import Archive, ArchiveError
from robospa.harness.packs.placing import LARGEST_DATA, ModelData, read_model_data
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


# ------------------------------------- the JSON of a model: its scale and its points


FRAME = [[1, 0, 0, 2], [0, 1, 0, 4], [0, 0, 1, 6], [0, 0, 0, 1]]


def data_of(folder: Path, **values: object) -> ModelData:
    path = folder / "model_data0.json"
    path.write_text(json.dumps(values))
    return read_model_data(path)


def test_points_are_scaled_with_the_model(tmp_path: Path) -> None:
    data = data_of(tmp_path, scale=[0.5, 0.25, 0.5], contact_points_pose=[FRAME], mass=0.2)
    assert data.point("contact 0") == (1.0, 1.0, 3.0)
    assert data.point("contact 1") is None and data.point("functional 0") is None
    assert data.mass == 0.2


@pytest.mark.parametrize("key", ["contact_points", "contact_pose"])
def test_older_names_of_points_are_known(tmp_path: Path, key: str) -> None:
    assert data_of(tmp_path, **{key: [FRAME]}).point("contact 0") == (2.0, 4.0, 6.0)


def test_points_of_a_link_are_moved_into_the_root(tmp_path: Path) -> None:
    data = data_of(
        tmp_path, scale=[0.5] * 3, contact_points_pose=[{"base": "door", "matrix": FRAME}]
    )
    shifted = np.eye(4)
    shifted[:3, 3] = (10, 0, 0)
    assert data.in_root({"door": shifted}).point("contact 0") == (6.0, 2.0, 3.0)


@pytest.mark.parametrize(
    ("data", "keyword"),
    [
        ({"scale": [1, 2]}, "scale"),
        ({"scale": [1, 1, "x"]}, "scale"),
        ({"scale": [float("nan")] * 3}, "scale"),
        ({"scale": [10**400] * 3}, "out of range"),
        ({"scale": [0, 0, 0]}, "no model can have"),
        ({"scale": [1e9] * 3}, "no model can have"),
        ({"extents": [1, float("nan"), 1]}, "extents"),
        ({"contact_points_pose": [[1, 2]]}, "contact"),
        ({"contact_points_pose": [FRAME] * 300}, "contact"),
        ({"contact_points_pose": [[[10**400] * 4] * 4]}, "contact"),
        ({"contact_points_pose": [[[float("inf")] * 4] * 4]}, "no object can have"),
        ({"functional_matrix": {"a": 1}}, "functional"),
        ({"functional_matrix": [[[1e300] * 4] * 4]}, "no object can have"),
        ({"mass": -1}, "mass"),
        ({"mass": True}, "mass"),
        ("", "JSON"),
        ("[1, 2]", "map"),
        ("[" * 100_000, "JSON"),
        (" " * (LARGEST_DATA + 1), "larger than 4 MB"),
    ],
)
def test_what_makes_no_sense_is_refused(
    tmp_path: Path, data: str | dict[str, object], keyword: str
) -> None:
    path = tmp_path / "model_data0.json"
    path.write_text(data if isinstance(data, str) else json.dumps(data))
    with pytest.raises(ArchiveError, match=keyword) as refused:
        read_model_data(path)
    assert len(str(refused.value)) < 300 and "model_data0.json" in str(refused.value)
