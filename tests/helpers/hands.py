"""Hands that do as told, right or wrong: a `Teleport` with the moves that mistakes are made of.

Nothing is simulated: an object is where a hand has put it, and a touch is a claimed contact.
"""

from dataclasses import replace
from typing import Any

from snapshots_by_hand import AWAY
from teleport import Teleport, mix

from robospa.action_space import ARMS
from robospa.geometry import Pose, Vec3
from robospa.tasks.catalog import task
from robospa.tasks.events import Outcome, outcome
from robospa.tasks.plan import Hit, Pick, RaiseLower
from robospa.tasks.snapshot import Contact

Place = tuple[float, float] | Vec3


class Hands(Teleport):
    """Two hands in `scene`; objects are named by the fact that names them, "order 1" its second."""

    @property
    def outcome(self) -> Outcome:
        """Success and progress so far."""
        return outcome(self.events, self.tracker.total)

    def named(self, fact: str) -> str:
        """The object that a fact names."""
        key, _, index = fact.partition(" ")
        value: Any = self.scene.facts[key]
        return str(value[int(index)] if index else value)

    def at(self, fact: str) -> Vec3:
        """Where an object's origin is."""
        return self.poses[self.named(fact)].position

    def point(self, fact: str, frame: str) -> Vec3:
        """Where a frame of an object is."""
        return self.frame(self.named(fact), frame).position

    def _side(self, fact: str, arm: str | None) -> int:
        return ARMS.index(arm) if arm else int(self.at(fact)[0] > 0)

    def plan(self, *steps: int, after: int = 0) -> None:
        """The calls of the task's plan with these indices, else all from `after` on."""
        calls = task(self.scene.task).plan(self.scene)
        for call in [calls[i] for i in steps] if steps else calls[after:]:
            self.do(call)

    def finish(self) -> None:
        """Open both hands, take them away, wait."""
        for arm in (0, 1):
            self._let_go(arm)
        self.tick(30)

    def grip(self, arm: str, opening: float) -> None:
        """Command a gripper where it is, away from everything."""
        self.gripper[ARMS.index(arm)] = opening
        self.tick(3)

    def touch(
        self,
        fact: str,
        times: int = 1,
        arm: str | None = None,
        closed: bool = True,
        pushing: bool = True,
        apart: float = 0.3,
        off: Vec3 = (0.0, 0.0, 0.0),
        with_body: str = "",
    ) -> None:
        """Finger contacts at the "touched" frame (shifted by `off`), `apart` [s] between them.

        The simulator reports a finger that hovers up to 2 cm above as one that does not push.
        """
        x, y, z = self.point(fact, "touched")
        hand = self._side(fact, arm)
        self.gripper[hand] = 0.0 if closed else 1.0
        point = (x + off[0], y + off[1], z + off[2])
        body = with_body or f"{ARMS[hand]}_gripper"
        for _ in range(times):
            self.tick(4, [Contact(self.named(fact), body, point, pushing)])
            self.tick(round(apart / 0.02))

    def touch_both(self) -> None:
        """One hand touches "order 1" and stays there while the other one clicks "order 0"."""
        marks = []
        for fact in ("order 1", "order 0"):
            hand = self._side(fact, None)
            self.gripper[hand] = 0.0
            name, point = self.named(fact), self.point(fact, "touched")
            marks.append(Contact(name, f"{ARMS[hand]}_gripper", point))
            self.tick(4, marks)
        self.tick(4, marks)

    def take(
        self, fact: str, rise: float = 0.08, arm: str | None = None, grip: float = 0.1
    ) -> None:
        """Close a hand around an object and lift it."""
        name = self.named(fact)
        hand = self._side(fact, arm)
        x, y, z = self.at(fact)
        self._pick(Pick(name, 0.001, ARMS[hand]))
        self.gripper[hand] = grip
        self._carry(name, hand, (x, y, z + rise))

    def carry(self, fact: str, to: Place, arm: str | None = None) -> None:
        """Bring a held object over a place and down to it, to its first height if none is given."""
        name, hand = self.named(fact), self._side(fact, arm)
        down = to[2] if len(to) == 3 else self.scene.object(name).pose.position[2]
        self._carry(name, hand, (to[0], to[1], self.at(fact)[2]))
        self._carry(name, hand, (to[0], to[1], down))

    def move(
        self, fact: str, to: Place, arm: str | None = None, held: bool = False, turn: Any = None
    ) -> None:
        """Take an object, bring it to a place, let go of it unless it stays `held`."""
        hand = self._side(fact, arm)
        self.take(fact, arm=ARMS[hand])
        if turn is not None:
            self.poses[self.named(fact)] = Pose(self.at(fact), turn)
        self.carry(fact, to, ARMS[hand])
        if not held:
            self._let_go(hand)

    def move_by(self, fact: str, dx: float, dy: float, dz: float = 0.0, held: bool = False) -> None:
        """`move` by so much from where it is."""
        x, y, z = self.at(fact)
        self.move(fact, (x + dx, y + dy, z + dz), held=held)

    def onto(self, fact: str, target: str, frame: str = "support", dx: float = 0.0) -> None:
        """`move` to the frame of another object, or so far to its right."""
        x, y, z = self.point(target, frame)
        self.move(fact, (x + dx, y, z - self.models[self.named(fact)].bottom))

    def over(self, fact: str, target: str, frame: str = "support", dz: float = 0.1) -> None:
        """Hold an object above the frame of another one."""
        x, y, z = self.point(target, frame)
        self.move(fact, (x, y, z + dz), held=True)

    def raise_thrice(self, fact: str, rise: float) -> None:
        """Lift an object and lower it to where it was, three times, never letting go."""
        x, y, z = self.at(fact)
        hand, name = self._side(fact, None), self.named(fact)
        self.take(fact, 0.01)
        for _ in range(3):
            self._carry(name, hand, (x, y, z + rise))
            self.tick(3)
            self._carry(name, hand, (x, y, z))

    def wait(self, seconds: float) -> None:
        """Do nothing."""
        self.tick(round(seconds / 0.02))

    def stir(self, by: float) -> None:
        """Move the left hand to the side and back."""
        x, y, z = AWAY[0]
        self.grasp[0] = (x + by, y, z)
        self.tick(5)
        self.grasp[0] = AWAY[0]
        self.tick(5)

    def lay(self, fact: str, at: Vec3) -> None:
        """An object gets somewhere without a hand: it fell, or something pushed it."""
        name = self.named(fact)
        self.poses[name] = Pose(at, self.poses[name].rotation)
        self.tick(5)

    def lay_by(self, fact: str, dy: float = 0.0, dz: float = 0.0) -> None:
        """`lay` an object farther away or nearer, or higher."""
        x, y, z = self.at(fact)
        self.lay(fact, (x, y + dy, z + dz))

    def fly(self, fact: str, start: Vec3, end: Vec3) -> None:
        """An object falls from one place to the other, at 2 m/s."""
        name = self.named(fact)
        steps = max(2, round(abs(start[2] - end[2]) / 0.04))
        for i in range(steps + 1):
            self.poses[name] = Pose(mix(start, end, i / steps), self.poses[name].rotation)
            self.tick()
        self.tick(5)

    def _other(self) -> str:
        """An object that is not the target."""
        target = self.named("target")
        return next(o.name for o in self.scene.objects if o.name != target and not o.fixed)

    def click_lifted(self, other: bool = False) -> None:
        """A contact of the left gripper with the target, or with an `other` object."""
        name = self._other() if other else self.named("target")
        self.tick(2, [Contact(name, "left_gripper", self.poses[name].position)])

    def plan_cycles(self, times: int) -> None:
        """The plan's lifting, but only so many times."""
        (call,) = task(self.scene.task).plan(self.scene)
        assert isinstance(call, RaiseLower)
        self.do(replace(call, times=times))

    def hit(self, *order: int) -> None:
        """The tool on these targets, one after the other."""
        (call,) = task(self.scene.task).plan(self.scene)
        assert isinstance(call, Hit)
        self.do(replace(call, targets=tuple(call.targets[i] for i in order)))

    def tower(
        self,
        at: tuple[float, float],
        order: tuple[int, ...] = (0, 1, 2),
        held: bool = False,
        step: float = 0.0,
    ) -> None:
        """The blocks of fact "order" on top of each other, each `step` farther right.

        The last one may stay `held`.
        """
        top = self.scene.table_top
        for k, i in enumerate(order):
            half = float(self.scene.object(self.named(f"order {i}")).params["half"][2])
            last = held and k == len(order) - 1
            self.move(f"order {i}", (at[0] + k * step, at[1], top + half), held=last)
            top += 2 * half
        if not held:
            self.finish()

    def line(
        self,
        xs: tuple[float, ...],
        ys: tuple[float, ...] = (0.0, 0.0),
        held: bool = False,
        arm: str | None = None,
    ) -> None:
        """The blocks of fact "order" in a row at y = -0.15 plus `ys`; the last may stay `held`."""
        for i, (x, y) in enumerate(zip(xs, ys, strict=True)):
            self.move(f"order {i}", (x, y - 0.15), arm, held=held and i == len(xs) - 1)
        self.tick(5)

    def take_other(self, rise: float, back: bool = False) -> None:
        """The right hand lifts an object that is not the target, and puts it `back` or keeps it."""
        name = self._other()
        x, y, z = self.poses[name].position
        self._pick(Pick(name, rise, "right"))
        if back:
            self._carry(name, 1, (x, y, z))
            self._let_go(1)

    def hang(self, held: bool = False) -> None:
        """The mug's handle at the peg's place."""
        (x, y, z), (hx, hy, hz) = self.point("rack", "hang"), self.point("mug", "handle")
        self.move_by("mug", x - hx, y - hy, z - hz, held=held)

    def serve(self) -> None:
        """Burger and fries on their halves of the tray."""
        self.onto("burger", "tray", "left")
        self.onto("fries", "tray", "right")

    def door(self, angle: float) -> None:
        """The microwave's door gets to so many radians by itself."""
        self.hinges[self.named("microwave")] = angle
        self.tick(5)

    def beside(self, fact: str, other: str, dx: float) -> None:
        """Put an object down so far to the right of another one."""
        x, y, _ = self.at(other)
        self.move(fact, (x + dx, y))

    def stamp(self, side: str, times: int) -> None:
        """The seal of that side comes down on its pad and is raised by 5 cm, again and again."""
        seal, pad = f"{side}_seal", f"{side}_pad"
        for _ in range(times):
            self.onto(seal, pad)
            self.move_by(seal, 0.0, 0.0, 0.05)
