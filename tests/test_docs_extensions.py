"""The worked examples of a task, a robot, a scene mode and a dialect, each found by the entry point
of an installed package and run whole."""

import re
import sys
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from http.server import ThreadingHTTPServer
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import robospa
from installed import EXAMPLES, installed
from standins import QUICK
from standins_http import STATE, TRIAL, observation
from wire_helpers import serving

from robospa.clients import check_options, connect
from robospa.clients.dialect import dialects
from robospa.harness import robots
from robospa.harness.robots.kinematics import chain_of, end_effector
from robospa.protocol.conformance import check
from robospa.protocol.errors import HandshakeError
from robospa.protocol.policy import TrialInfo
from robospa.registry import ROBOTS, SCENE_MODES, UnknownName
from robospa.tasks import catalog, modes
from robospa.tasks.catalog import build_scene
from robospa.tasks.instructions import similarity
from robospa.tasks.scene import Scene
from robospa.tasks.sentences import instruction, sentences, templates
from robospa.tasks.task import SceneSample
from robospa.trial import TrialKey
from robospa.workcell import TABLE_TOP

TASK, ROBOT, MODE = "Pick_Leftmost_Block", "uneven-arms", "low-table"
ENTRIES = {
    "robospa.tasks": {TASK: "leftmost_block.task:TASK"},
    ROBOTS: {ROBOT: "uneven_arms:UNEVEN_ARMS"},
    SCENE_MODES: {MODE: "low_table:low_table"},
}
PAGES = EXAMPLES.parent


def forget() -> None:
    """Let extensions be looked for anew, and their modules be imported anew."""
    catalog.extensions.cache_clear()
    robots.embodiment.cache_clear()
    robots._installed.cache_clear()
    modes.mode.cache_clear()
    for name in ("leftmost_block", "leftmost_block.task", "uneven_arms", "low_table"):
        sys.modules.pop(name, None)


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The task, the robot and the scene mode, installed."""
    monkeypatch.syspath_prepend(EXAMPLES)
    monkeypatch.syspath_prepend(installed(tmp_path, ENTRIES))
    forget()
    yield tmp_path
    forget()


def test_without_the_package_there_are_none() -> None:
    forget()
    with pytest.raises(KeyError, match=TASK):
        catalog.task(TASK)
    with pytest.raises(ValueError, match=f"{ROBOT}.* known"):
        robots.embodiment(ROBOT)
    with pytest.raises(ValueError, match=f"{MODE}.* known"):
        build_scene("Pick_Blocks_Size", 1, 0, mode=MODE)


def test_entries_that_lead_to_something_else_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(EXAMPLES)
    wrong = {"robospa.tasks": {TASK: "leftmost_block.task:LEVELS"}}
    wrong |= {ROBOTS: {ROBOT: "math:pi"}, SCENE_MODES: {MODE: "math:pi"}}
    monkeypatch.syspath_prepend(installed(tmp_path, wrong))
    forget()
    with pytest.raises(ValueError, match="LEVELS"):
        catalog.task(TASK)
    with pytest.raises(ValueError, match="Embodiment"):
        robots.embodiment(ROBOT)
    with pytest.raises(ValueError, match="no function of a scene"):
        modes.mode(MODE)
    forget()


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("nowhere.task:TASK", "cannot load 'nowhere.task:TASK': No module"),
        ("leftmost_block.task:MINE", "cannot load 'leftmost_block.task:MINE'"),
    ],
)
def test_a_task_that_cannot_be_loaded_is_named(
    value: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(EXAMPLES)
    monkeypatch.syspath_prepend(installed(tmp_path, {"robospa.tasks": {TASK: value}}))
    forget()
    with pytest.raises(UnknownName, match=said):
        catalog.task(TASK)
    forget()


def test_a_task_of_no_category_and_a_scene_of_equal_names_are_refused(package: Path) -> None:
    task = catalog.task(TASK)
    with pytest.raises(ValueError, match="no category 'CPX' in GAC, "):
        replace(task, category="CPX")

    def doubled(*given: Any) -> SceneSample:
        made = task.draw(*given)
        return replace(made, objects=made.objects[:1] * 2)

    catalog.offer(replace(task, draw=doubled))
    with pytest.raises(ValueError, match="two objects of one name"):
        build_scene(TASK, 1, 0)


# --- a task -----------------------------------------------------------------------------------


def test_the_task_is_found_by_name_and_is_no_part_of_the_benchmark(package: Path) -> None:
    assert catalog.task("pick leftmost block").name == TASK
    assert TASK not in catalog.tasks()
    scene = build_scene(TASK, 4, 500_000)
    assert scene == build_scene(TASK, 4, 500_000) != build_scene(TASK, 4, 500_001)
    assert catalog.task(TASK).levels[4].candidates == len(scene.objects) == 5


def test_its_target_stands_farthest_left(package: Path) -> None:
    for level in catalog.task(TASK).levels:
        for seed in range(500_000, 500_060):
            scene = build_scene(TASK, level, seed)
            xs = sorted(item.pose.position[0] for item in scene.objects)
            target = scene.object(scene.facts["target"])
            assert target.pose.position[0] == xs[0] < xs[1] - 0.03


def test_its_sentences_are_its_own(package: Path) -> None:
    scene = build_scene(TASK, 2, 500_000)
    train, held = sentences(scene, "train"), sentences(scene, "heldout")
    assert len({*train, *held}) == 200
    assert instruction(scene, "train") in train and instruction(scene) in held
    own = templates(TASK, 2)
    assert max(similarity(a, b) for a in own.train for b in own.heldout) < 0.75


@pytest.mark.sim
def test_the_commands_of_its_page_work(package: Path) -> None:
    shown = robospa("tasks", TASK, "--level", "5", "--seed", "100003", "--no-frame")
    assert shown.code == 0 and "1. Pick object_" in shown.out
    words = ("--levels", "2", "--start", "900000", "--count", "2", "--check")
    checked = robospa("seeds", TASK, *words)
    assert checked.code == 0 and "2 of 2" in checked.out


# --- a robot ----------------------------------------------------------------------------------


def test_it_meets_the_scenes_of_every_robot_and_its_joints_make_columns(package: Path) -> None:
    ours, theirs = (build_scene("Pick_Blocks_Size", 3, 1, name) for name in (ROBOT, "aloha-agilex"))
    assert ours.embodiment == ROBOT and ours.objects == theirs.objects
    space = robots.embodiment(ROBOT).action_space("joint")
    assert (space.joints, space.width, space.grippers) == ((6, 7), 15, [6, 14])
    assert space.labels[7] == "right joint 1" and space.labels[13] == "right joint 7"
    assert robots.embodiment(f"piper+{ROBOT}:0.7").action_space("joint").joints == (6, 7)


@pytest.mark.sim
def test_the_simulator_agrees_about_where_its_hands_are(package: Path) -> None:
    from robospa.harness.sim.sapien_world import SapienWorld

    robot, world = robots.embodiment(ROBOT), SapienWorld(render=False)
    world.load(build_scene("Pick_Blocks_Size", 1, 900_000, ROBOT))
    left, right = (0.2, 0.3, 0.8, 0.3, -0.2, 0.4), (-0.2, 0.3, 0.4, 0.8, 0.3, -0.2, 0.4)
    action = np.array([*left, 1.0, *right, 1.0], np.float32)
    world.step(action, "joint", lambda _: False)
    now = world.snapshot()
    rows = zip(robot.arms, now.end_effector, now.measured, now.grasp_points, strict=True)
    for arm, end, measured, point in rows:
        ours = end_effector(chain_of(arm), measured)
        assert end.position == pytest.approx(ours.position, abs=1e-4)
        assert point == pytest.approx(ours.apply((arm.gripper.grasp_centre, 0, 0)), abs=1e-4)


@pytest.mark.sim
def test_a_policy_learns_of_its_joints_and_drives_it(package: Path) -> None:
    from robospa.baselines.random import Random
    from robospa.harness.sim.sapien_world import SapienWorld
    from robospa.harness.trial import run_trial

    seen: list[TrialInfo] = []

    class Watched(Random):
        def reset(self, trial: TrialInfo) -> None:
            seen.append(trial)
            super().reset(trial)

    key, world = TrialKey("Pick_Blocks_Size", 1, 100_000, ROBOT), SapienWorld(render=False)
    record = run_trial(world, Watched(), key, policy_seed=1, step_scale=0.02)
    assert (seen[0].embodiment, seen[0].joints) == (ROBOT, (6, 7))
    assert record.end == "step_limit" and record.steps > 0


# --- a scene mode -----------------------------------------------------------------------------


def test_the_same_objects_stand_on_a_lower_table_that_differs_by_seed(package: Path) -> None:
    rises = []
    for seed in range(40):
        clean, scene = (
            build_scene("Stack_Blocks_Size_Order", 3, seed, mode=m) for m in ("clean", MODE)
        )
        assert scene == build_scene("Stack_Blocks_Size_Order", 3, seed, mode=MODE)
        assert Scene.from_json(scene.to_json()) == scene
        assert "table_rise" not in clean.to_json() and scene.facts == clean.facts
        assert scene.table_top == TABLE_TOP + scene.table_rise
        for a, b in zip(scene.objects, clean.objects, strict=True):
            assert a.pose.rotation == b.pose.rotation and a.params == b.params
            lower = np.subtract(a.pose.position, b.pose.position)
            assert lower == pytest.approx((0.0, 0.0, scene.table_rise), abs=1e-12)
        rises.append(scene.table_rise)
    assert len(set(rises)) == 40 and -0.03 <= min(rises) < -0.025 and -0.005 < max(rises) <= 0


def test_what_stands_on_the_floor_is_lowered_too(package: Path) -> None:
    """A bin that is nearly as high as the table would else stick out beside it."""
    scene = build_scene("Put_Bottles_Dustbin", 1, 0, mode=MODE)
    assert scene.object(scene.facts["dustbin"]).pose.position[2] == scene.table_rise


SOLVED: tuple[tuple[str, int, dict[str, Any]], ...] = (
    (TASK, 1, {}),
    (TASK, 5, {}),
    ("Pick_Blocks_Size", 1, {"embodiment": ROBOT}),
    ("Lift_Pot_Repeat", 1, {"embodiment": ROBOT}),
    ("Hang_Mug_Stack_Blocks", 2, {"mode": MODE}),
    ("Remember_Color_Cover", 2, {"mode": MODE}),
    ("Click_Can_Place_Items", 4, {"mode": MODE}),
    ("Put_Bottles_Dustbin", 2, {"mode": MODE}),
)


@pytest.mark.sim
@pytest.mark.parametrize(("task", "level", "where"), SOLVED)
def test_the_expert_solves_trials_with_them(
    package: Path, task: str, level: int, where: dict[str, Any]
) -> None:
    from robospa.harness.factory import policy_factory
    from robospa.harness.seeds.attempt import ORACLE
    from robospa.harness.sim.sapien_world import SapienWorld
    from robospa.harness.trial import run_trial

    seed = 500_000 if task == TASK else 100_000
    world, expert = SapienWorld(render=False), policy_factory(ORACLE)()
    record = run_trial(world, expert, TrialKey(task, level, seed, **where), policy_seed=0)
    assert record.success, record


# --- a dialect --------------------------------------------------------------------------------


@pytest.fixture
def acme(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[str]:
    """Address of the made-up server, whose dialect is installed as its own project says."""
    folder = EXAMPLES / "acme_dialect"
    project = tomllib.loads((folder / "pyproject.toml").read_text())["project"]
    monkeypatch.syspath_prepend(installed(tmp_path, project["entry-points"]))
    monkeypatch.syspath_prepend(folder)
    server = ThreadingHTTPServer(("127.0.0.1", 0), import_module("acme_server").Acme)
    server.daemon_threads = True
    with serving(server):
        yield f"acme+http://127.0.0.1:{server.server_port}"


def test_a_policy_behind_the_dialect_answers_in_our_units(acme: str) -> None:
    with connect(f"{acme}?execute=2", timeouts=QUICK) as policy:
        assert policy.dialect == "acme"
        assert (policy.spec.horizon, policy.spec.execute) == (None, 2)
        policy.reset(TRIAL)
        chunk = policy.infer(observation())
        policy.end({"success": True})
    wanted = STATE.copy()
    wanted[[6, 13]] = 1.0
    assert np.allclose(chunk, np.tile(wanted, (5, 1)))
    results = check(acme, timeouts=QUICK, connector=lambda: connect(acme, timeouts=QUICK))
    assert [result for result in results if result.passed is False] == []


def test_its_options_are_checked_and_other_dialects_name_it(acme: str) -> None:
    with pytest.raises(ValueError, match="at most the horizon"):
        check_options("acme+http://gpu?horizon=20&execute=21")
    with pytest.raises(ValueError, match=r"acme\+http://"):
        check_options("nothing://gpu")
    for scheme in ("go1+http", "ws", "xpolicylab"):
        with pytest.raises(HandshakeError, match=re.escape(f"try {acme}")):
            connect(f"{scheme}{acme.removeprefix('acme+http')}", timeouts=QUICK)


def test_its_page_prints_the_example() -> None:
    page = (PAGES / "adding-a-dialect.md").read_text()
    folder = EXAMPLES / "acme_dialect"
    source = (folder / "acme_robospa" / "client.py").read_text()
    blocks = re.findall(r"```python\n(.*?)```", page, re.S)
    assert blocks and [block for block in blocks if block not in source] == []
    (entry,) = re.findall(r"```toml\n(.*?)```", page, re.S)
    assert entry in (folder / "pyproject.toml").read_text()


def test_a_dialect_that_cannot_be_loaded_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    entries = {"robospa.dialects": {"bad": "no_such_module:X"}}
    monkeypatch.syspath_prepend(installed(tmp_path, entries))
    with pytest.warns(UserWarning, match="'bad' is left out"):
        assert "ws" in [dialect.scheme for dialect in dialects()]
