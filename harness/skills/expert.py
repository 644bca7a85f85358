"""The expert: a task's plan, executed one skill after the other, with feedback after each.

`Expert.next(snapshot)` gives the next actions. A skill that fails is not the end: the plan goes on
with the next object, and what can be done again is done again.
"""

from collections.abc import Callable, Generator, Mapping, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ARMS
from robospa.geometry import Array
from robospa.harness.robots import embodiment
from robospa.harness.skills.bring_in import dock, hang, put_down, slide_out
from robospa.harness.skills.motion import go_home
from robospa.harness.skills.open import pull_open
from robospa.harness.skills.pick import arms_for, pick, raise_lower
from robospa.harness.skills.place import can_follow, drop, place, place_position, pour
from robospa.harness.skills.touch import hit, press, stamp
from robospa.harness.skills.workspace import SkillFailed, Steps, Workspace
from robospa.tasks import plan as calls
from robospa.tasks.catalog import task
from robospa.tasks.scene import Scene
from robospa.tasks.snapshot import Snapshot

HOLD_SECONDS = 0.2
"""An action in which nothing moves takes 50 physics steps of 1/250 s."""
MOVE_ATTEMPTS = 3
PLACED_WITHIN = 0.02
"""A placed object this near to its goal [m] is placed."""
STUCK_ABOVE = 0.04
"""One that is so much higher [m] than its goal hangs on the gripper that let it go."""


SKILLS: Mapping[type, Callable[..., Generator[Array, Snapshot, object]]] = {
    calls.Pick: pick,
    calls.Place: place,
    calls.Drop: drop,
    calls.Press: press,
    calls.Open: pull_open,
    calls.Stamp: stamp,
    calls.Dock: dock,
    calls.Hang: hang,
    calls.Hit: hit,
    calls.Pour: pour,
    calls.RaiseLower: raise_lower,
}
"""What performs each kind of call, from the workspace and the call."""


class Expert:
    """Solves one trial from exact state. Not for comparison with learned policies."""

    def __init__(
        self, scene: Scene, snapshot: Snapshot, plan: Sequence[object] | None = None
    ) -> None:
        self.workspace = Workspace(scene, embodiment(scene.embodiment), snapshot)
        self.failures: list[str] = []
        self.plan_done = False
        """True once no call of the plan is left, only the way home of empty arms."""
        self.finished = False
        """True once that is done, too."""
        self.call: object = None
        """The call of the plan that was begun last: what is being done."""
        self._steps = self._run(task(scene.task).plan(scene) if plan is None else plan)
        self._started = False

    def next(self, snapshot: Snapshot) -> NDArray[np.float32]:
        """The next actions, float32 (T, D); holds still when the plan is over."""
        try:
            if self._started:
                rows = self._steps.send(snapshot)
            else:
                self._started = True
                self.workspace.update_state(snapshot)
                rows = next(self._steps)
        except StopIteration:
            self.finished = True
            self.workspace.update_state(snapshot)
            rows = self.workspace.row()[None]
        return np.asarray(rows, dtype=np.float32)

    def _run(self, plan: Sequence[object]) -> Steps:
        left = list(plan)
        while left:
            self.plan_done = all(isinstance(call, calls.Home) for call in left)
            call = left.pop(0)
            follow = left[0] if left else None
            try:
                if (
                    isinstance(call, calls.Pick)
                    and isinstance(follow, calls.Place | calls.Drop)
                    and follow.object == call.object
                ):
                    left.pop(0)
                    self.call = follow
                    yield from self.move(call, follow)
                else:
                    self.call = call
                    yield from self.perform(call)
            except SkillFailed as error:
                self.failures.append(str(error))
        self.plan_done = True
        ws = self.workspace
        go_home(ws, [arm for arm in range(len(ARMS)) if ws.held[arm] is None])
        yield from ws.flush()

    def perform(self, call: object) -> Steps:
        """The one call; raises SkillFailed."""
        ws = self.workspace
        skill = SKILLS.get(type(call))
        if skill is not None:
            yield from skill(ws, call)
        elif isinstance(call, calls.Wait):
            for _ in range(round(call.seconds / HOLD_SECONDS)):
                ws.add(0)
            yield from ws.flush()
        elif isinstance(call, calls.Home):
            go_home(ws, arms_for(call.arm))
            yield from ws.flush()
        else:
            raise SkillFailed(f"no skill performs {type(call).__name__}")

    def move(self, first: calls.Pick, then: calls.Place | calls.Drop) -> Steps:
        """Pick and place as one: done again while the object is not where it should be."""
        ws = self.workspace
        for left in reversed(range(MOVE_ATTEMPTS)):
            height = ws.pose(first.object).position[2]
            yield from pick(ws, first, partial(can_follow, ws, then))
            arm = ws.held.index(first.object)
            try:
                yield from place(ws, then) if isinstance(then, calls.Place) else drop(ws, then)
            except SkillFailed:  # it turned in the hand: put it down and take it anew
                yield from put_down(ws, arm, height)
                if left == 0:
                    raise
                continue
            if self.arrived(then):
                return
        if isinstance(then, calls.Place) and self._hangs(then):
            yield from slide_out(ws, arm, then.object, place_position(ws, then)[2])

    def _hangs(self, call: calls.Place) -> bool:
        """Whether the object came up again with the gripper that let it go."""
        goal = place_position(self.workspace, call)
        return self.workspace.pose(call.object).position[2] - goal[2] >= STUCK_ABOVE

    def arrived(self, call: calls.Place | calls.Drop) -> bool:
        """Whether the object is where the call puts it."""
        ws = self.workspace
        here = np.array(ws.pose(call.object).position)
        if isinstance(call, calls.Place):
            goal = np.array(place_position(ws, call))
            off = np.abs(here[:2] - goal[:2]).max()
            return bool(off < PLACED_WITHIN and not self._hangs(call))
        bin_pose, model = ws.pose(call.into), ws.models[call.into]
        inside = np.abs(here[:2] - np.array(bin_pose.position[:2])) < np.array(model.size[:2]) / 2
        return bool(inside.all() and here[2] < bin_pose.position[2] + model.size[2])
