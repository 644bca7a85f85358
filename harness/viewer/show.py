"""What `robospa view RUN TRIAL` and `robospa tasks NAME --view` show, and where: in the browser.

Nothing is drawn here: the world runs without its renderer, and the poses of its bodies are kept. A
playback then stands in a scene in the browser that can be turned, on this machine only: viser
serves page and scene, what is shown at which time is `Playback.shown`, and the page loads nothing
from elsewhere. Shapes are those of the simulator's pictures, without its lights and textures;
robots are drawn with built-in shapes.
"""

from __future__ import annotations

import io
import socket
import threading
import time
from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager, redirect_stdout
from dataclasses import dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ARMS
from robospa.extras import need
from robospa.geometry import Pose, to_matrix
from robospa.harness.factory import load_function
from robospa.harness.replay import replay_record
from robospa.harness.robots import embodiment
from robospa.harness.robots.embodiment import Embodiment
from robospa.harness.sim.render_bodies import surface, tinted
from robospa.harness.trial import Recorder, TrialSetup, run_trial, task_parts
from robospa.harness.world import World
from robospa.results.failures.labels import NAMES, label
from robospa.results.records.action_problems import with_names
from robospa.results.records.manifest import RunError
from robospa.results.records.runs import Run, finished, read_run
from robospa.results.records.trial_record import EventRow, TrialRecord
from robospa.results.report.run_card import END_NAMES
from robospa.tasks.descriptions import describe_objects
from robospa.tasks.objects import object_model
from robospa.tasks.scene import Scene
from robospa.tasks.shapes import Color, Shape, Skin
from robospa.trial import TrialKey

if TYPE_CHECKING:
    import viser

    from robospa.harness.sim.sapien_world import SapienWorld

UNLISTED = frozenset({"approached"})
"""Kinds of events that are too many to be a list: a gripper came near something."""
CHANGES = ("subtask_done", "subtask_undone")
"""Kinds of events that change what is still to be done."""


@dataclass(frozen=True)
class Moment:
    """Something that happened at `time` [s, simulated], in words; `failure` is the trial's type."""

    time: float
    text: str
    failure: bool = False


@dataclass(frozen=True)
class Shown:
    """One instant of a trial.

    `poses` are those of all bodies that exist; `happened` counts the moments so far; `wanted` are
    the objects of subtasks that are still to be done.
    """

    time: float
    poses: Mapping[str, Pose]
    happened: int
    wanted: frozenset[str]


@dataclass(frozen=True)
class Playback:
    """A trial to be played.

    `times` [s, simulated] rise from 0; `frames` has the poses of all bodies at each of them.
    `names` are what a reader calls the objects, `subtasks` the numbers of the subtasks (from 0)
    that need an object.
    """

    record: TrialRecord
    times: Sequence[float]
    frames: Sequence[Mapping[str, Pose]]
    names: Mapping[str, str]
    subtasks: Mapping[str, tuple[int, ...]]

    @property
    def title(self) -> str:
        key = self.record.key
        return f"{key.task.replace('_', ' ')}, level {key.level}, seed {key.seed}"

    @property
    def outcome(self) -> str:
        """How it ended, and the type of its failure with the evidence, a paragraph each."""
        record, failure = self.record, label(self.record)
        found = END_NAMES[record.end]
        if record.total:
            found += f", {record.done} of {record.total} subtasks done"
        if failure is not None:
            why = f"{NAMES[failure.kind]}: {failure.evidence}"
            found += f"\n\n{with_names(why, self.names)}"
        return found

    @property
    def end(self) -> float:
        """Time of the last frame [s]."""
        return self.times[-1]

    @cached_property
    def moments(self) -> list[Moment]:
        return moments(self.record, self.names, self.end)

    def shown(self, time: float) -> Shown:
        """What is to be seen at `time`: the last frame at or before it, the first one before 0."""
        frame = max(0, bisect_right(self.times, time + 1e-9) - 1)
        happened = sum(moment.time <= time + 1e-9 for moment in self.moments)
        done: dict[int, bool] = {}
        for event in self.record.events:
            if event["kind"] in CHANGES and float(event["time"]) <= time + 1e-9:
                done[int(event["index"])] = event["kind"] == CHANGES[0]
        wanted = frozenset(
            name
            for name, numbers in self.subtasks.items()
            if not all(done.get(number, False) for number in numbers)
        )
        return Shown(self.times[frame], self.frames[frame], happened, wanted)


def moments(record: TrialRecord, names: Mapping[str, str], end: float) -> list[Moment]:
    """The events of `record` and the type of its failure, in words and in the order of time; a
    failure that has no moment stands at the `end` [s]."""
    found = [
        Moment(float(event.get("time", 0.0)), with_names(_in_words(event), names))
        for event in record.events
        if event["kind"] not in UNLISTED
    ]
    failure = label(record)
    if failure is not None:
        when = end if failure.time is None else failure.time
        found.append(Moment(when, f"failure: {NAMES[failure.kind]}", failure=True))
    return sorted(found, key=lambda moment: moment.time)


def _in_words(event: EventRow) -> str:
    about, note = event.get("object", ""), event.get("note", "")
    if event["kind"] == "closed":  # its note says how: touching or beside
        return f"closed, {note} {about}".rstrip(" ,")
    number = event.get("index", -1)
    head = event["kind"].replace("_", " ")
    if event["kind"].startswith("subtask"):
        head = head.replace("subtask", f"subtask {number + 1}")
    return ": ".join([head, " ".join(word for word in (about, note) if word)]).rstrip(": ")


TABLE = "table"
STAND = "stand"


@dataclass(frozen=True)
class DrawnMesh:
    """Triangles `faces` (F, 3) of `vertices` (V, 3) [m] in the frame of their body.

    `colors` are sRGB, uint8: (3,) one for all, or (V, 3) one a vertex.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32]
    colors: NDArray[np.uint8]


@dataclass(frozen=True)
class DrawnBody:
    """A body by its name; one that never moves has its `pose` [m, world]."""

    name: str
    meshes: tuple[DrawnMesh, ...]
    pose: Pose | None = None

    @property
    def box(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Centre and size (3,) [m] of the box around it, in its frame."""
        corners = np.concatenate([mesh.vertices for mesh in self.meshes])
        low, high = corners.min(axis=0), corners.max(axis=0)
        return (low + high) / 2, high - low


def drawn_bodies(scene: Scene, robot: Embodiment) -> list[DrawnBody]:
    """Everything that is seen of `scene`: table, robot, objects with their doors and lids."""
    from robospa.harness.sim import furniture
    from robospa.workcell import WORKCELL

    found = [DrawnBody(TABLE, meshes(furniture.table(WORKCELL.table)), Pose(scene.table_at))]
    found.append(DrawnBody(STAND, meshes(robot.body), Pose()))
    for side, arm in zip(ARMS, robot.arms, strict=True):
        found += [DrawnBody(f"{side} {link}", meshes(arm.shapes[link])) for link in arm.links]
    for item in scene.everything:
        model = object_model(item.asset, item.params)
        found.append(DrawnBody(item.name, meshes(model.shapes, model.skin)))
        if model.hinge is not None:
            part = meshes(model.hinge.shapes, model.hinge.skin)
            found.append(DrawnBody(f"{item.name} part", part))
    return [body for body in found if body.meshes]


def meshes(shapes: Iterable[Shape], skin: Skin | None = None) -> tuple[DrawnMesh, ...]:
    """The visual ones of `shapes`, one mesh a colour, and `skin`."""
    by_color: dict[Color, list[Shape]] = {}
    for shape in shapes:
        if shape.visual:
            by_color.setdefault(shape.color, []).append(shape)
    made = [_merged(same, color) for color, same in by_color.items()]
    return (*made, *([_skinned(skin)] if skin is not None else []))


def _merged(shapes: Sequence[Shape], color: Color) -> DrawnMesh:
    vertices, faces, count = [], [], 0
    for shape in shapes:
        corners, index = surface(shape.geometry)
        turned = corners[:, :3] @ to_matrix(shape.pose.rotation).T
        vertices.append(turned + np.asarray(shape.pose.position))
        faces.append(index + count)
        count += len(corners)
    return DrawnMesh(
        np.concatenate(vertices).astype(np.float32),
        np.concatenate(faces).astype(np.uint32),
        np.round(255 * np.clip(color, 0, 1) ** (1 / 2.2)).astype(np.uint8),
    )


def _skinned(skin: Skin) -> DrawnMesh:
    """The mesh in the file of `skin`, with its picture's colours at its vertices."""
    with np.load(skin.file, allow_pickle=False) as file:
        vertices, faces, uvs = file["vertices"], file["triangles"], file["uvs"]
        picture = tinted(file["picture"], skin)
    turn = to_matrix(skin.pose.rotation).T
    placed = (vertices * np.asarray(skin.scale)) @ turn + np.asarray(skin.pose.position)
    size = np.array(picture.shape[:2])
    rows, columns = (np.mod(uvs[:, ::-1], 1.0) * size).astype(int).clip(0, size - 1).T
    return DrawnMesh(placed.astype(np.float32), faces.astype(np.uint32), picture[rows, columns, :3])


EVERY = 0.1
"""Simulated seconds between two frames."""


class PoseRecorder(Recorder):
    """A `Recorder` of where everything in our simulator is, ten times a simulated second."""

    def __init__(self) -> None:
        self.times: list[float] = []
        self.frames: list[Mapping[str, Pose]] = []

    def started(self, world: World) -> None:
        self._keep(world, 0.0)

    def polled(self, world: World, time: float) -> None:
        if time >= self.times[-1] + EVERY - 1e-6:
            self._keep(world, time)

    def ended(self, world: World) -> None:
        self._keep(world, world.snapshot().time)

    def _keep(self, world: World, time: float) -> None:
        self.times.append(time)
        self.frames.append(cast("SapienWorld", world).bodies())


def recorded_playback(
    world: World,
    record: TrialRecord,
    folder: Path,
    *,
    parts: Callable[[TrialKey], TrialSetup] = task_parts,
    step_scale: float = 1.0,
) -> Playback:
    """The trial of `record`, whose actions are in the run in `folder`, played again.

    Raises ReplayError if it does not come again, RunError if its actions cannot be read.
    """
    recorder = PoseRecorder()
    replay_record(world, record, folder, recorder, parts=parts, step_scale=step_scale)
    return _playback(record, parts(record.key), recorder)


def _playback(record: TrialRecord, setup: TrialSetup, seen: PoseRecorder) -> Playback:
    roles = setup.tracker.roles
    subtasks = {name: role.subtasks for name, role in roles.items() if role.subtasks}
    names = describe_objects(setup.scene)
    return Playback(record, seen.times, seen.frames, names, subtasks)


LISTED = 5
"""So many trials are named where a name fits several."""


def trial_named(run: Run, name: str) -> TrialRecord:
    """The finished trial of `run` whose name begins so, such as Pick_Blocks_Size-L3-100004.

    Raises RunError if it fits none or several, naming some.
    """
    slugs = {r.key.slug: r for _, r in sorted(run.records.items()) if finished(r)}
    fits = [slug for slug in slugs if slug == name or slug.startswith(f"{name}-")]
    fits = fits or [slug for slug in slugs if slug.startswith(name)]
    if len(fits) == 1:
        return slugs[fits[0]]
    some = fits or [slug for slug, record in slugs.items() if not record.success] or list(slugs)
    listed = ", ".join(some[:LISTED]) or "none with a result"
    what = f"{len(fits)} trials are called" if fits else "no trial with a result is called"
    raise RunError(f"{what} {name!r}; {'they are' if fits else 'there are'} {listed}"
                   + (", ..." if len(some) > LISTED else ""))  # fmt: skip


def of_run(folder: Path, name: str) -> tuple[Playback, list[DrawnBody]]:
    """The trial called `name` of the run in `folder`, replayed; raises RunError, ReplayError."""
    from robospa.harness.running.films import replay_config
    from robospa.harness.sim.sapien_world import SapienWorld

    need("viser")  # what is missing is said before anything is played
    run = read_run(folder)
    record, config = trial_named(run, name), replay_config(run)
    parts = partial(load_function(config.parts), **config.parts_arguments)
    with closing(SapienWorld(**{**config.world_arguments, "render": False})) as world:
        played = recorded_playback(world, record, folder, parts=parts, step_scale=config.step_scale)
    return played, drawn_bodies(parts(record.key).scene, embodiment(record.key.embodiment))


def of_expert(key: TrialKey) -> tuple[Playback, list[DrawnBody]]:
    """The trial `key` with the expert; passes on what its world raises."""
    from robospa.harness.factory import policy_factory
    from robospa.harness.seeds.attempt import ORACLE
    from robospa.harness.sim.sapien_world import SapienWorld

    need("viser")
    setup, recorder = task_parts(key), PoseRecorder()
    with closing(SapienWorld(render=False)) as world:
        expert = policy_factory(ORACLE)()
        record = run_trial(world, expert, key, policy_seed=0, recorder=recorder)
    played = _playback(record, setup, recorder)
    return played, drawn_bodies(setup.scene, embodiment(key.embodiment))


def show(playback: Playback, bodies: Sequence[DrawnBody], port: int, minutes: float) -> None:
    """Serve `playback` until Ctrl-C, or for so many minutes if they are not 0."""
    until = time.monotonic() + 60 * minutes if minutes > 0 else float("inf")
    with serving(playback, bodies, port) as (address, advance):
        print(f"{playback.title} is at {address} (Ctrl-C stops it)", flush=True)
        try:
            play(advance, until)
        except KeyboardInterrupt:
            print()


HOST = "127.0.0.1"
RATE = 20
"""Pictures a second while it plays."""
EXPORT_RATE = 10
"""Frames a simulated second of a page for itself: as many as a playback has."""
SPEEDS = ("0.25", "0.5", "1", "2", "4")
EYE, AT = (0.3, -1.0, 1.65), (0.0, -0.05, 0.74)
"""Where the view begins and what it looks at [m, world]: from above the robot to the table."""
WANTED = (40, 190, 90)
"""sRGB of the box around an object that is still to be moved or pressed."""
PLAIN, FAILED = "gray", "red"
"""Of the buttons of events and of the failure."""
MARGIN = 0.015
"""So much wider than the object is that box [m]."""


class Scene3D:
    """The bodies of a playback in viser's scene; `show` moves them to a time."""

    def __init__(self, scene: Any, playback: Playback, bodies: Sequence[DrawnBody]) -> None:
        self._playback = playback
        self._nodes: dict[str, Any] = {}
        self._boxes: dict[str, Any] = {}
        self._labels: list[Any] = []
        scene.set_up_direction("+z")
        scene.configure_default_lights(cast_shadow=False)
        for number, body in enumerate(bodies):
            self._add(scene, f"/{number}", body)

    def _add(self, scene: Any, path: str, body: DrawnBody) -> None:
        node = scene.add_frame(path, show_axes=False)
        for index, mesh in enumerate(body.meshes):
            at = f"{path}/{index}"
            if mesh.colors.ndim == 1:
                color = tuple(map(int, mesh.colors))
                scene.add_mesh_simple(at, mesh.vertices, mesh.faces, color=color)
            else:
                trimesh, colors = need("trimesh"), {"vertex_colors": mesh.colors}
                made = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False, **colors)
                scene.add_mesh_trimesh(at, made)
        if body.pose is not None:
            _place(node, body.pose)
        else:
            self._nodes[body.name] = node
        name = self._playback.names.get(body.name)
        if name is None:
            return
        centre, size = body.box
        top = (float(centre[0]), float(centre[1]), float(centre[2] + size[2] / 2 + 0.03))
        shown: dict[str, Any] = {"anchor": "bottom-center", "font_screen_scale": 0.8}
        self._labels.append(scene.add_label(f"{path}/name", name, position=top, **shown))
        if body.name in self._playback.subtasks:
            self._boxes[body.name] = scene.add_box(
                f"{path}/wanted",
                WANTED,
                tuple(float(s) + 2 * MARGIN for s in size),
                opacity=0.4,
                position=tuple(map(float, centre)),
                cast_shadow=False,
            )

    def show(self, time: float) -> int:
        """Put everything where it is at `time` [s]; how many moments have passed by then."""
        shown = self._playback.shown(time)
        for name, node in self._nodes.items():
            pose = shown.poses.get(name)
            node.visible = pose is not None
            if pose is not None:
                _place(node, pose)
        for name, box in self._boxes.items():
            box.visible = name in shown.wanted
        return shown.happened

    def name_objects(self, wanted: bool) -> None:
        for text in self._labels:
            text.visible = wanted


def _place(node: Any, pose: Pose) -> None:
    node.position = pose.position
    node.wxyz = pose.rotation


class Panel:
    """What stands beside the scene: the sentence, the time, and what happened."""

    def __init__(self, server: viser.ViserServer, scene: Scene3D, playback: Playback) -> None:
        self._server, self._scene, self._playback = server, scene, playback
        self._lock = threading.Lock()
        gui = server.gui
        gui.add_markdown(
            f"**{_plain(playback.title)}**\n\n{_plain(playback.record.instruction)}\n\n"
            f"{_plain(playback.outcome)}"
        )
        step = 1 / RATE
        self._time = gui.add_slider(
            "time [s]", min=0.0, max=max(playback.end, step), step=step, initial_value=0.0
        )
        self._play = gui.add_checkbox("play", initial_value=True)
        self._speed = gui.add_dropdown("speed", SPEEDS, initial_value="1")
        names = gui.add_checkbox("names", initial_value=True)
        self._now = gui.add_markdown("")
        self._time.on_update(lambda _: self._show())
        names.on_update(lambda _: scene.name_objects(names.value))
        with gui.add_folder("events"):
            for moment in playback.moments:
                color = FAILED if moment.failure else PLAIN
                button = gui.add_button(f"{moment.time:.1f} s  {moment.text}", color=color)
                button.on_click(self._jump(moment.time))
        self._show()

    def _jump(self, when: float) -> Callable[[object], None]:
        def go(_: object) -> None:
            self._play.value = False
            self._time.value = min(when, self._playback.end)

        return go

    def _show(self) -> None:
        with self._lock, self._server.atomic():
            happened = self._scene.show(self._time.value)
            last = self._playback.moments[happened - 1].text if happened else "the trial begins"
            self._now.content = f"**last:** {_plain(last)}"

    def advance(self, seconds: float) -> None:
        """Play on by `seconds` of real time; at its end it begins again."""
        if self._play.value:
            later = self._time.value + seconds * float(self._speed.value)
            self._time.value = later if later < self._playback.end + 1.0 else 0.0


def _plain(text: str) -> str:
    """`text` as Markdown that shows its very characters."""
    return "".join(f"\\{c}" if c in "\\`*_{}[]<>()#+-.!|~" else c for c in text)


@contextmanager
def serving(
    playback: Playback, bodies: Sequence[DrawnBody], port: int = 0
) -> Iterator[tuple[str, Callable[[float], None]]]:
    """Serve `playback` on this machine: its address, and a function that plays on by some seconds.

    Raises MissingPackage without viser, of the extra `view`, and OSError for a port that is taken.
    """
    need("viser")
    with socket.socket() as probe:  # viser takes the next free port in place of one that is taken
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        probe.bind((HOST, port))
    with _server(playback, bodies, port) as (server, scene):
        server.gui.configure_theme(
            control_layout="fixed",
            control_width="large",
            show_logo=False,
            show_share_button=False,
        )
        panel = Panel(server, scene, playback)
        yield f"http://{HOST}:{server.get_port()}", panel.advance


@contextmanager
def _server(
    playback: Playback, bodies: Sequence[DrawnBody], port: int
) -> Iterator[tuple[viser.ViserServer, Scene3D]]:
    """viser with the scene of `playback`; what it prints as it starts and stops is not shown."""
    made = need("viser")
    with redirect_stdout(io.StringIO()):
        server = made.ViserServer(host=HOST, port=port, label="robospa", verbose=False)
    try:
        server.initial_camera.position, server.initial_camera.look_at = EYE, AT
        yield server, Scene3D(server.scene, playback, bodies)
    finally:
        with redirect_stdout(io.StringIO()):
            server.stop()


def play(advance: Callable[[float], None], until: float) -> None:
    """Play until the monotonic clock says `until` [s]."""
    before = time.monotonic()
    while (now := time.monotonic()) < until:
        advance(now - before)
        before = now
        time.sleep(min(1 / RATE, max(0.0, until - now)))


def as_html(playback: Playback, bodies: Sequence[DrawnBody]) -> str:
    """`playback` as one HTML page that needs no server: the scene plays and can be turned."""
    with _server(playback, bodies, 0) as (server, scene):
        scene.show(0.0)
        recording = server.get_scene_serializer()
        for frame in range(1, int(playback.end * EXPORT_RATE) + 2):
            recording.insert_sleep(1 / EXPORT_RATE)
            scene.show(frame / EXPORT_RATE)
        return str(recording.as_html())
