"""`robospa tasks`: list the tasks, look at one scene, or make the contact sheet of all variants."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict, fields
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from robospa.harness.cli.options import DAYS, PORT, SEED, AsJson, print_json
from robospa.text import plain_console

if TYPE_CHECKING:
    from rich.console import Console
    from rich.table import Table

    from robospa.harness.sim.sapien_world import SapienWorld
    from robospa.tasks.scene import Scene, SceneObject
    from robospa.tasks.task import Task

GALLERY = Path("gallery.jpg")
SPLITS = ("train", "heldout", "indirect")


def tasks(
    name: Annotated[
        str | None,
        typer.Argument(help="a task, or a list as in `eval`, such as GAC; without it, all"),
    ] = None,
    level: Annotated[int, typer.Option(help="1 to 5")] = 1,
    seed: Annotated[int, typer.Option(callback=SEED, help="the scene's seed")] = 100_000,
    split: Annotated[
        str | None, typer.Option(help="train, heldout or indirect; without it, all")
    ] = None,
    camera: Annotated[
        str, typer.Option(help="head, left_wrist, right_wrist, front, third")
    ] = "head",
    size: Annotated[str, typer.Option(help="WIDTHxHEIGHT of the picture [px]")] = "640x480",
    world: Annotated[
        str | None, typer.Option(help="official: with the objects and quirks of that world")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="PNG file (or JPEG with --gallery)")] = None,
    frame: Annotated[bool, typer.Option(help="render the scene's first frame")] = True,
    gallery: Annotated[bool, typer.Option("--gallery", help="one picture of all levels")] = False,
    as_json: AsJson = False,
    view: Annotated[
        bool, typer.Option("--view", help="show the scene in 3-D, solved by the expert")
    ] = False,
    port: Annotated[
        int, typer.Option(callback=PORT, help="of --view, on 127.0.0.1; 0 for a free one")
    ] = 0,
    minutes: Annotated[
        float, typer.Option(callback=DAYS, help="--view stops after so long; 0 for on Ctrl-C")
    ] = 0.0,
) -> None:
    """List the tasks; describe and draw one scene; or draw tasks at all levels on one sheet."""
    console = plain_console()
    _check(camera, split)
    if world is not None and (as_json or view):
        raise typer.BadParameter("--world goes with pictures: leave out --json and --view")
    splits = SPLITS if split is None else (split,)
    listed = _named(name)
    if gallery and not as_json:
        _gallery(console, listed, seed, split or "heldout", world, out or GALLERY)
    elif len(listed) > 1:
        if view:
            raise typer.BadParameter("--view needs a task; `robospa tasks` lists them")
        print_json(_list_json(listed)) if as_json else console.print(_listing(listed))
    elif as_json:
        print_json(_scene_json(_scene(listed[0], level, seed), splits))
    elif view:
        _view(_scene(listed[0], level, seed), split or "heldout", port, minutes)
    else:
        scene = _scene(listed[0], level, seed)
        told, shown = (scene, scene) if world is None else _official(world)(scene)
        pixels = parse_size(size)
        _describe(console, told, splits)
        if frame:
            path = out or Path(f"{scene.task}-L{level}-{seed}.png")
            _draw(console, shown, camera, pixels, path)


def _check(camera: str, split: str | None) -> None:
    from robospa.observation import CAMERAS

    if camera not in CAMERAS:
        raise typer.BadParameter(f"no camera {camera!r}; there are {', '.join(CAMERAS)}")
    if split is not None and split not in SPLITS:
        raise typer.BadParameter(f"{split!r} is no split; there are {', '.join(SPLITS)}")


def parse_size(text: str) -> tuple[int, int]:
    """(width, height) of "640x480"; BadParameter if it is something else or beyond 4096."""
    width, _, height = text.partition("x")
    if not (width.isdecimal() and height.isdecimal()):
        raise typer.BadParameter(f"size {text!r} is not WIDTHxHEIGHT, such as 640x480")
    if not (1 <= int(width) <= 4096 and 1 <= int(height) <= 4096):
        raise typer.BadParameter(f"size {text!r} is not between 1x1 and 4096x4096")
    return int(width), int(height)


def _named(names: str | None) -> list[Task]:
    """The tasks of a list as in `eval`; all without one."""
    from robospa.harness.selection import parse_tasks
    from robospa.harness.settings import SettingsError
    from robospa.tasks.catalog import task
    from robospa.tasks.catalog import tasks as all_tasks

    try:
        return [task(name) for name in (all_tasks() if names is None else parse_tasks(names))]
    except SettingsError as error:
        raise typer.BadParameter(str(error)) from None


def _scene(task: Task, level: int, seed: int) -> Scene:
    from robospa.tasks.catalog import build_scene

    try:
        return build_scene(task.name, level, seed)
    except ValueError as error:
        raise typer.BadParameter(str(error)) from None


def _official(world: str) -> Callable[[Scene], tuple[Scene, Scene]]:
    """Makes a scene of ours one of the official world: as its sentence is made of it, and as it is
    shown. BadParameter for another world, or one that is not there."""
    from robospa.harness.official.layout import OFFICIAL, official_scenes, parse_official
    from robospa.harness.settings import SettingsError
    from robospa.harness.worlds import world_kind
    from robospa.tasks.seeds import accepted
    from robospa.trial import TrialKey

    if world_kind(world) is not OFFICIAL:
        raise typer.BadParameter(f"no pictures are made of the world {world!r}, but of official")
    try:
        _, layout = parse_official(world)
    except SettingsError as error:
        raise typer.BadParameter(str(error)) from None
    if layout.trouble:
        typer.echo(f"warning: {layout.trouble}", err=True)

    def scenes(scene: Scene) -> tuple[Scene, Scene]:
        key = TrialKey(scene.task, scene.level, scene.seed)
        seeds = accepted(scene.task, scene.level)
        return official_scenes(key, layout, {key.variant: seeds} if key.seed in seeds else {})

    return scenes


# -- all tasks --------------------------------------------------------------------------------


def per_level(values: list[int]) -> str:
    """The values of all levels: "150" if they agree, "1..5" if they rise evenly, else each."""
    rises = {b - a for a, b in pairwise(values)}
    if len(rises) == 1 and rises != {0}:
        return f"{values[0]}..{values[-1]}"
    return str(values[0]) if rises <= {0} else " ".join(map(str, values))


def _listing(listed: Sequence[Task]) -> Table:
    from rich import box
    from rich.table import Table

    from robospa.trial import BASIC, DIMENSIONS

    groups = {**DIMENSIONS, "basic": BASIC}
    table = Table(
        box=box.SIMPLE_HEAD,
        padding=(0, 1, 0, 0),
        pad_edge=False,
        caption="n candidates, T subtasks, limit in policy actions: values of levels 1 to 5\n"
        + "\n".join(f"{name}: {' '.join(members)}" for name, members in groups.items()),
        caption_justify="left",
    )
    for heading in ("task", "category", "n", "T"):
        table.add_column(heading, no_wrap=True)
    table.add_column("limit")
    for task in listed:
        levels = [task.levels[k] for k in sorted(task.levels)]
        names = ("candidates", "subtasks", "steps")
        limits = (per_level([getattr(level, name) for level in levels]) for name in names)
        table.add_row(task.name, task.category, *limits)
    return table


# -- one scene --------------------------------------------------------------------------------


def describe_skill(skill: object) -> str:
    """A skill call as "Pick object_2, lift 0.12": its fields that are set."""
    values = {f.name: getattr(skill, f.name) for f in fields(skill)}  # type: ignore[arg-type]
    shown = {key: value for key, value in values.items() if value is not None}
    subject = shown.pop("object", "")
    rest = [f"{key} {_plain(value)}" for key, value in shown.items()]
    head = f"{type(skill).__name__} {subject}".strip()
    return ", ".join([head, *rest])


def _plain(value: object) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list | tuple):
        return "(" + ", ".join(map(_plain, value)) + ")"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {_plain(item)}" for key, item in value.items())
    return str(value)


def _describe(console: Console, scene: Scene, splits: tuple[str, ...]) -> None:
    from rich.table import Table
    from rich.text import Text

    from robospa.tasks.catalog import task as find_task
    from robospa.tasks.sentences import instruction

    task = find_task(scene.task)
    limits = task.levels[scene.level]
    table = Table.grid(padding=(0, 2))
    table.add_column(style="bold", no_wrap=True)
    table.add_column()

    def row(label: str, value: str) -> None:
        table.add_row(label, Text(value))

    row("task", f"{task.name}, level {scene.level}, seed {scene.seed}")
    row("category", f"{task.category} ({task.dimension})")
    row("summary", task.summary)
    row("success", task.success)
    row("limits", f"n {limits.candidates}, T {limits.subtasks}, {limits.steps} actions")
    for split in splits:
        row(f"instruction ({split})", instruction(scene, split))
    for i, (key, value) in enumerate(scene.facts.items()):
        row("facts" if i == 0 else "", f"{key}: {_plain(value)}")
    for i, item in enumerate(scene.objects):
        row("objects" if i == 0 else "", _object_line(item))
    for i, skill in enumerate(task.plan(scene)):
        row("plan" if i == 0 else "", f"{i + 1}. {describe_skill(skill)}")
    row("scene digest", scene.digest)
    console.print(table)


def _object_line(item: SceneObject) -> str:
    late = "" if item.appears_at is None else f", appears at {item.appears_at:g} s"
    fixed = ", fixed" if item.fixed else ""
    return f"{item.name}: {item.asset} at {_plain(item.pose.position)}{fixed}{late}"


@contextmanager
def _drawing(console: Console, what: str) -> Iterator[SapienWorld]:
    """A simulator to draw with; what goes wrong with `what` is printed and ends with 1."""
    from rich.text import Text

    from robospa.harness.sim.sapien_world import SapienWorld
    from robospa.harness.world import RenderUnavailable, SceneUnstable

    with closing(SapienWorld()) as world:
        try:
            yield world
        except (RenderUnavailable, SceneUnstable, OSError, ValueError) as error:
            console.print(Text.assemble((f"no {what}:", "red"), f" {error}"))
            raise typer.Exit(1) from None


def _draw(console: Console, scene: Scene, camera: str, size: tuple[int, int], path: Path) -> None:
    from rich.text import Text

    from robospa.harness.pictures import gallery

    with _drawing(console, "picture") as world:
        gallery.save(gallery.first_frame(world, scene, camera, size), path)
    console.print(Text.assemble(("first frame", "bold"), f"  {path}"), soft_wrap=True)


def _view(scene: Scene, split: str, port: int, minutes: float) -> None:
    from robospa.harness.viewer.show import of_expert, show
    from robospa.trial import TrialKey

    key = TrialKey(scene.task, scene.level, scene.seed, split=split)
    show(*of_expert(key), port, minutes)


# -- the contact sheet ------------------------------------------------------------------------


def _gallery(
    console: Console, chosen: list[Task], seed: int, split: str, world: str | None, path: Path
) -> None:
    from rich.progress import track

    from robospa.harness.pictures import gallery
    from robospa.tasks.catalog import build_scene
    from robospa.tasks.sentences import instruction

    changed = None if world is None else _official(world)
    told: dict[str, Scene] = {}

    def build(task: str, level: int, seed: int) -> Scene:
        scene = build_scene(task, level, seed)
        said, shown = (scene, scene) if changed is None else changed(scene)
        told[shown.digest] = said
        return shown

    def sentence(scene: Scene) -> str:
        return instruction(told[scene.digest], split)

    with _drawing(console, "gallery") as simulator:
        rows = [
            gallery.task_row(simulator, task, seed, sentence, build)
            for task in track(chosen, "drawing", console=console)
        ]
        count = sum(len(row.cells) for row in rows)
        page = gallery.sheet(rows, f"RoboSPA · {len(rows)} tasks, {count} variants, seed {seed}")
        gallery.save(page, path)
    console.print(f"{count} variants in {path}", soft_wrap=True)


# -- JSON ---------------------------------------------------------------------------------------


def _list_json(listed: Sequence[Task]) -> list[dict[str, object]]:
    return [
        {
            "name": task.name,
            "category": task.category,
            "dimension": task.dimension,
            "summary": task.summary,
            "success": task.success,
            "levels": {str(number): asdict(level) for number, level in task.levels.items()},
        }
        for task in listed
    ]


def _scene_json(scene: Scene, splits: Sequence[str]) -> dict[str, object]:
    from robospa.tasks.catalog import task
    from robospa.tasks.sentences import instruction

    plan = [{"skill": type(call).__name__, **asdict(call)} for call in task(scene.task).plan(scene)]
    return {
        "scene": scene.to_json(),
        "digest": scene.digest,
        "instructions": {split: instruction(scene, split) for split in splits},
        "plan": plan,
    }
