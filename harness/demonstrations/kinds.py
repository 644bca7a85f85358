"""Kinds of demonstrations: how each is made, what its frames are labelled, how it is replayed.

    expert        the expert's plan, as it is
    noise         the same, pushed off its way, with the way back (`noise`)
    mistake:NAME  a plan that fails on purpose (`mistakes.KINDS`)
    midstate      one that begins in the middle of the task (`midstates`)

An episode follows from its key and its kind. What a demonstration has commanded is what is
replayed; the action that a learner is shown differs from it where noise was added.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ActionSpace
from robospa.harness.demonstrations.expert_run import (
    Demonstration,
    DemonstrationRun,
    run_expert,
)
from robospa.harness.demonstrations.labels import EXPERT, MISTAKE
from robospa.harness.demonstrations.midstates import MidstateExpert, middle_plan
from robospa.harness.demonstrations.mistakes import FailingExpert, marked, occasions, wrong_plan
from robospa.harness.demonstrations.noise import STRENGTH, Noise
from robospa.harness.demonstrations.recorder import FrameRecorder
from robospa.harness.demonstrations.streams import stream
from robospa.harness.demonstrations.strides import stride_of
from robospa.harness.demonstrations.world import DemonstrationWorld
from robospa.harness.replay import RecordedPolicy
from robospa.harness.robots import embodiment
from robospa.harness.sim.motion import RATE
from robospa.harness.skills import Expert
from robospa.harness.trial import Recorder, TrialParts, run_trial, task_parts
from robospa.harness.world import World
from robospa.results.records.trial_record import TrialRecord
from robospa.tasks.catalog import build_scene
from robospa.tasks.catalog import task as find_task
from robospa.tasks.scene import Scene
from robospa.trial import TrialKey

MISTAKE_PREFIX = "mistake:"
STILL = 10
"""Actions of 0.2 s in which nothing moves, at the end of a mistake."""
GOLDEN = 0.6180339887498949
"""Multiples of it, without their whole parts, fill the range from 0 to 1 evenly, however many."""


@dataclass(frozen=True)
class Shares:
    """Shares of the episodes of a variant that are of another kind than `expert`; ValueError if one
    is negative or their sum is more than 1."""

    noise: float = 0.0
    mistakes: float = 0.0
    midstates: float = 0.0

    def __post_init__(self) -> None:
        parts = (self.noise, self.mistakes, self.midstates)
        if min(parts) < 0 or sum(parts) > 1 + 1e-9:
            raise ValueError(
                f"the shares of noise, mistakes and mid-states are {parts}; give numbers from 0 on "
                "whose sum is at most 1"
            )


@dataclass(frozen=True)
class Shown:
    """A demonstration of some kind; `noise` and `wrong_from` say which frames are whose.

    `prefix_action` (P, D) leads from the trial's start to the first frame.
    """

    kind: str
    demonstration: Demonstration
    space: ActionSpace
    prefix_action: NDArray[np.float32]
    noise: Noise | None = field(default=None, repr=False)
    wrong_from: float | None = None
    """Simulated time [s] from which on the plan is a mistake."""

    def annotate(
        self, commanded: NDArray[np.float32], sim_time: NDArray[np.float64]
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32]]:
        """Labels (T,) and actions (T, D) of frames with `commanded` (T, D) at `sim_time` (T,) [s].

        Labels count in `LABELS`. The last action repeats the last command.
        """
        if self.noise is not None:
            steps = [round(time * RATE) for time in sim_time.tolist()]
            return self.noise.log.annotate(self.space, commanded, steps)
        label = np.full(len(commanded), EXPERT, np.uint8)
        if self.wrong_from is not None:
            label[sim_time >= self.wrong_from - 1e-9] = MISTAKE
        return label, np.concatenate([commanded[1:], commanded[-1:]])


def kind_of(key: TrialKey, shares: Shares) -> str:
    """The kind of the episode `key` in a mixture; `expert` where the scene has no occasion for
    another. Of any run of seeds `shares` are of each kind, as nearly as may be."""
    at = key.seed * GOLDEN % 1.0
    if at < shares.noise:
        return "noise"
    if at < shares.noise + shares.mistakes:
        found = occasions(_scene(key))
        if found:
            chosen = stream(key, "mistake").integers(len(found))
            return f"{MISTAKE_PREFIX}{found[int(chosen)]}"
    elif at < shares.noise + shares.mistakes + shares.midstates:
        try:
            middle_plan(_scene(key), stream(key, "midstate"))
        except ValueError:
            return "expert"
        return "midstate"
    return "expert"


def _scene(key: TrialKey) -> Scene:
    return build_scene(key.task, key.level, key.seed, key.embodiment, key.mode)


def show(
    world: DemonstrationWorld,
    key: TrialKey,
    recorder: Recorder,
    kind: str = "expert",
    parts: Callable[[TrialKey], TrialParts] = task_parts,
    strength: float = STRENGTH,
) -> Shown:
    """Make the demonstration `key` of a kind. `strength` is that of noise [m].

    Raises ValueError for an unknown kind and where the scene has no occasion for it; passes on what
    `world` raises.
    """
    setup = parts(key)
    if kind == "midstate":
        plan = middle_plan(setup.scene, stream(key, "midstate"))
    world.disturbance = None
    world.load(setup.scene, setup.tracker.needs_contacts)
    space = embodiment(key.embodiment).action_space("joint")
    nothing = np.zeros((0, space.width), np.float32)
    if kind == "midstate":
        return _from_the_middle(world, key, setup, recorder, plan)
    run = DemonstrationRun(world, setup, recorder)
    if kind.startswith(MISTAKE_PREFIX):
        made, wrong_from = _go_wrong(run, kind.removeprefix(MISTAKE_PREFIX))
        return Shown(kind, made, space, nothing, wrong_from=wrong_from)
    expert = Expert(setup.scene, world.snapshot())
    if kind == "expert":
        return Shown(kind, run_expert(run, expert), space, nothing)
    if kind != "noise":
        raise ValueError(f"no kind {kind!r}; there are expert, noise, mistake:NAME and midstate")
    noise = Noise(world, expert.workspace, stream(key, "noise"), strength)
    world.disturbance = noise.disturb
    try:
        made = run_expert(run, expert)
    finally:
        world.disturbance = None
    return Shown(kind, made, space, nothing, noise=noise)


def _go_wrong(run: DemonstrationRun, name: str) -> tuple[Demonstration, float]:
    """The mistake `name`, and the time [s] from which on it is made; at its end nothing moves."""
    scene, start = run.setup.scene, run.world.snapshot()
    plan = wrong_plan(name, scene, FailingExpert(scene, start, ()).workspace)
    expert = FailingExpert(scene, start, marked(scene, plan))
    wrong_from: float | None = None
    still = 0
    while not run.has("failed") and still < STILL:
        rows = expert.next(run.world.snapshot())
        if wrong_from is None and expert.went_wrong:
            wrong_from = run.seconds
        alone = len(rows) == 1 and (run.last is None or np.array_equal(rows[0], run.last))
        still = still + 1 if alone or expert.finished else 0
        run.execute(rows)
    return run.ended(expert), run.seconds if wrong_from is None else wrong_from


def _from_the_middle(
    world: World,
    key: TrialKey,
    setup: TrialParts,
    recorder: Recorder,
    plan: tuple[object, ...],
) -> Shown:
    """A demonstration that `recorder` sees from the middle of `plan` on."""
    before = FrameRecorder(stride_of(key.task))
    run = DemonstrationRun(world, setup, before)
    rng = stream(key, "before")
    expert = MidstateExpert(setup.scene, world.snapshot(), plan, rng)
    while not expert.finished and not run.has("failed"):
        rows = expert.next(world.snapshot())
        if expert.begun:
            run.recorder = recorder
            recorder.started(world)
            run.execute(rows)
            break
        run.execute(rows)
    if not expert.begun:
        raise ValueError(f"{key.slug} does not get to its middle: {'; '.join(expert.failures)}")
    made = run_expert(run, expert)
    space = embodiment(key.embodiment).action_space("joint")
    return Shown("midstate", made, space, before.commanded[1:])


def replay(
    world: World,
    key: TrialKey,
    commanded: NDArray[np.float32],
    prefix_action: NDArray[np.float32],
    kind: str,
) -> TrialRecord:
    """The record of a trial that executes what `commanded` (T, D) says, after `prefix_action`.

    The step limit counts from the first frame on. The trial of a mistake ends where its actions do,
    as at a step limit, so that its type of failure can be told; any other has to meet the goal
    within the limit.
    """
    executed = np.concatenate([prefix_action, commanded[1:], commanded[-1:]])
    limit = find_task(key.task).levels[key.level].steps
    allowed = limit + len(prefix_action)
    if kind.startswith(MISTAKE_PREFIX):
        allowed = len(executed)
    return run_trial(
        world, RecordedPolicy(executed, "joint"), key, policy_seed=0, step_scale=allowed / limit
    )
