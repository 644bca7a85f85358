"""A trial as something to look at: where every body is at which time, what happened when, and what
bodies look like.

Pure data: it comes from a world (`robospa.harness.viewer.show`) and is shown by a browser
(`robospa.harness.viewer.show`), and knows neither. Shapes are those of the simulator's pictures,
without its lights and textures; robots are drawn with the shapes that are built in.
"""

from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ARMS
from robospa.geometry import Pose, to_matrix
from robospa.harness.robots.embodiment import Embodiment
from robospa.harness.sim.render_bodies import surface
from robospa.results.failures.labels import NAMES, label
from robospa.results.records.action_problems import with_names
from robospa.results.records.trial_record import EventRow, TrialRecord
from robospa.results.report.run_card import END_NAMES
from robospa.tasks.objects import object_model
from robospa.tasks.scene import Scene
from robospa.tasks.shapes import Color, Shape, Skin

UNLISTED = frozenset({"approached"})
"""Kinds of events that are too many to be a list: a gripper came near something."""


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
    that need an object, and `changes` the times at which one was done (True) or undone. `failure`
    is the type of the trial's failure with its evidence, empty for a success.
    """

    title: str
    instruction: str
    outcome: str
    times: Sequence[float]
    frames: Sequence[Mapping[str, Pose]]
    moments: Sequence[Moment]
    names: Mapping[str, str]
    subtasks: Mapping[str, tuple[int, ...]]
    changes: Sequence[tuple[float, int, bool]]
    failure: str = ""

    @property
    def end(self) -> float:
        """Time of the last frame [s]."""
        return self.times[-1]

    def shown(self, time: float) -> Shown:
        """What is to be seen at `time`: the last frame at or before it, the first one before 0."""
        frame = max(0, bisect_right(self.times, time + 1e-9) - 1)
        happened = sum(moment.time <= time + 1e-9 for moment in self.moments)
        done: dict[int, bool] = {}
        for when, index, now in self.changes:
            if when <= time + 1e-9:
                done[index] = now
        wanted = frozenset(
            name
            for name, numbers in self.subtasks.items()
            if not all(done.get(number, False) for number in numbers)
        )
        return Shown(self.times[frame], self.frames[frame], happened, wanted)


def playback_of(
    record: TrialRecord,
    times: Sequence[float],
    frames: Sequence[Mapping[str, Pose]],
    names: Mapping[str, str],
    subtasks: Mapping[str, tuple[int, ...]],
) -> Playback:
    """The playback of the trial of `record`, seen at `times` [s] as `frames`."""
    key = record.key
    outcome = END_NAMES[record.end]
    if record.total:
        outcome += f", {record.done} of {record.total} subtasks done"
    changes = [
        (float(event["time"]), int(event["index"]), event["kind"] == "subtask_done")
        for event in record.events
        if event["kind"] in ("subtask_done", "subtask_undone")
    ]
    failure = label(record)
    why = f"{NAMES[failure.kind]}: {failure.evidence}" if failure is not None else ""
    return Playback(
        f"{key.task.replace('_', ' ')}, level {key.level}, seed {key.seed}",
        record.instruction,
        outcome,
        times,
        frames,
        moments(record, names, times[-1]),
        names,
        subtasks,
        changes,
        with_names(why, names),
    )


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
    from robospa.harness.sim.render_bodies import tinted

    with np.load(skin.file, allow_pickle=False) as file:
        vertices, faces, uvs = file["vertices"], file["triangles"], file["uvs"]
        picture = tinted(file["picture"], skin)
    turn = to_matrix(skin.pose.rotation).T
    placed = (vertices * np.asarray(skin.scale)) @ turn + np.asarray(skin.pose.position)
    size = np.array(picture.shape[:2])
    rows, columns = (np.mod(uvs[:, ::-1], 1.0) * size).astype(int).clip(0, size - 1).T
    return DrawnMesh(placed.astype(np.float32), faces.astype(np.uint32), picture[rows, columns, :3])
