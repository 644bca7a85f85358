"""`--world official`: our simulator with official quirks of scenes and, where there is an archive,
with official objects.

A switch changes a finished scene: what follows from the draw itself cannot be switched back
(docs/official-world.md lists it).
"""

import hashlib
import os
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from robospa.geometry import Pose
from robospa.harness.official.sentences import SPLITS, OfficialSentences
from robospa.harness.packs import archive
from robospa.harness.packs.official import OfficialPack
from robospa.harness.packs.visuals import check_robot
from robospa.harness.robots import embodiment
from robospa.harness.settings import EvaluationSettings, SettingsError, Simulation
from robospa.harness.textures import VARIABLE
from robospa.harness.trial import TrialSetup
from robospa.harness.worlds import Parts, SapienKind
from robospa.protocol.options import option, read_options, url_options
from robospa.registry import UnknownName
from robospa.results.records.manifest import LayoutSettings
from robospa.tasks import packs
from robospa.tasks.catalog import build_scene, generator
from robospa.tasks.catalog import task as find_task
from robospa.tasks.colors import NAMED
from robospa.tasks.families.cross_view import EXTREMES, SEEN_AS, VIEWS, leaders
from robospa.tasks.families.memory import STAND_Z
from robospa.tasks.modes.clutter import clutter
from robospa.tasks.official import official_models
from robospa.tasks.scene import Scene, SceneObject
from robospa.tasks.sentences import instruction
from robospa.trial import TrialKey

IDS: Mapping[str, tuple[int, ...]] = {
    "Pick_Tea_Box_Relational": (0, 1, 2, 3, 4, 5),
    "Pick_Cans_Relational": (0, 1, 2, 3, 5, 6),
    "Pick_Soaps_Relational": (0, 1, 2, 3),
    "Pick_Sauce_Can_Multi_View": (0, 2, 4, 6),
    "Pick_Seals_Multi_View": (1, 2, 3, 4, 6),
    "Pick_Breads_Multi_View": (0, 1, 2, 3, 4, 5, 6),
}
"""Official models of the tasks with equal things, in the order of episodes."""
MULTI_VIEW = (
    "Pick_Sauce_Can_Multi_View", "Pick_Seals_Multi_View", "Pick_Breads_Multi_View",
    "Pick_Mixed_Objects_Multi_View_A", "Pick_Mixed_Objects_Multi_View_B",
)  # fmt: skip
MICROWAVE = "Click_Bell_Open_Microwave_Place_Object"
MICROWAVE_RISE = 0.06
"""The official microwave stands in the air [m]."""
STANDS = {"Observe_Blocks_Move_Memory": 0.85, "Observe_Objects_Click_Memory": 0.8}
"""Tasks in which something is shown on a stand, and its official grey."""
HIDING = (*STANDS, "Remember_Orientation_Restore")
WALL_HALF, WALL_Z = 0.2, 0.95
"""Half height and middle [m] of the official wall: it ends 1 cm above the table."""
SAME_HEIGHT = 1e-6
PURE: Mapping[str, tuple[float, float, float]] = {
    "red": (1, 0, 0), "green": (0, 1, 0), "blue": (0, 0, 1), "yellow": (1, 1, 0),
    "cyan": (0, 1, 1), "magenta": (1, 0, 1), "orange": (1, 0.5, 0), "purple": (0.5, 0, 0.5),
    "white": (1, 1, 1), "black": (0.1, 0.1, 0.1), "brown": (0.6, 0.3, 0.1),
    "pink": (1, 0.75, 0.8),
}  # fmt: skip
OWN_PURE: Mapping[str, Mapping[str, tuple[float, float, float]]] = {
    "Pick_Blocks_Distance": {
        "purple": (0.55, 0, 0.85), "pink": (1, 0.4, 0.7), "brown": (0.55, 0.27, 0.07),
        "gray": (0.5, 0.5, 0.5),
    },
    "Rank_Blocks_Color": {"purple": (1, 0, 1)},
    "Hit_Blocks_Hammer_Order": {"purple": (1, 0, 1)},
    "Stack_Blocks_Color_Order": {"purple": (0.6, 0.2, 0.8)},
}  # fmt: skip
"""Official values of colour words as the renderer's linear input, and where a task has its own."""

Change = Callable[[Scene, int], Scene]
"""A scene and its episode number to the scene with the quirk."""


@dataclass(frozen=True)
class Switch:
    """A quirk of `tasks`, of all if there are none. `unsaid`: it only shows, and is switched after
    the sentence was made."""

    name: str
    tasks: tuple[str, ...]
    change: Change
    unsaid: bool = False


def switched(scene: Scene, episode: int, switches: Iterable[Switch], unsaid: bool = False) -> Scene:
    """`scene` with the quirks of `switches` that are `unsaid`, or those that are not."""
    for switch in switches:
        if switch.unsaid is unsaid and (not switch.tasks or scene.task in switch.tasks):
            scene = switch.change(scene, episode)
    return scene


def chosen(text: str) -> tuple[Switch, ...]:
    """The switches that `text` names: all, none, or names, comma separated; ValueError."""
    if text in ("all", "none"):
        return SWITCHES if text == "all" else ()
    known = {switch.name: switch for switch in SWITCHES}
    names = text.split(",")
    if wrong := [name for name in names if name not in known]:
        raise ValueError(f"there is no switch {wrong[0]!r}; there are {', '.join(known)}")
    return tuple(switch for switch in SWITCHES if switch.name in names)


def _changed(scene: Scene, changes: Mapping[str, SceneObject]) -> Scene:
    return replace(scene, objects=tuple(changes.get(o.name, o) for o in scene.objects))


def _with(item: SceneObject, **params: Any) -> SceneObject:
    return replace(item, params={**item.params, **params})


def _by_episode(scene: Scene, episode: int) -> Scene:
    points = np.array([[item.pose.position[:2] for item in scene.objects]])
    extreme = episode % len(EXTREMES)
    target = scene.objects[int(leaders(points)[0][0][extreme])].name
    block = f"{scene.task}/{scene.level}/{episode // len(VIEWS)}"
    seed = int.from_bytes(hashlib.sha256(block.encode()).digest()[:8], "big")
    order = np.random.default_rng(seed).permutation(len(VIEWS))
    view = VIEWS[int(order[episode % len(VIEWS)])]
    facts = {
        **scene.facts,
        "target": target,
        "extreme": EXTREMES[extreme],
        "viewpoint": view,
        "position": SEEN_AS[view][extreme],
    }
    return replace(scene, facts=facts)


def _model_by_episode(scene: Scene, episode: int) -> Scene:
    ids = IDS[scene.task]
    model = str(ids[episode % len(ids)])
    models = [one.model for one in official_models(scene.objects[0].asset)]
    if model not in models:  # no look of ours stands for it
        return scene
    look = models.index(model)
    return replace(scene, objects=tuple(_with(item, look=look) for item in scene.objects))


def _microwave(scene: Scene, episode: int) -> Scene:
    name = scene.facts.get("microwave")
    if not name:
        return scene
    item = scene.object(name)
    x, y, z = item.pose.position
    risen = Pose((x, y, z + MICROWAVE_RISE), item.pose.rotation)
    return _changed(scene, {name: replace(item, pose=risen)})


def _left_one(scene: Scene, episode: int) -> Scene:
    one, other = scene.facts.get("object"), scene.facts.get("reference")
    if not one or not other:
        return scene
    left, right = sorted((one, other), key=lambda name: scene.object(name).pose.position[0])
    return replace(scene, facts={**scene.facts, "object": left, "reference": right})


def _wall(scene: Scene, episode: int) -> Scene:
    item = scene.object(scene.facts["wall"])
    x, y, _ = item.pose.position
    half = [*item.params["half"][:2], WALL_HALF]
    at = Pose((x, y, WALL_Z + scene.table_rise), item.pose.rotation)
    raised = replace(_with(item, half=half), pose=at)
    return _changed(scene, {item.name: raised})


def _stand(scene: Scene, episode: int) -> Scene:
    grey = [STANDS[scene.task]] * 3
    stands = [
        item
        for item in scene.objects
        if item.fixed and abs(item.pose.position[2] - scene.table_rise - STAND_Z) < SAME_HEIGHT
    ]
    return _changed(scene, {item.name: _with(item, color=grey) for item in stands})


def _colors(scene: Scene, episode: int) -> Scene:
    pure = {**PURE, **OWN_PURE.get(scene.task, {})}
    words = {NAMED[word]: word for word in pure}
    changes = {}
    for item in scene.objects:
        word = words.get(tuple(item.params.get("color", ())))
        if item.asset == "block" and word and item.name != scene.facts.get("wall"):
            changes[item.name] = _with(item, color=[float(v) for v in pure[word]])
    return _changed(scene, changes)


SWITCHES = (
    Switch("extreme-by-episode", MULTI_VIEW, _by_episode),
    Switch("model-by-episode", tuple(IDS), _model_by_episode),
    Switch("left-thing-moves", (MICROWAVE,), _left_one),
    Switch("floating-microwave", (MICROWAVE,), _microwave),
    Switch("gap-under-wall", HIDING, _wall),
    Switch("pale-stand", tuple(STANDS), _stand, unsaid=True),
    Switch("pure-colors", (), _colors, unsaid=True),
)
"""In the order in which they are switched."""


NAME = "official"
PARTS = "robospa.harness.official.layout:official_world_parts"
SUITE = "official-1"
BUILTIN_SUITE = "official-1-builtin"
"""The suite of results with official objects, and with our own in their place."""
OWN_SENTENCES = (
    "sentences are our own and name looks of built-in objects, such as a blue stapler, which the "
    "archive's models need not have; add --instructions CHECKOUT for the official ones"
)


@dataclass(frozen=True)
class OfficialOptions:
    """Options of `official?name=value&...`."""

    assets: str = option(
        "auto",
        "objects: of the official archive, our own, or the first if there is an archive",
        ("auto", "official", "builtin"),
    )
    settle: str = option(
        "usual", "usual: until nothing moves, 1 s at most; official: 11 s", ("usual", "official")
    )
    switches: str = option("all", "official quirks of scenes: all, none, or names")


@dataclass(frozen=True)
class OfficialLayout:
    """How a scene becomes one of this world: whether its objects are `packed` into the archive's
    (whose `digest` it is), and the quirks that are switched back. Picklable."""

    packed: bool
    switches: str
    digest: str = ""
    trouble: str = ""
    """Why the objects are our own, if that was not asked for."""

    @property
    def suite(self) -> str:
        return SUITE if self.packed else BUILTIN_SUITE

    def warnings(self, official_sentences: bool) -> list[str]:
        if self.packed and not official_sentences:
            return [OWN_SENTENCES]
        return [self.trouble] if self.trouble else []

    def manifest_settings(self) -> LayoutSettings:
        names = [switch.name for switch in chosen(self.switches)]
        assets = NAME if self.packed else "builtin"
        return LayoutSettings(assets, self.digest, names)

    def pack(self, scene: Scene) -> Scene:
        """`scene` with the archive's objects, if they are packed, and, if its mode draws clutter,
        with the archive's too."""
        if not self.packed:
            return scene
        scene, opened = packs.with_pack(scene, NAME), archive_pack()
        most = int(scene.strengths.get("clutter", 0))
        kinds = opened.clutter(scene) if most else ()
        if not kinds:
            return scene
        rng = generator(f"{self.suite}/{scene.task}/{scene.level}/{scene.seed}/clutter")
        return replace(scene, clutter=clutter(scene, rng, most, kinds))


def use_archive(simulation: Simulation) -> None:
    """Let this process and its workers find the archive that `simulation` names. Raises
    SettingsError if that is no folder."""
    folder = simulation.assets
    if folder is None:
        return
    if not folder.is_dir():
        raise SettingsError(f"there is no folder {folder}: assets has objects/ and embodiments/")
    os.environ[archive.VARIABLE] = str(folder.absolute())
    packs.pack.cache_clear()  # this process may have opened another archive


def archive_pack() -> OfficialPack:
    """The pack of the archive. UnknownName or ValueError if it cannot be opened."""
    opened = packs.pack(NAME)
    assert isinstance(opened, OfficialPack)
    return opened


def parse_official(
    world: str, named: bool = False, tasks: Collection[str] = ()
) -> tuple[OfficialOptions, OfficialLayout]:
    """The options that `world` names, and the layout they make on this machine. Raises
    SettingsError if official objects are asked for, by an option or by an archive that is `named`,
    and not there; or if the archive lacks something of `tasks`."""
    name, _, given = world.partition("?")
    if name != NAME:
        raise SettingsError(f"--world {world}: options are written {NAME}?settle=official")
    try:
        options = read_options(OfficialOptions, url_options(given))
        chosen(options.switches)
    except ValueError as error:
        raise SettingsError(f"--world {world}: {error}") from error
    if options.assets == "builtin":
        return options, OfficialLayout(False, options.switches)
    try:
        opened = archive_pack()
        layout = OfficialLayout(True, options.switches, opened.digest())
    except (UnknownName, ValueError, OSError) as error:
        if named or options.assets == NAME:
            raise SettingsError(
                f"--world {world}: there are no official objects: {error}"
            ) from error
        trouble = f"objects are built in, because there are no official ones: {error}"
        return options, OfficialLayout(False, options.switches, trouble=trouble)
    textures = opened.archive.root / "background_texture"
    if any(textures.glob("*seen/*")):  # unless the user has named others
        os.environ.setdefault(VARIABLE, str(textures))
    faults = opened.faults(tasks)
    for task, fault in faults.items():
        raise SettingsError(
            f"{len(faults)} of {len(tasks)} tasks cannot run with this archive, {task} because "
            f"{fault}; leave it out with --tasks; `robospa official assets` lists all"
        )
    return options, layout


def check_robots(names: Collection[str]) -> None:
    """Raises SettingsError if the archive lacks the meshes of one of these robots."""
    try:
        opened = archive.open_archive()
        for name in sorted(names):
            check_robot(opened, embodiment(name))
    except (ValueError, OSError) as error:
        raise SettingsError(f"robots cannot be drawn with the official meshes: {error}") from error


class _OfficialKind(SapienKind):
    def check(self, settings: EvaluationSettings) -> None:
        """Also lets this process and its workers find the archive that is named."""
        simulation = settings.simulation
        if simulation.parts is not None:
            raise SettingsError("parts has scenes and sentences of its own: leave it out")
        use_archive(simulation)
        if simulation.assets is not None and simulation.robot_assets == "builtin":
            options, _ = parse_official(simulation.world, named=True)
            if options.assets == "builtin":
                raise SettingsError(
                    f"--world {simulation.world} uses nothing of the folder {simulation.assets}: "
                    "leave out --assets, or its option assets"
                )

    def arguments(self, settings: EvaluationSettings) -> dict[str, object]:
        simulation = settings.simulation
        start, _ = parse_official(simulation.world, simulation.assets is not None)
        found = {**super().arguments(settings), "settle": start.settle}
        if simulation.robot_assets != "builtin":
            found["robot_assets"] = simulation.robot_assets
        return found

    def parts(self, settings: EvaluationSettings, keys: Sequence[TrialKey]) -> Parts:
        simulation = settings.simulation
        _, arguments = super().parts(settings, keys)
        tasks = {key.task for key in keys}
        _, layout = parse_official(simulation.world, simulation.assets is not None, tasks)
        if simulation.robot_assets != "builtin":
            check_robots({key.embodiment for key in keys})
        return PARTS, {**arguments, "layout": layout, "episodes": episodes_of(keys)}

    def layout(self, arguments: Mapping[str, object]) -> tuple[LayoutSettings | None, list[str]]:
        layout = arguments["layout"]
        assert isinstance(layout, OfficialLayout)
        return layout.manifest_settings(), layout.warnings("sentences" in arguments)


OFFICIAL = _OfficialKind(NAME, "robospa.harness.official.official_world:OfficialWorld")


Episodes = Mapping[tuple[str, int], Sequence[int]]
"""The seeds of every variant in their order: a seed's place is its official episode number, which
decides variants of objects and viewpoints."""


def episodes_of(keys: Sequence[TrialKey]) -> Episodes:
    """The seeds of every variant of `keys`, in their order, each once."""
    found: dict[tuple[str, int], dict[int, None]] = {}
    for key in keys:
        found.setdefault(key.variant, {})[key.seed] = None
    return {variant: tuple(seeds) for variant, seeds in found.items()}


def official_world_parts(
    key: TrialKey,
    layout: OfficialLayout,
    episodes: Episodes,
    sentences: OfficialSentences | None = None,
) -> TrialSetup:
    """Scene, goal and sentence of `key`; with `sentences` the official ones."""
    told, shown = official_scenes(key, layout, episodes)
    if sentences is not None:
        said = sentences.instruction(told, key.split)
    else:
        ours = {theirs: own for own, theirs in SPLITS.items()}
        said = instruction(told, ours.get(key.split, key.split))
    task = find_task(key.task)
    return TrialSetup(shown, task, task.goal(shown), said)


def official_scenes(
    key: TrialKey, layout: OfficialLayout, episodes: Episodes
) -> tuple[Scene, Scene]:
    """The scene of `key` of which its sentence is made, and as it is shown: what only shows is
    switched after the sentence was made, so that colours are named by their words. A seed's place
    among `episodes` is its episode number."""
    switches = chosen(layout.switches)
    number = list(episodes.get(key.variant, (key.seed,))).index(key.seed)
    drawn = build_scene(key.task, key.level, key.seed, key.embodiment, key.mode)
    told = layout.pack(switched(drawn, number, switches))
    shown = switched(told, number, switches, unsaid=True)
    return told, replace(shown, suite=layout.suite)
