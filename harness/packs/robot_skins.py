"""Vendors' meshes for a robot's links, from the archive's URDF files. They are only drawn.

A link of ours stands for all links of the URDF file that move with it, from one of our joints to
the next. Joints are found by their names, which are the official ones; where a link's frame differs
from the URDF's, its meshes are moved by the difference, so that with all joints at 0 everything is
where the URDF has it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import to_transform
from robospa.harness.packs.archive import Archive, ArchiveError
from robospa.harness.packs.assembly import skin_of
from robospa.harness.packs.urdf import MeshUse, Robot, check_files, read_urdf
from robospa.harness.robots.embodiment import Arm, Embodiment, Joint
from robospa.tasks.shapes import Skin

Floats = NDArray[np.float64]

MOST_FILES = 200
"""URDF files in a robot's folder that are looked at."""


@dataclass(frozen=True)
class RobotSkins:
    """What is drawn of the links of the left and of the right arm instead of our shapes, by link.

    If `stand`, what stands still beside the arms is among it, with the left arm's base.
    """

    arms: tuple[Mapping[str, Skin], Mapping[str, Skin]]
    stand: bool = False


def robot_skins(archive: Archive, robot: Embodiment, full: bool = False) -> RobotSkins:
    """The meshes of `robot`, every triangle of them if `full`.

    ArchiveError, in one sentence, if they are not there or cannot be read.
    """
    left, right = robot.arms
    urdf = _robot_urdf(archive, robot)
    own = {joint.name for joint in right.joints} - {joint.name for joint in left.joints}
    both = bool(own) and own <= {*_names(urdf)}
    arms = robot.arms if both else robot.arms[:1]
    moving = frozenset(link for arm in arms for link in _carriers(urdf, arm))
    skins = (
        _arm_skins(archive, urdf, left, moving, full, still=True),
        _arm_skins(archive, urdf, right, moving, full, still=not both),
    )
    return RobotSkins(skins, stand=both)


def check_robot(archive: Archive, robot: Embodiment) -> None:
    """ArchiveError, in one sentence, if the meshes of `robot` are not all there; none is read."""
    check_files(use.file for uses in _robot_urdf(archive, robot).visuals.values() for use in uses)


def _robot_urdf(archive: Archive, robot: Embodiment) -> Robot:
    folder = archive.embodiment(robot.name)
    if folder is None:
        raise ArchiveError(
            f"there are no meshes of {robot.name} in {str(archive.root / 'embodiments')!r}; unpack "
            "embodiments.zip of the official data there"
        )
    return _urdf_of(archive, folder, robot.arms[0])


def _carriers(urdf: Robot, arm: Arm) -> dict[str, str]:
    """Our link for each link of the URDF file that carries others: the base, and all that our
    joints move."""
    children = _names(urdf)
    found = {children[j.name]: j.child for j in _joints(arm) if j.name in children}
    return {urdf.joints[children[arm.joints[0].name]].parent: arm.base_link, **found}


def _joints(arm: Arm) -> tuple[Joint, ...]:
    return (*arm.joints, *arm.fingers)


def _names(urdf: Robot) -> dict[str, str]:
    """The child link of each joint by the joint's name."""
    return {joint.name: child for child, joint in urdf.joints.items()}


def _urdf_of(archive: Archive, folder: Path, arm: Arm) -> Robot:
    """The URDF file below `folder` that has the arm's joints; of several the first by name."""
    files = sorted(folder.rglob("*.urdf"))[:MOST_FILES]
    for file in files:
        urdf = read_urdf(file, archive.inside)
        if all(joint.name in _names(urdf) for joint in arm.joints):
            return urdf
    missing = ", ".join(joint.name for joint in arm.joints)
    raise ArchiveError(f"no URDF file in {str(folder)!r} has the joints {missing}")


def _arm_skins(
    archive: Archive, urdf: Robot, arm: Arm, moving: frozenset[str], full: bool, still: bool
) -> dict[str, Skin]:
    """Skins of the arm's links; if `still`, the base's has all besides that hangs on none of the
    links that are `moving`."""
    ours = _carriers(urdf, arm)
    root = urdf.in_root(next(iter(ours)))
    frames = _frames_at_zero(arm)
    groups: dict[str, list[MeshUse]] = {}
    for link, uses in urdf.visuals.items():
        carrier = _carrier(urdf, link, moving)
        if carrier in ours:
            target = ours[carrier]
        elif carrier == "" and still:
            target = arm.base_link
        else:
            continue
        to_ours = np.linalg.inv(root @ frames[target]) @ urdf.in_root(link)
        groups.setdefault(target, []).extend(
            MeshUse(use.file, to_ours @ use.transform) for use in uses
        )
    return {link: Skin(str(skin_of(archive, uses, full))) for link, uses in groups.items() if uses}


def _carrier(urdf: Robot, link: str, moving: frozenset[str]) -> str:
    """The nearest of the links in `moving` that `link` is or hangs on; "" if there is none. Other
    joints (wheels, a second pair of arms) stay at 0."""
    while link not in moving:
        if link not in urdf.joints:
            return ""
        link = urdf.joints[link].parent
    return link


def _frames_at_zero(arm: Arm) -> dict[str, Floats]:
    """(4, 4) frame of each of our links in the base link's, all joints at 0."""
    found: dict[str, Floats] = {arm.base_link: np.eye(4)}
    for joint in _joints(arm):
        found[joint.child] = found[joint.parent] @ to_transform(joint.origin)
    return found
