"""A playback shows what the world did: poses of its bodies, and the trial that was recorded."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from film_fakes import KEYS, recorded
from run_fakes import FakeWorld, parts

from robospa.geometry import Pose
from robospa.harness.replay import ReplayError
from robospa.harness.running.manifest import this_processor, write_manifest
from robospa.harness.viewer.show import PoseRecorder, recorded_playback
from robospa.results.records.manifest import RunAbout, RunSettings, make_manifest


class Posed(FakeWorld):
    """A fake world that tells where its only body is: as high as it is late."""

    def bodies(self) -> dict[str, Pose]:
        return {"block": Pose((0.0, 0.0, self.snapshot().time))}


def test_a_recorded_trial_is_played_again_and_seen(tmp_path: Path) -> None:
    record = recorded(tmp_path / "run", KEYS[0])
    played = recorded_playback(Posed(), record, tmp_path / "run", parts=parts)
    assert [frame["block"].position[2] for frame in played.frames] == list(played.times)
    assert played.times[0] == 0.0
    assert len(played.times) > 1
    assert played.instruction == record.instruction


def test_ten_frames_a_second_are_kept() -> None:
    recorder, world = PoseRecorder(), Posed()
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
            recorded_playback(Posed(), record, tmp_path / "run", parts=parts)
    for claim, words in ((record, "state"), (replace(record, success=False), "success")):
        with pytest.raises(ReplayError, match=f"another {words}"):
            recorded_playback(Posed(), claim, tmp_path / "run", parts=parts)


def test_a_world_that_does_not_tell_where_its_bodies_are_is_refused(tmp_path: Path) -> None:
    record = recorded(tmp_path / "run", KEYS[0])
    with pytest.raises(TypeError, match="FakeWorld does not tell"):
        recorded_playback(FakeWorld(), record, tmp_path / "run", parts=parts)


@pytest.mark.sim
def test_the_simulator_tells_where_links_objects_and_doors_are() -> None:
    from robospa.harness.robots import embodiment
    from robospa.harness.sim.sapien_world import SapienWorld
    from robospa.harness.viewer.playback import drawn_bodies
    from robospa.tasks.catalog import build_scene

    scene = build_scene("Click_Bell_Open_Microwave_Place_Object", 3, 100000)
    robot = embodiment(scene.embodiment)
    world = SapienWorld(render=False)
    world.load(scene)
    seen, snapshot = world.bodies(), world.snapshot()
    assert {name: seen[name] for name in snapshot.poses} == dict(snapshot.poses)
    moving = {body.name for body in drawn_bodies(scene, robot) if body.pose is None}
    assert moving <= seen.keys()
    for a, (side, arm) in enumerate(zip(("left", "right"), robot.arms, strict=True)):
        tool = seen[f"{side} {arm.last_link}"] * arm.tool
        assert tool.position == pytest.approx(snapshot.end_effector[a].position, abs=1e-6)
    ((oven, angle),) = snapshot.hinges.items()
    assert abs(angle) < 0.01
    assert seen[f"{oven} part"].position == pytest.approx(seen[oven].position, abs=0.005)
    world.close()
