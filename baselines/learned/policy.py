"""The learned policy: looks when its arms are out of the way, decides a step, performs it.

Memory is two things: all objects that were ever seen, as they were at first, and the steps done. A
step that did not do what it should is done again.

    robospa serve learned
    robospa serve learned --option eyes=no
    robospa serve learned --option action=skill

Without eyes it is told of the objects as numbers, and privileged: the same networks but for those
that see. So both rows side by side tell what cannot be seen from what cannot be learned.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from robospa.baselines.learned import act, steps
from robospa.baselines.learned.act import Belief, Rows
from robospa.baselines.learned.steps import Seen, State, Step, after
from robospa.extras import need
from robospa.harness.robots import embodiment
from robospa.harness.robots.embodiment import Embodiment
from robospa.harness.skills.expert import Expert
from robospa.observation import CameraSpec, Observation
from robospa.protocol.options import option
from robospa.protocol.policy import POINT, SKILL, PolicySpec, TrialInfo
from robospa.tasks import plan as calls
from robospa.workcell import HEIGHT, TABLE_TOP, WIDTH

Look = Callable[[Observation], list[Seen]]
"""What is seen in an observation."""
Call = dict[str, object]
"""A call of a skill (`robospa.protocol.calls`)."""
Answer = Rows | list[Call]
"""Actions (T, D), or calls."""
INSIDE = (0.5, 0.3, 2.0)
"""Where a bin beside the table is pointed at, of which the far side of its mouth is seen: in halves
of its box from the middle of its underside."""
NAMES = {"raiselower": "raise_lower"}
Decide = Callable[[State, str], Step]
"""The next step, from all that is known and the sentence."""
REPEATED: dict[str, dict[str, Any]]
REPEATED = {"press": {"object": None}, "hit": {"destination": None}, "lift": {}, "stamp": {}}
"""Steps of which several are done in one go, between which nothing is to be seen, and in what these
may differ."""
AT_ONCE, TRIES = 30, 3
IDLE = 10
"""Actions of an answer that holds still, where nothing more is to be done."""
OFF = {"move": 0.025, "back": 0.025, "dock": 0.05, "hang": 0.06, "drop": 0.3, "turn": 0.6}
"""How far [m; of a turn by quarters: rad] from its place something may seem after a step of a type,
in a bin whatever its height."""


class Learned:
    """A policy from what it sees and the sentence; one per connection."""

    def __init__(self, spec: PolicySpec, look: Look, decide: Decide) -> None:
        self.spec, self._look, self._decide = spec, look, decide
        self._robot: Embodiment | None = None

    def reset(self, trial: TrialInfo) -> None:
        """Forget the trial before."""
        self._robot = embodiment(trial.embodiment)
        self._sentence = trial.instruction
        self.belief: Belief | None = None
        self._expert: Expert | None = None
        self._steps: list[Step] = []
        self._tries = 0
        self._answer: Any = None

    def infer(self, observation: Observation) -> Answer:
        """The next actions, float32 (T, D), or the calls of the next steps."""
        if self._robot is None:
            raise RuntimeError("the policy was asked for actions before a reset")
        if self.belief is None:
            self.belief = Belief(self._robot, self._look(observation), observation["state"])
        else:
            self._take_over(self.belief, observation)
        self._answer = answer = self._next(self.belief, observation)
        return answer

    def _take_over(self, belief: Belief, observation: Observation) -> None:
        """What came of the last answer."""
        belief.advance(self._answer, self._steps[0].object, observation)
        if belief.out_of_the_way():
            belief.look(self._look(observation), self._steps[0].type == "wait")

    def _next(self, belief: Belief, observation: Observation) -> Answer:
        while self._expert is not None or (found := self._decided(belief)):
            if self._expert is None:
                self._expert = Expert(self._scene, belief.snapshot(observation, self._scene), found)
                held = [None if hold is None else str(hold.number) for hold in belief.held]
                self._expert.workspace.held = held
            rows = self._expert.next(belief.snapshot(observation, self._scene))
            if not self._expert.finished:
                return rows
            self._end(belief, self._expert.failures)
            self._expert = None
        return np.repeat(belief.last[None], IDLE, axis=0)

    def _decided(self, belief: Belief) -> list[object]:
        """What is done next, in a plan's calls: new steps, or those that failed once more."""
        if self._tries == 0 or not all(act.possible(step, belief.state) for step in self._steps):
            self._tries, self._steps = 0, self._chain(belief.state)  # what it was about is gone
        self._scene = belief.scene()
        return act.calls_of(self._steps, belief.state, self._scene)

    def _chain(self, state: State) -> list[Step]:
        """The next step, and those that are done in one go with it."""
        chain = [first := self._decided_step(state)]
        while (loose := REPEATED.get(first.type)) is not None and len(chain) < AT_ONCE:
            state = after(state, chain[-1])
            more = self._decided_step(state)
            if replace(more, **loose) != replace(first, **loose):
                break
            chain.append(more)
        return chain

    def _decided_step(self, state: State) -> Step:
        """The next step; done where that is nothing that can be tried, and after a pick: whoever is
        asked to pick is asked for nothing else."""
        picked = bool(state.done) and state.done[-1].type == "pick"
        step = Step("done") if picked else self._decide(state, self._sentence)
        return step if act.possible(step, state) else Step("done")

    def _end(self, belief: Belief, failures: Sequence[str]) -> None:
        """Note what came of the steps; try again what failed."""
        failed = "; ".join(filter(None, (self._missed(belief, self._steps[0]), *failures)))
        self._tries += 1
        if failed and self._tries < TRIES:
            return
        self._tries = 0
        counted = belief.state
        for step in self._steps:
            counted = after(counted, step)
        pairs = zip(belief.state.objects, counted.objects, strict=True)
        items = (replace(now, acts=then.acts, goals=then.goals) for now, then in pairs)
        belief.state = State(tuple(items), counted.done)

    def _missed(self, belief: Belief, step: Step) -> str:
        """What of the step did not come out; "" if all of it did."""
        if step.object is None:
            return ""
        state = belief.state
        item, want = state.objects[step.object], after(state, step).objects[step.object].now
        if step.type == "pick":
            held = any(hold is not None and hold.number == step.object for hold in belief.held)
            return "" if held else "not held"
        if step.type not in OFF or not item.visible:
            return ""
        off = math.dist(*(one.place[: 2 if step.type == "drop" else 3] for one in (item.now, want)))
        if step.type == "turn":
            off = abs(math.remainder(item.now.turn - want.turn, 2 * math.pi))
        return "" if off < OFF[step.type] else f"{off:.3f} off"


class LearnedCalls(Learned):
    """The same in calls of skills, which point at what it sees: it decides, and does not act."""

    def _next(self, belief: Belief, observation: Observation) -> Answer:
        found = in_points(self._decided(belief), belief.state)
        if self.spec.action == POINT:
            at = [call["at"] for call in found if "at" in call] or [(0.5, 0.5)]
            return [{"skill": POINT, "at": at[0]}]
        return found or [{"skill": "done"}]

    def _take_over(self, belief: Belief, observation: Observation) -> None:
        """What came of the calls of the last answer, by their feedback and by what is seen."""
        said = observation["calls"][-len(self._answer) :]
        failures = [str(call["feedback"]) for call in said if call["feedback"] != "done"]
        before = state = belief.state
        for step in self._steps if not failures else ():
            state = after(state, step)
        for number, (old, new) in enumerate(zip(before.objects, state.objects, strict=True)):
            if old.now != new.now:
                belief.put(number, steps.pose_of(new.now))
        belief.look(self._look(observation), self._steps[0].type == "wait")
        self._end(belief, failures)

    def _missed(self, belief: Belief, step: Step) -> str:
        return "" if step.type == "pick" else super()._missed(belief, step)


def in_points(found: Sequence[object], state: State) -> list[Call]:
    """A plan's calls on objects named by number as calls at the pixels where these are seen."""
    things = {str(number): item.now for number, item in enumerate(state.objects)}
    lies, said = dict(things), list[Call]()

    def at(name: str) -> tuple[float, float]:
        one = things[name]
        u, v = steps.pixel(one, steps.MIDDLE if one.place[2] > TABLE_TOP - 0.1 else INSIDE)
        return min(max(u / WIDTH, 0), 1), min(max(v / HEIGHT, 0), 1)

    for call in found:
        given, (own, goals) = vars(call), steps.named(call)
        name = type(call).__name__.lower()
        one: Call = {"skill": NAMES.get(name, name)}
        one |= {key: given[key] for key in ("arm", "arms", "seconds", "times") if given.get(key)}
        points = [at(goal) for goal in goals if goal]
        if own:
            one["at"] = at(own)
        if points:
            put = isinstance(call, calls.Place | calls.Drop)
            one |= {"at": points[0]} if put else {"to": points}
        if isinstance(call, calls.Place):
            one["height"] = call.drop
            if call.on is None:  # beside where it lies
                (x, y, z), turn = lies[call.object].place, lies[call.object].turn
                one["offset"] = (call.position[0] - x, call.position[1] - y)
                if call.yaw is not None:
                    one["turn"] = math.degrees(math.remainder(call.yaw - turn, 2 * math.pi))
                    turn = call.yaw
                now = (*call.position[:2], z)
                lies[call.object] = replace(lies[call.object], place=now, turn=turn)
        said.append(one)
    return said


@dataclass(frozen=True)
class LearnedOptions:
    """What is served, and whether it sees."""

    path: str = option("", "folder of weights of robospa learn; empty for those that are shipped")
    eyes: bool = option(True, "no: told of the objects as numbers (privileged)")
    action: str = option("joint", "skill or point: at what it sees", ("joint", SKILL, POINT))


class Learners:
    """Makes a policy for each connection; all share the networks."""

    def __init__(self, options: LearnedOptions) -> None:
        """Raises FileNotFoundError for a folder without weights."""
        folder = Path(options.path).expanduser() if options.path else steps.WEIGHTS
        if not folder.is_dir() or not any(folder.iterdir()):
            raise FileNotFoundError(f"{folder} has no weights: robospa learn {folder} makes some")
        torch = need("torch")
        from robospa.baselines.learned import perceive, point

        torch.set_num_threads(1)  # so that neighbours on the machine change nothing
        files = [path.read_bytes() for path in sorted(folder.glob("*.npz"))]
        self._decide: Decide = point.Pointer(folder).next_step
        self._look: Look = act.told
        if options.eyes:
            eyes = perceive.Perceiver(folder)
            self._look = lambda observation: eyes.look(observation["images"]["head"])
        self._kind = Learned if options.action == "joint" else LearnedCalls
        self.spec = PolicySpec(
            "learned" if options.eyes else "learned:eyes-off",
            action=options.action,
            cameras=(CameraSpec("head"),) if options.eyes else (),
            state="measured",
            seeded=True,
            environment_state=not options.eyes,
            checkpoint=hashlib.sha256(b"".join(files)).hexdigest()[:16],
            contract=("normalisation=in the checkpoint", "dtype=float32", "actions=keyframes"),
        )

    def __call__(self) -> Learned:
        """A policy for one connection."""
        return self._kind(self.spec, self._look, self._decide)
