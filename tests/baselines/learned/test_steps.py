"""Plans read as steps: every plan can be, and its states are where physics leads."""

import math

import pytest

from robospa.baselines.learned.act import told
from robospa.baselines.learned.steps import KINDS, TYPES, Step, labelled, model, pose_of, seen_at
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.skills import Expert
from robospa.protocol.policy import PolicySpec
from robospa.tasks.catalog import build_scene, tasks
from robospa.tasks.objects import model_of

SEED = 1_500_000
NAMED = [n for n, one in tasks().items() if one.dimension == "procedural" or "Size" in n]


@pytest.mark.parametrize("level", (1, 5))
def test_every_plan_reads_as_steps(level: int) -> None:
    for name in NAMED:
        scene = build_scene(name, level, SEED)
        states = labelled(scene)
        assert states[-1][1] == Step("done") and len(states) > 1
        for i, (state, step) in enumerate(states):
            assert len(state.done) == i and step.type in TYPES
            named = [n for n in (step.object, step.destination) if n is not None]
            assert all(state.objects[n].now.kind in KINDS for n in named), (name, step)
        last = states[-1][0]
        assert len(last.objects) == len(scene.objects)
        assert sum(o.acts for o in last.objects) == sum(s.object is not None for s in last.done)


def test_a_thing_put_to_two_places_is_two_steps_and_handed_over_one() -> None:
    def types(name: str, level: int) -> list[str]:
        return [step.type for _, step in labelled(build_scene(name, level, SEED))]

    assert types("Put_Bottles_Dustbin", 5) == ["drop"] * 5 + ["done"]
    assert types("Remember_Orientation_Restore", 2) == ["wait", "turn", "turn", "done"]
    assert types("Place_Object_Scale_Click", 5)[-3:] == ["back", "back", "done"]
    assert types("Stamp_Seals_Order", 3) == ["move"] * 3 + ["done"]


def test_what_covers_and_walls_hide_is_not_visible() -> None:
    states = [state for state, _ in labelled(build_scene("Remember_Color_Cover", 3, SEED))]
    seen = [sum(o.visible for o in state.objects if o.now.kind == "block") for state in states]
    assert seen == [3, 0, 1, 2, 3]
    last = labelled(build_scene("Observe_Objects_Click_Memory", 2, SEED))[-1][0]
    assert all(o.visible is (o.first.place[1] < 0.06) for o in last.objects)


def test_what_is_seen_is_imagined_as_it_is() -> None:
    for name in ("Pick_Mugs_Distance", "Stack_Blocks_Size_Order", "Remember_Orientation_Restore"):
        for item in build_scene(name, 3, SEED).objects:
            seen = seen_at(item.asset, model_of(item), item.pose)
            assert model(seen).size == pytest.approx(model_of(item).size)
            assert pose_of(seen).position == pytest.approx(item.pose.position)


@pytest.mark.sim
@pytest.mark.parametrize(
    "name", ["Stack_Blocks_Size_Order", "Place_Bowls_Plates", "Place_Burger_Fries_Click_Bell"]
)
def test_states_are_where_physics_leads(name: str) -> None:
    scene, world = build_scene(name, 4, SEED), SapienWorld(render=False)
    world.load(scene)
    expert = Expert(scene, world.snapshot())
    while not expert.finished:
        for row in expert.next(world.snapshot()):
            world.step(row, "joint", lambda _: False)
    seen = told(world.observe(PolicySpec("eyes", (), environment_state=True)))
    for item in labelled(scene)[-1][0].objects:
        near = min(
            math.dist(item.now.place, one.place) for one in seen if one.kind == item.now.kind
        )
        assert near < 0.02, item.now.kind
