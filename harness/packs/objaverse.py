"""Things of the archive that only lie about: `objects/objaverse`, a URDF file each.

Officially they are fixed, collide as one hull, and stand upright as their files have them. Which
there are says `list.json` beside them; without it all that are found.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping

import numpy as np

from robospa.harness.packs.archive import Archive, ArchiveError
from robospa.harness.packs.assembly import hull_of
from robospa.harness.packs.solids import solids, vector
from robospa.harness.packs.urdf import read_urdf
from robospa.tasks.modes.clutter import ClutterKind, colors_asked, taken_kinds
from robospa.tasks.official import clutter_alike
from robospa.tasks.scene import Scene
from robospa.tasks.shapes import ObjectModel, Skin

ASSET = "objaverse"
"""What such a thing is called as the asset of an object; its parameter "thing" is "category/id"."""
LIST = "list.json"
LARGEST_LIST = 4 << 20
SIZES = (0.005, 0.6)
"""Lengths [m] that a thing on a table may have along its longest side."""
_NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")


def things(archive: Archive) -> Mapping[str, tuple[str, ...]]:
    """The ids of each category that are in the archive and in its list, sorted.

    ArchiveError for a list that cannot be read.
    """
    found: dict[str, list[str]] = {}
    listed = _listed(archive)
    for name in archive.clutter():
        category, _, number = name.partition("/")
        if listed is None or number in listed.get(category, ()):
            found.setdefault(category, []).append(number)
    return {category: tuple(numbers) for category, numbers in found.items()}


def kinds(archive: Archive, pack: str, scene: Scene) -> tuple[ClutterKind, ...]:
    """The categories that may lie about in `scene`: nothing that it could mean by its words. Of
    their colours nothing is known, so there are none where it names things by colour."""
    if colors_asked(scene):
        return ()
    taken, alike = taken_kinds(scene), clutter_alike()
    return tuple(
        ClutterKind(
            ASSET, tuple({"thing": f"{category}/{n}", "pack": pack} for n in numbers), fixed=True
        )
        for category, numbers in things(archive).items()
        if category in alike and not taken & alike[category]
    )


def make_thing(archive: Archive, name: object) -> ObjectModel:
    """The thing called "category/id". ArchiveError if it is not there or cannot be used."""
    category, _, number = str(name).partition("/")
    if not (_NAME.fullmatch(category) and _NAME.fullmatch(number)):
        raise ArchiveError(f"{str(name)[:80]!r} is no thing of the archive, such as 'bottle/3'")
    path = archive.root / "objects" / ASSET / category / number / "model.urdf"
    if not path.is_file():
        raise ArchiveError(f"the thing {name!r} is missing in the assets' folder")
    what = f"the thing {name!r} of the assets' folder"
    body = hull_of(archive, read_urdf(path, archive.inside), what)
    points = np.concatenate([corners for corners, _ in body.pieces])
    low, high = points.min(axis=0), points.max(axis=0)
    if not SIZES[0] <= float(np.ptp(points, axis=0).max()) <= SIZES[1]:
        size = " x ".join(f"{length:.3g}" for length in high - low)
        raise ArchiveError(f"{what} is {size} m large, and none can be: its files are wrong")
    noun = category.replace("_", " ")
    return ObjectModel(
        asset=ASSET,
        shapes=solids(body.pieces),
        size=vector(high - low),
        radius=float(np.hypot(points[:, 0], points[:, 1]).max()),
        noun=noun,
        phrases=(noun,),
        bottom=float(low[2]),
        skin=Skin(str(body.skin)),
    )


def files_text(archive: Archive) -> str:
    """Names and sizes of all files of the things, for a hash."""
    folder = archive.root / "objects" / ASSET
    rows = []
    for category, numbers in things(archive).items():
        for number in numbers:
            files = sorted((folder / category / number).iterdir())
            sizes = " ".join(f"{f.name} {f.stat().st_size}" for f in files if f.is_file())
            rows.append(f"{category}/{number} {sizes}\n")
    return "".join(rows)


def _listed(archive: Archive) -> Mapping[str, frozenset[str]] | None:
    """The ids of each category in the list; None without one."""
    path = archive.root / "objects" / ASSET / LIST
    if not path.is_file():
        return None
    path = archive.inside(path)
    try:
        if path.stat().st_size > LARGEST_LIST:
            raise ArchiveError(f"{str(path)!r} is larger than {LARGEST_LIST >> 20} MB")
        rows = json.loads(path.read_bytes())["list_of_items"]
        return {str(name): frozenset(map(str, ids)) for name, ids in rows.items()}
    except ArchiveError:
        raise
    except (OSError, ValueError, LookupError, TypeError, AttributeError, RecursionError) as error:
        raise ArchiveError(
            f"{str(path)!r} is no JSON file whose list_of_items has the ids of each category"
        ) from error
