"""What is shown of a trial at which time, and what it looks like in the browser."""

import time
import urllib.request
from collections.abc import Callable
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from command_line import robospa
from fake_runs import KNOWN, make_run, trial_record
from film_fakes import KEYS, recorded
from run_fakes import FakeWorld, parts

from robospa.geometry import Pose
from robospa.harness.replay import ReplayError
from robospa.harness.robots import embodiment
from robospa.harness.running.manifest import this_processor, write_manifest
from robospa.harness.viewer import show
from robospa.results.records.manifest import RunAbout, RunError, RunSettings, make_manifest
from robospa.results.records.trial_record import TrialRecord
from robospa.tasks.catalog import build_scene
from robospa.tasks.shapes import Box, Shape, Skin
from robospa.trial import TrialKey

NAMES = {"object_0": "the red block", "object_1": "the blue block"}
SUBTASKS = {"object_0": (0,), "object_1": (1, 2)}
TIMES = (0.0, 0.1, 0.2, 0.3)
FRAMES = tuple({"object_0": Pose((0.0, 0.0, t))} for t in TIMES)
EVENTS = (
    {"time": 0.05, "kind": "approached", "object": "object_0", "index": -1, "note": ""},
    {"time": 0.1, "kind": "closed", "object": "object_0", "index": -1, "note": "touching"},
    {"time": 0.1, "kind": "subtask_done", "object": "object_0", "index": 0, "note": ""},
    {"time": 0.2, "kind": "subtask_done", "object": "object_1", "index": 1, "note": ""},
    {"time": 0.3, "kind": "subtask_undone", "object": "object_0", "index": 0, "note": ""},
)


def record(success: bool, **changes: object) -> TrialRecord:
    made = trial_record(TrialKey("Stack_Two", 2, 7), success, total=3, done=1, events=EVENTS)
    return replace(made, **changes)  # type: ignore[arg-type]


def played(success: bool = True) -> show.Playback:
    return show.Playback(record(success), TIMES, FRAMES, NAMES, SUBTASKS)


def test_a_time_shows_the_last_frame_at_or_before_it() -> None:
    heights = {t: played().shown(t).poses["object_0"].position[2] for t in (-1, 0.05, 0.1, 0.25, 9)}
    assert heights == {-1: 0.0, 0.05: 0.0, 0.1: 0.1, 0.25: 0.2, 9: 0.3}


def test_an_object_is_wanted_until_all_its_subtasks_are_done() -> None:
    trial = played()
    assert trial.shown(0.0).wanted == {"object_0", "object_1"}
    assert trial.shown(0.1).wanted == {"object_1"}
    assert trial.shown(0.2).wanted == {"object_1"}, "its other subtask is still to be done"
    assert trial.shown(0.3).wanted == {"object_0", "object_1"}, "undone again"


def test_events_are_words_with_the_objects_names_and_approaches_are_left_out() -> None:
    assert [moment.text for moment in played().moments] == [
        "closed, touching the red block",
        "subtask 1 done: the red block",
        "subtask 2 done: the blue block",
        "subtask 1 undone: the red block",
    ]
    assert [played().shown(t).happened for t in (0.0, 0.1, 0.2, 5.0)] == [0, 2, 3, 4]


def test_a_failure_stands_at_its_moment_and_one_without_at_the_end() -> None:
    wrong = {"time": 0.2, "kind": "wrong_object", "object": "object_1", "index": -1, "note": ""}
    found = show.moments(record(False, events=(wrong,), category="GAC"), NAMES, 0.3)
    assert [(m.time, m.failure) for m in found] == [(0.2, False), (0.2, True)]
    assert found[1].text == "failure: target grounding"
    (idle,) = show.moments(record(False, events=(), category="GAC"), NAMES, 0.3)
    assert idle == show.Moment(idle.time, "failure: no attempt", failure=True)


class Posed(FakeWorld):
    """A fake world that tells where its only body is: as high as it is late."""

    def bodies(self) -> dict[str, Pose]:
        return {"block": Pose((0.0, 0.0, self.snapshot().time))}


def test_a_recorded_trial_is_played_again_and_seen(tmp_path: Path) -> None:
    record = recorded(tmp_path / "run", KEYS[0])
    played = show.recorded_playback(Posed(), record, tmp_path / "run", parts=parts)
    assert [frame["block"].position[2] for frame in played.frames] == list(played.times)
    assert played.times[0] == 0.0
    assert len(played.times) > 1
    assert played.record.instruction == record.instruction


def test_ten_frames_a_second_are_kept() -> None:
    recorder, world = show.PoseRecorder(), Posed()
    world.load(parts(KEYS[0]).scene)
    recorder.started(world)
    for poll in range(1, 26):
        recorder.polled(world, 0.02 * poll)
    assert recorder.times == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4, 0.5])


def test_a_trial_that_does_not_come_again_is_refused(tmp_path: Path) -> None:
    """In another outcome nowhere, in another state not on the kind of processor that ran it."""
    record = replace(recorded(tmp_path / "run", KEYS[0]), digest="another")
    for processors in ((), (this_processor(),)):
        about = RunAbout(processors=processors)
        write_manifest(tmp_path / "run", make_manifest(RunSettings(), KEYS, about))
        if not processors:
            show.recorded_playback(Posed(), record, tmp_path / "run", parts=parts)
    for claim, words in ((record, "state"), (replace(record, success=False), "success")):
        with pytest.raises(ReplayError, match=f"another {words}"):
            show.recorded_playback(Posed(), claim, tmp_path / "run", parts=parts)


@pytest.mark.sim
def test_the_simulator_tells_where_links_objects_and_doors_are() -> None:
    from robospa.harness.sim.sapien_world import SapienWorld

    scene = build_scene("Click_Bell_Open_Microwave_Place_Object", 3, 100000)
    robot = embodiment(scene.embodiment)
    world = SapienWorld(render=False)
    world.load(scene)
    seen, snapshot = world.bodies(), world.snapshot()
    assert {name: seen[name] for name in snapshot.poses} == dict(snapshot.poses)
    moving = {body.name for body in show.drawn_bodies(scene, robot) if body.pose is None}
    assert moving <= seen.keys()
    for a, (side, arm) in enumerate(zip(("left", "right"), robot.arms, strict=True)):
        tool = seen[f"{side} {arm.last_link}"] * arm.tool
        assert tool.position == pytest.approx(snapshot.end_effector[a].position, abs=1e-6)
    ((oven, angle),) = snapshot.hinges.items()
    assert abs(angle) < 0.01
    assert seen[f"{oven} part"].position == pytest.approx(seen[oven].position, abs=0.005)
    world.close()


needs_sapien = pytest.mark.skipif(find_spec("sapien") is None, reason="needs the extra `sim`")
RED, WHITE = (1.0, 0.0, 0.0), (1.0, 1.0, 1.0)


@needs_sapien
def test_shapes_of_one_colour_are_one_mesh_and_what_only_collides_is_left_out() -> None:
    box = Box((0.1, 0.2, 0.3))
    red, white = show.meshes(
        [
            Shape(box, color=RED),
            Shape(box, color=WHITE),
            Shape(box, Pose((1.0, 0.0, 0.0)), RED),
            Shape(box, Pose((9.0, 0.0, 0.0)), RED, visual=False),
        ]
    )
    assert red.colors.tolist() == [255, 0, 0]
    assert white.colors.tolist() == [255, 255, 255]
    assert len(red.faces) == 2 * len(white.faces) == 24
    assert np.allclose(red.vertices.max(axis=0), [1.1, 0.2, 0.3])
    assert red.faces.max() < len(red.vertices)


@needs_sapien
def test_a_model_from_a_file_has_the_colours_of_its_picture(tmp_path: Path) -> None:
    picture = np.zeros((2, 2, 4), np.uint8)
    picture[0, 1] = (10, 20, 30, 255)  # upper right
    np.savez(
        tmp_path / "skin.npz",
        vertices=np.eye(3, dtype=np.float32),
        normals=np.eye(3, dtype=np.float32),
        triangles=np.array([[0, 1, 2]], np.uint32),
        uvs=np.array([[0.9, 0.1], [0.1, 0.1], [0.9, 0.9]], np.float32),
        picture=picture,
    )
    skin = Skin(str(tmp_path / "skin.npz"), scale=(2.0, 1.0, 1.0), pose=Pose((0.0, 0.0, 1.0)))
    (mesh,) = show.meshes((), skin)
    assert mesh.colors.tolist() == [[10, 20, 30], [0, 0, 0], [0, 0, 0]]
    assert mesh.vertices.tolist() == [[2, 0, 1], [0, 1, 1], [0, 0, 2]]


@needs_sapien
def test_every_robot_and_every_object_of_a_scene_is_drawn() -> None:
    scene = build_scene("Click_Bell_Open_Microwave_Place_Object", 3, 100000)
    names = [body.name for body in show.drawn_bodies(scene, embodiment("franka-panda"))]
    assert names[0] == "table"
    assert len(set(names)) == len(names)
    assert {item.name for item in scene.objects} <= set(names)
    oven = next(item.name for item in scene.objects if "microwave" in item.asset)
    assert f"{oven} part" in names
    still = [b for b in show.drawn_bodies(scene, embodiment("aloha-agilex")) if b.pose is not None]
    assert [body.name for body in still] == ["table", "stand"]


needs_viser = pytest.mark.skipif(find_spec("viser") is None, reason="needs the extra `view`")

CORNERS = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0.2]], np.float32)
MESH = show.DrawnMesh(CORNERS, np.array([[0, 1, 2]], np.uint32), np.array([255, 0, 0], np.uint8))
BODIES = [
    show.DrawnBody("table", (MESH,), Pose((0.0, 0.0, 0.7))),
    show.DrawnBody("object_0", (MESH,)),
    show.DrawnBody("object_1", (MESH,)),
]


class FakeScene:
    """Stands for viser's scene."""

    def __init__(self) -> None:
        self.nodes: dict[str, SimpleNamespace] = {}

    def __getattr__(self, name: str) -> Callable[..., SimpleNamespace]:
        def add(path: str = "", *more: Any, **given: Any) -> SimpleNamespace:
            self.nodes[path] = node = SimpleNamespace(visible=True, more=more, **given)
            return node

        return add


def test_bodies_move_names_stand_above_them_and_wanted_ones_are_marked() -> None:
    fake = FakeScene()
    scene = show.Scene3D(fake, played(), BODIES)
    assert fake.nodes["/0"].position == (0.0, 0.0, 0.7)
    assert fake.nodes["/1/name"].more == ("the red block",)
    assert "/0/name" not in fake.nodes
    assert fake.nodes["/1/name"].position[2] > 0.2
    assert scene.show(0.1) == 2
    assert fake.nodes["/1"].position == (0.0, 0.0, 0.1)
    assert not fake.nodes["/1/wanted"].visible, "its subtask is done"
    assert not fake.nodes["/2"].visible, "it does not exist yet"
    assert fake.nodes["/2/wanted"].visible
    scene.name_objects(False)
    assert not fake.nodes["/1/name"].visible


@needs_viser
def test_it_is_served_on_this_machine_plays_and_ends() -> None:
    with show.serving(played(), BODIES) as (address, advance):
        assert address.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(address, timeout=10) as answer:
            assert b"<html" in answer.read(2000)
        port = int(address.rpartition(":")[2])
        with pytest.raises(OSError, match="in use"), show.serving(played(), BODIES, port):
            raise AssertionError("two servers on one port")
        show.play(advance, time.monotonic() + 0.1)
    with pytest.raises(OSError):
        urllib.request.urlopen(address, timeout=2)


@needs_viser
def test_a_page_for_itself_holds_the_scene() -> None:
    assert "<html" in show.as_html(played(), BODIES)[:2000]


SLUG = KNOWN[0].key.slug
TASK = KNOWN[0].key.task


def test_a_trial_goes_by_the_beginning_of_its_name(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", KNOWN)
    assert show.trial_named(run, SLUG).key == KNOWN[0].key
    short = f"{TASK}-L{KNOWN[0].key.level}-{KNOWN[0].key.seed}"
    assert show.trial_named(run, short).key == KNOWN[0].key
    with pytest.raises(RunError, match=f"trials are called '{TASK}'; they are {TASK}-L"):
        show.trial_named(run, TASK)
    with pytest.raises(RunError, match=r"no trial with a result is called 'Nothing'; there are \w"):
        show.trial_named(run, "Nothing")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["view", "RUN", "--html", "a.html"], "--html needs a trial"),
        (["view", "RUN", SLUG, "--film"], "are of a run's page"),
        (["tasks", "--view"], "--view needs a task"),
    ],
)
def test_flags_that_do_not_go_together_are_refused(
    tmp_path: Path, words: list[str], sentence: str
) -> None:
    done = robospa(*(tmp_path if word == "RUN" else word for word in words))
    assert done.code == 2 and sentence in done.err


@pytest.mark.skipif(find_spec("viser") is not None, reason="viser is installed here")
def test_without_viser_its_extra_is_named(tmp_path: Path) -> None:
    done = robospa("view", make_run(tmp_path / "run", KNOWN).folder, SLUG)
    assert done.code == 1 and "[view]'" in done.err
