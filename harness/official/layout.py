"""`--world official`: our simulator with official quirks of scenes and, where there is an archive,
with official objects.
"""

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

from robospa.harness.official.checkout import Episodes, episodes_of
from robospa.harness.official.sentences import SPLITS, OfficialSentences
from robospa.harness.official.switches import chosen, switched
from robospa.harness.packs import archive
from robospa.harness.packs.official import OfficialPack
from robospa.harness.packs.visuals import check_robot
from robospa.harness.robots import embodiment
from robospa.harness.settings import EvaluationSettings, Selection, SettingsError, Simulation
from robospa.harness.textures import VARIABLE
from robospa.harness.trial import TrialSetup
from robospa.harness.worlds import Parts, SapienKind
from robospa.protocol.options import option, read_options, url_options
from robospa.registry import UnknownName
from robospa.results.records.manifest import LayoutSettings
from robospa.tasks import packs
from robospa.tasks.catalog import build_scene, generator
from robospa.tasks.catalog import task as find_task
from robospa.tasks.modes.clutter import clutter
from robospa.tasks.scene import Scene
from robospa.tasks.sentences import instruction
from robospa.trial import TrialKey

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
    try:
        options = read_options(OfficialOptions, url_options(world.partition("?")[2]))
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
    if textures.is_dir():  # unless the user has named others
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
    def selection(self, settings: EvaluationSettings) -> Selection:
        """As they are; lets this process and its workers find the archive that is named."""
        simulation = settings.simulation
        if simulation.shuffle_instructions:
            raise SettingsError("shuffle_instructions goes with the suite's own world alone")
        if simulation.parts is not None:
            raise SettingsError("parts has scenes and sentences of its own: leave it out")
        use_archive(simulation)
        return settings.selection

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
