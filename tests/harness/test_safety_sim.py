"""What a replay measures, in the real simulator: of the expert, and of things that are moved."""

import io
from pathlib import Path

import numpy as np
import pytest
from fake_runs import write

from robospa.baselines.oracle import Oracle
from robospa.geometry import Pose
from robospa.harness.running.record_store import ActionRecorder, write_actions
from robospa.harness.safety import SafetyRecorder, measure
from robospa.harness.sim.bodies import to_sapien
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.trial import run_trial
from robospa.protocol.policy import PolicySpec
from robospa.results.records.manifest import RunError
from robospa.results.scoring.safety import SAFETY, excesses, known_safety
from robospa.tasks.catalog import build_scene
from robospa.tasks.snapshot import Snapshot
from robospa.trial import TrialKey

pytestmark = pytest.mark.sim
KEY = TrialKey("Pick_Blocks_Size", 2, 100000)


def test_an_expert_is_measured_from_its_actions_and_once(tmp_path: Path) -> None:
    actions = ActionRecorder()
    record = run_trial(SapienWorld(render=False), Oracle(), KEY, policy_seed=0, recorder=actions)
    world = {"name": "sapien", "arguments": {}}
    spec = {"name": "oracle", "action": "joint"}
    run = write(tmp_path / "run", [record], settings={"world": world, "policy": {"spec": spec}})
    write_actions(run.folder, KEY, actions.actions, "joint")
    said = io.StringIO()
    (found,) = measure(run, said).found.values()
    assert "1/1 trials measured" in said.getvalue()
    assert 5 < found.finger < 140
    assert 0 < found.held < 30
    assert found.arm == found.furniture == found.hits == found.knocks == found.drops == 0
    assert 1 < found.jerk < 100
    assert not excesses(found)
    (run.folder / "actions" / f"{KEY.slug}.npz").unlink()
    assert measure(run).found == known_safety(run) == {KEY: found}
    (run.folder / SAFETY).unlink()
    with pytest.raises(RunError, match="no trial"):
        measure(run, said)
    assert "not measured" in said.getvalue()


def fallen(watched: bool) -> tuple[str, list[float]]:
    """Where all is after a bystander fell from 20 cm above a place 3 cm beside its own, and the
    drops, knocks and hits that were seen."""
    scene = build_scene(*KEY.variant, KEY.seed, KEY.embodiment, KEY.mode)
    name = scene.objects[0].name
    world, recorder = SapienWorld(render=False), SafetyRecorder(KEY.embodiment, frozenset({name}))
    world.load(scene)
    if watched:
        recorder.started(world)
    pose = world.snapshot().poses[name]
    x, y, z = pose.position
    component = world.loaded().moving[name]
    component.entity.pose = to_sapien(Pose((x + 0.03, y, z + 0.2), pose.rotation))
    hold = world.observe(PolicySpec("hold", cameras=()))["state"]

    def poll(snapshot: Snapshot) -> bool:
        if watched:
            recorder.polled(world, snapshot.time)
        return False

    for _ in range(4):
        world.step(np.asarray(hold), "joint", poll)
    if watched:
        recorder.ended(world)
    found = recorder.found("d")
    return world.digest(), [found.drops, found.knocks, found.hits]


def test_what_falls_and_lies_elsewhere_is_seen_and_watching_changes_nothing() -> None:
    (seen, what), (unseen, nothing) = fallen(True), fallen(False)
    assert seen == unseen
    assert (what, nothing) == ([1, 1, 0], [0, 0, 0])
