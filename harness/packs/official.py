"""The pack of the official archive: models made of a user's own copy of the official assets.

What tasks ask of an object beyond its shape (which way it faces, where it is pressed, what it is
called) is taken from its built-in likeness and from the archive's points. Things of
`objects/objaverse`, a URDF file each, only lie about: officially they are fixed, collide as one
hull, and stand upright as their files have them; which there are says `list.json` beside them,
without it all that are found.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

import msgspec
import numpy as np

from robospa.geometry import vec3
from robospa.harness.packs import archive as archives
from robospa.harness.packs import placing as placings
from robospa.harness.packs.archive import Archive, ArchiveError, ModelFiles, read_json
from robospa.harness.packs.convex import colliding_pieces, convex_shapes, is_filled
from robospa.harness.packs.mesh_files import Floats, Piece, check_glb
from robospa.harness.packs.placing import LARGEST_DATA, ModelData, Placing, read_model_data
from robospa.harness.packs.urdf import MeshUse, Urdf, UrdfJoint, check_files, read_urdf
from robospa.harness.packs.visuals import skin_of
from robospa.harness.robots import embodiments
from robospa.schema import read
from robospa.tasks import official
from robospa.tasks.colors import NAMED
from robospa.tasks.modes.clutter import ClutterKind, colors_asked, own_kinds, taken_kinds
from robospa.tasks.objects import object_model
from robospa.tasks.official import OfficialModel, clutter_alike, official_model
from robospa.tasks.scene import Scene
from robospa.tasks.shapes import Color, Hinge, ObjectModel, Params, Skin


class OfficialPack:
    """A `robospa.tasks.packs.Pack` of the archive in one folder."""

    name = "official"

    def __init__(self, archive: Archive) -> None:
        self.archive = archive
        self._made = lru_cache(maxsize=1024)(self._make)

    def has(self, asset: str, params: Params) -> bool:
        """Whether the official benchmark takes it from the archive."""
        return asset == THING or official_model(asset, params.get("look", 0)) is not None

    def model(self, asset: str, params: Params) -> ObjectModel:
        """The archive's model of that look. ArchiveError, in one sentence, if it is not there or
        cannot be used; ValueError for an asset that the archive does not have."""
        return self._made(asset, json.dumps(dict(params), sort_keys=True))

    def digest(self) -> str:
        return digest_of(self.archive)

    def faults(self, tasks: Collection[str]) -> dict[str, str]:
        """For each of `tasks` that cannot run the first file to blame, in a sentence."""
        found = {}
        for task in tasks:
            models = (model for asset in official.needs().get(task, ()) for model in _models(asset))
            if text := next(filter(None, (fault(self.archive, model) for model in models)), ""):
                found[task] = text
        return found

    def clutter(self, scene: Scene) -> tuple[ClutterKind, ...]:
        """What may lie about in `scene`: our kinds, as the archive's models where it has those, and
        its things of Objaverse; none if it has no such things."""
        theirs = clutter_kinds(self.archive, self.name, scene)
        return (*map(self._packed, own_kinds(scene)), *theirs) if theirs else ()

    def _packed(self, kind: ClutterKind) -> ClutterKind:
        looks = [
            {**params, "pack": self.name} if self._there(kind.asset, params) else params
            for params in kind.looks
        ]
        return ClutterKind(kind.asset, looks)

    def _there(self, asset: str, params: Params) -> bool:
        model = official_model(asset, params["look"])
        try:
            return model is not None and bool(self.archive.files(model))
        except ArchiveError:
            return False

    def _make(self, asset: str, text: str) -> ObjectModel:
        params = json.loads(text)
        if asset == THING:
            return make_thing(self.archive, params.get("thing"))
        builtin = object_model(asset, params)
        chosen = official_model(asset, params.get("look", 0))
        if chosen is None:
            raise ValueError(f"the official archive has no {asset!r}; it is always built in")
        tint = NAMED[params["tint"]] if "tint" in params else None
        return make_model(self.archive, chosen, builtin, tint)


def open_pack() -> OfficialPack:
    """The pack of the folder that `open_archive` finds."""
    return OfficialPack(archives.open_archive())


def make_model(
    archive: Archive, chosen: OfficialModel, builtin: ObjectModel, tint: Color | None = None
) -> ObjectModel:
    """The archive's `chosen` model with all that its `builtin` likeness has."""
    files = archive.files(chosen)
    data = placings.read_model_data(files.data)
    parts = bodies_of(archive, files, chosen)
    data = data.in_root(parts.links)
    bodies = [parts.body, *([parts.door] if parts.door else [])]
    points = np.concatenate([corners for body in bodies for corners, _ in body.pieces])
    drawn = np.concatenate([body.box for body in bodies])
    box = np.stack([drawn.min(axis=0), drawn.max(axis=0)])
    placing = placings.place(points, box, data, chosen, builtin)
    placed = parts.body.placed(placing)
    placed_points = placing.points(points)
    return ObjectModel(
        asset=builtin.asset,
        shapes=convex_shapes(placed),
        size=vec3(placing.high - placing.low),
        radius=float(np.hypot(placed_points[:, 0], placed_points[:, 1]).max()),
        noun=builtin.noun,
        phrases=builtin.phrases,
        bottom=0.0,
        mass=data.mass or builtin.mass,
        friction=builtin.friction,
        grasps=placings.grasp_points(placed, builtin, placing, data, chosen),
        frames=placings.frames(builtin, placing, data, chosen),
        hinge=_hinge(parts, placing, builtin, chosen, tint),
        skin=Skin(str(parts.body.skin), placing.scale, placing.pose, tint),
    )


def _hinge(
    parts: Bodies, placing: Placing, builtin: ObjectModel, model: OfficialModel, tint: Color | None
) -> Hinge | None:
    """The door: it turns from 0 as drawn to its joint's limit, whichever way that is."""
    if parts.door is None or parts.joint is None:
        return None
    frame = parts.links[parts.joint.child]
    assert builtin.hinge is not None
    lower, upper = parts.joint.limits
    way = 1.0 if upper >= -lower else -1.0
    axis = placing.turn @ frame[:3, :3] @ np.asarray(parts.joint.axis) * way
    length = float(np.linalg.norm(axis))
    if length < 1e-6:
        raise ArchiveError(f"{model} has a door that turns about no axis")
    return Hinge(
        shapes=convex_shapes(parts.door.placed(placing)),
        point=vec3(placing.points(frame[None, :3, 3])[0]),
        axis=vec3(axis / length),
        upper=max(upper, -lower),
        friction=builtin.hinge.friction,
        damping=builtin.hinge.damping,
        mass=builtin.hinge.mass,
        skin=Skin(str(parts.door.skin), placing.scale, placing.pose, tint),
    )


@dataclass(frozen=True)
class Body:
    """`skin` is a file as `robospa.tasks.shapes.Skin` wants it, `box` (2, 3) the corners around
    all of it; `pieces` are convex."""

    skin: Path
    box: Floats
    pieces: tuple[Piece, ...]

    def placed(self, placing: Placing) -> list[Piece]:
        """The pieces in our body frame [m]."""
        return [(placing.points(corners), triangles) for corners, triangles in self.pieces]


@dataclass(frozen=True)
class Bodies:
    """The bodies of a model: `door` turns about `joint`. `links` are the links' frames (4, 4) in
    the root's by their names; a rigid model has none."""

    body: Body
    door: Body | None = None
    joint: UrdfJoint | None = None
    links: Mapping[str, Floats] = field(default_factory=dict)


def bodies_of(archive: Archive, files: ModelFiles, model: OfficialModel) -> Bodies:
    """Read the model's files, or what was made of them before. ArchiveError."""
    if files.urdf is None:
        assert files.visual is not None and files.collision is not None
        drawn, solid = (MeshUse(file, np.eye(4)) for file in (files.visual, files.collision))
        return Bodies(_body(archive, [drawn], [solid]))
    robot = read_urdf(files.urdf, archive.inside)
    joint = _door_joint(robot, model) if model.hinge else None
    moved = robot.moved_by(joint.child) if joint is not None else frozenset()
    rest = [link for link in robot.visuals if link not in moved]
    return Bodies(
        _of_links(archive, robot, rest, model),
        None if joint is None else _of_links(archive, robot, sorted(moved), model),
        joint,
        {link: robot.in_root(link) for link in robot.visuals},
    )


def _door_joint(robot: Urdf, model: OfficialModel) -> UrdfJoint:
    """The joint that turns most of the model's meshes: its door. ArchiveError if none turns."""

    def size(joint: UrdfJoint) -> int:
        files = (use.file for link in robot.moved_by(joint.child) for use in robot.visuals[link])
        return sum(file.stat().st_size for file in files if file.is_file())

    turning = [j for j in robot.joints.values() if j.kind in ("revolute", "continuous")]
    with_limits = [j for j in turning if j.limits[0] < j.limits[1]]
    if not with_limits:
        raise ArchiveError(f"{model} has no joint that turns, which its door needs")
    return max(with_limits, key=size)


def _of_links(
    archive: Archive, robot: Urdf, links: Iterable[str], what: object, whole: bool = False
) -> Body:
    """Links of a URDF file as one body in the root's frame, all joints at 0. ArchiveError, naming
    `what` has no meshes. With `whole` it collides as one hull around each mesh."""
    drawn, solid = (
        [
            MeshUse(use.file, robot.in_root(link) @ use.transform)
            for link in links
            for use in uses[link]
        ]
        for uses in (robot.visuals, robot.collisions)
    )
    if not drawn and not solid:
        raise ArchiveError(f"{what} has no meshes where its parts should be")
    return _body(archive, drawn or solid, solid or drawn, whole)


def _body(
    archive: Archive, drawn: Sequence[MeshUse], solid: Sequence[MeshUse], whole: bool = False
) -> Body:
    skin = skin_of(archive, drawn)
    return Body(
        skin, archives.load_arrays(skin, "box")["box"], colliding_pieces(archive, solid, whole)
    )


SIZES = (0.005, 0.6)
"""Lengths [m] that a thing on a table may have along its longest side."""
_NAME = re.compile(r"[A-Za-z0-9_-]{1,64}")


def clutter_kinds(archive: Archive, pack: str, scene: Scene) -> tuple[ClutterKind, ...]:
    """The categories that may lie about in `scene`: nothing that it could mean by its words. Of
    their colours nothing is known, so there are none where it names things by colour."""
    if colors_asked(scene):
        return ()
    taken, alike = taken_kinds(scene), clutter_alike()
    return tuple(
        ClutterKind(
            THING, tuple({"thing": f"{category}/{n}", "pack": pack} for n in numbers), fixed=True
        )
        for category, numbers in clutter_things(archive).items()
        if category in alike and not taken & alike[category]
    )


def make_thing(archive: Archive, name: object) -> ObjectModel:
    """The thing called "category/id". ArchiveError if it is not there or cannot be used."""
    category, _, number = str(name).partition("/")
    if not (_NAME.fullmatch(category) and _NAME.fullmatch(number)):
        raise ArchiveError(f"{str(name)[:80]!r} is no thing of the archive, such as 'bottle/3'")
    path = archive.root / "objects" / THING / category / number / "model.urdf"
    if not path.is_file():
        raise ArchiveError(f"the thing {name!r} is missing in the assets' folder")
    what = f"the thing {name!r} of the assets' folder"
    robot = read_urdf(path, archive.inside)
    body = _of_links(archive, robot, robot.visuals, what, whole=True)
    points = np.concatenate([corners for corners, _ in body.pieces])
    low, high = points.min(axis=0), points.max(axis=0)
    if not SIZES[0] <= float(np.ptp(points, axis=0).max()) <= SIZES[1]:
        size = " x ".join(f"{length:.3g}" for length in high - low)
        raise ArchiveError(f"{what} is {size} m large, and none can be: its files are wrong")
    noun = category.replace("_", " ")
    return ObjectModel(
        asset=THING,
        shapes=convex_shapes(body.pieces),
        size=vec3(high - low),
        radius=float(np.hypot(points[:, 0], points[:, 1]).max()),
        noun=noun,
        phrases=(noun,),
        bottom=float(low[2]),
        skin=Skin(str(body.skin)),
    )


# what a folder holds, and which tasks can run with it


THING = "objaverse"
"""The folder of things that only lie about, and what such a thing is called as the asset of an
object; its parameter "thing" is "category/id"."""
LIST = "list.json"
LARGEST_LIST = 4 << 20


@dataclass(frozen=True)
class Index:
    """`faults` gives for each model of the archive that cannot be used one sentence, by its name;
    `models` is how many there should be."""

    root: str
    models: int
    faults: Mapping[str, str]
    missing: Mapping[str, tuple[str, ...]]
    """For each task that cannot run the folders of the models that it needs."""
    filled: Mapping[str, tuple[str, ...]]
    """For each task the models whose hollow is filled by what collides of them."""
    robots: tuple[str, ...]
    textures: Mapping[str, int]
    """Number of background pictures of each split."""
    clutter: int
    digest: str

    @property
    def runnable(self) -> int:
        return len(official.needs()) - len(self.missing)

    def summary(self) -> str:
        """Which tasks can run and what the others need, in a sentence."""
        text = f"{self.runnable} of {len(official.needs())} tasks can run with this folder"
        lacking = [f"{task} needs {' and '.join(of)}" for task, of in self.missing.items()]
        return "; ".join([text, *lacking])

    def filled_text(self) -> str:
        """Which tasks have hollow things of which some models are filled, in a sentence; empty if
        none has."""
        tasks = [
            f"{task} ({', '.join(dict.fromkeys(name.partition('/')[0] for name in models))})"
            for task, models in self.filled.items()
        ]
        text = f"hollows are filled by their hull, as in SAPIEN, in {len(tasks)} tasks: "
        return text + "; ".join(tasks) if tasks else ""


def index(archive: Archive) -> Index:
    """Look at every model's files: that they are there, and that lengths, counts and sizes fit. Of
    meshes only what collides of hollow things is read, and kept in the cache."""
    models = {asset: _models(asset) for asset in official.official_assets()}
    faults: dict[str, str] = {}
    closed: dict[str, list[str]] = {}
    unusable: dict[str, str] = {}
    for asset, some in models.items():
        for model in some:
            try:
                text = fault(archive, model)
                if not text and is_filled(archive, model):
                    closed.setdefault(asset, []).append(model.name)
            except ArchiveError as error:
                text = str(error)
            if text:
                faults[model.name], unusable[asset] = text, model.folder
    missing = {
        task: tuple(sorted({unusable[asset] for asset in assets if asset in unusable}))
        for task, assets in official.needs().items()
        if any(asset in unusable for asset in assets)
    }
    return Index(
        root=str(archive.root),
        models=sum(map(len, models.values())),
        faults=faults,
        missing=missing,
        filled={
            task: found
            for task, assets in official.needs().items()
            if (found := tuple(name for asset in assets for name in closed.get(asset, ())))
        },
        robots=tuple(n for n in embodiments() if (archive.root / "embodiments" / n).is_dir()),
        textures={
            split: sum(1 for _ in (archive.root / "background_texture" / split).glob("*.png"))
            for split in ("seen", "unseen")
        },
        clutter=sum(map(len, clutter_things(archive).values())),
        digest=digest_of(archive),
    )


def _models(asset: str) -> list[OfficialModel]:
    return list({model.name: model for model in official.official_models(asset)}.values())


def fault(archive: Archive, model: OfficialModel) -> str:
    """What is wrong with a model, in a sentence; empty if nothing is. No mesh is read."""
    try:
        files = archive.files(model)
        data = read_model_data(files.data)
        for file in {files.visual, files.collision}:
            if file is not None and file.suffix == ".glb":
                check_glb(file)
        if files.urdf is not None:
            robot = read_urdf(files.urdf, archive.inside)
            meshes = (*robot.visuals.values(), *robot.collisions.values())
            check_files(use.file for uses in meshes for use in uses)
    except (ArchiveError, OSError) as error:
        return str(error)
    return _misfit(model, data)


def _misfit(model: OfficialModel, data: ModelData) -> str:
    """What of the model's data is not as listed, in a sentence; empty if all is."""
    for name, point in model.points.items():
        if data.point(point) is None:
            return f"{model.name} has no {point} point, where its {name} is"
    listed = official.official_size(model)
    if listed is None or data.extents is None:
        return ""
    up = data.extents[1] * data.scale[1]
    if not 0.8 < up / listed.size[1] < 1.25:
        return (
            f"{model.name} says it is {up:.3g} m high where the official one is {listed.size[1]} m"
        )
    return ""


def digest_of(archive: Archive) -> str:
    """Hash of names and sizes of all files that models are made of, and of what points say."""
    found = hashlib.sha256()
    for asset in official.official_assets():
        for model in official.official_models(asset):
            try:
                files = archive.files(model)
                made_of = (file for file in (files.visual, files.collision, files.urdf) if file)
                sizes = " ".join(str(file.stat().st_size) for file in made_of)
                with files.data.open("rb") as file:
                    said = file.read(LARGEST_DATA)
            except (ArchiveError, OSError):
                found.update(f"{model.name} missing\n".encode())
                continue
            found.update(f"{model.name} {sizes}\n".encode())
            found.update(said)
    folder = archive.root / "objects" / THING
    for category, numbers in clutter_things(archive).items():
        for number in numbers:
            things = sorted((folder / category / number).iterdir())
            sizes = " ".join(f"{f.name} {f.stat().st_size}" for f in things if f.is_file())
            found.update(f"{category}/{number} {sizes}\n".encode())
    return found.hexdigest()[:16]


def clutter_things(archive: Archive) -> Mapping[str, tuple[str, ...]]:
    """The ids of each category that are in the archive and in its list, sorted. ArchiveError for a
    list that cannot be read."""
    found: dict[str, list[str]] = {}
    listed: dict[str, list[str | int]] | None = None
    path = archive.root / "objects" / THING / LIST
    if path.is_file():
        data = read_json(archive.inside(path), LARGEST_LIST)
        listed = read(_List, data, repr(str(path)), ArchiveError).list_of_items
    there = (archive.root / "objects" / THING).glob("*/*/model.urdf")
    for name in sorted("/".join(path.parts[-3:-1]) for path in there):
        category, _, number = name.partition("/")
        if listed is None or number in map(str, listed.get(category, ())):
            found.setdefault(category, []).append(number)
    return {category: tuple(numbers) for category, numbers in found.items()}


class _List(msgspec.Struct):
    list_of_items: dict[str, list[str | int]]
