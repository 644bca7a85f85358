"""What a user's copy of the official assets holds, and which tasks can run with it."""

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import msgspec

from robospa.harness.packs.archive import Archive, ArchiveError, read_json
from robospa.harness.packs.convex import is_filled
from robospa.harness.packs.mesh_files import check_glb
from robospa.harness.packs.placing import LARGEST_DATA, ModelData, read_model_data
from robospa.harness.packs.urdf import check_files, read_urdf
from robospa.harness.robots import embodiments
from robospa.schema import read
from robospa.tasks import official
from robospa.tasks.official import OfficialModel

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
            except (ArchiveError, OSError) as error:
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


def task_faults(archive: Archive, tasks: Iterable[str]) -> dict[str, str]:
    """For each of `tasks` that cannot run a sentence that says which file is the first to blame."""
    found = {}
    for task in tasks:
        models = (model for asset in official.needs().get(task, ()) for model in _models(asset))
        if text := next(filter(None, (fault(archive, model) for model in models)), ""):
            found[task] = text
    return found


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
    for name in archive.clutter():
        category, _, number = name.partition("/")
        if listed is None or number in map(str, listed.get(category, ())):
            found.setdefault(category, []).append(number)
    return {category: tuple(numbers) for category, numbers in found.items()}


class _List(msgspec.Struct):
    list_of_items: dict[str, list[str | int]]
