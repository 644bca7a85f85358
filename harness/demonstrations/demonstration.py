"""Demonstrations of every kind: how each is made, what its frames are labelled, how it is replayed.

    expert        the expert's plan, as it is
    noise         the same, pushed off its way, with the way back (`noise`)
    mistake:NAME  a plan that fails on purpose (`changed_plans.KINDS`)
    midstate      one that begins in the middle of the task (`changed_plans`)

An episode follows from its key and its kind. A demonstration goes on where an evaluation ends, at
the poll that finds the goal met: else the command that leads there would be lacking. It moves as
fast as the official expert does (`DEMONSTRATION_LIMITS`).
"""

import hashlib
from collections.abc import Callable
from contextlib import closing
from dataclasses import asdict, dataclass, field

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ActionSpace, quantize
from robospa.harness import trial
from robospa.harness.convention_check.episodes import Episode, to_jpeg
from robospa.harness.demonstrations import changed_plans
from robospa.harness.demonstrations.noise import EXPERT, MISTAKE, Noise
from robospa.harness.demonstrations.recorder import FrameRecorder, drawn, frame_steps
from robospa.harness.replay import RecordedPolicy
from robospa.harness.robots import embodiment
from robospa.harness.sim.motion import DEMONSTRATION_LIMITS, RATE, Trajectory
from robospa.harness.sim.physics import Physics
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.skills import Expert
from robospa.harness.world import Poll, World
from robospa.observation import DEFAULT_CAMERAS
from robospa.results.records.trial_record import TrialRecord
from robospa.tasks.catalog import build_scene
from robospa.tasks.catalog import task as find_task
from robospa.tasks.events import Event
from robospa.tasks.scene import SUITE, Scene
from robospa.tasks.snapshot import Snapshot
from robospa.trial import TrialKey

Rows = NDArray[np.float32]
"""Joint actions (T, D)."""
REST_ACTIONS = 2
"""Actions of 0.2 s in which nothing moves, at the end."""
STILL = 10
"""The same at the end of a mistake."""
MISTAKE_PREFIX = "mistake:"
GOLDEN = 0.6180339887498949
"""Multiples of it, without their whole parts, fill the range from 0 to 1 evenly, however many."""


class DemonstrationWorld(SapienWorld):
    """A `SapienWorld` that moves at `DEMONSTRATION_LIMITS` and can be disturbed.

    A `disturbance` says what is driven in place of an action's trajectory, in as many physics steps
    and to the same end. Without one it does the same, to the bit. Commands are read as they were
    disturbed.
    """

    def __init__(self, render: bool | None = None) -> None:
        super().__init__(render, limits=DEMONSTRATION_LIMITS)
        self.disturbance: Callable[[Trajectory], Trajectory] | None = None

    def _follow(self, physics: Physics, path: Trajectory, poll: Poll) -> tuple[int, bool]:
        changed = path if self.disturbance is None else self.disturbance(path)
        return super()._follow(physics, changed, poll)


def generator_of(key: TrialKey, purpose: str) -> np.random.Generator:
    """The random generator of `purpose` in the trial `key`: the same for every scene mode and
    sentence, and another one than the scene's own."""
    place = [SUITE, "demonstrations", key.task, str(key.level), str(key.seed), key.embodiment]
    entropy = hashlib.sha256("/".join([*place, purpose]).encode()).digest()[:16]
    return np.random.Generator(np.random.PCG64(int.from_bytes(entropy, "big")))


@dataclass(frozen=True)
class Demonstration:
    """What came of a demonstration: `success` at any time of it, simulated `seconds`, its
    instruction, a sentence for every skill that failed, and the events of goal and grippers until
    the goal was met or lost."""

    success: bool
    seconds: float
    instruction: str
    failures: tuple[str, ...]
    events: tuple[Event, ...] = ()


@dataclass
class DemonstrationRun(trial.TrialState):
    """A trial that goes on when its goal is met or lost; from then on no events are noted."""

    decided: bool = False
    call: object = None
    """What the expert is doing; every call that it begins is noted as an event."""

    def start(self) -> bool:
        self.clutter = None  # it is noted in evaluations alone
        self.decided = super().start()
        return self.decided

    def poll(self, snapshot: Snapshot) -> bool:
        """Update the goal until it is met or lost, keep a frame if one is due, and go on."""
        if not self.decided:
            self.decided = super().poll(snapshot)
        elif self.recorder is not None:
            self.recorder.polled(self.world, snapshot.time)
        return False

    def has(self, kind: str) -> bool:
        return any(event.kind == kind for event in self.events)

    def next(self, expert: Expert) -> Rows:
        rows = expert.next(self.world.snapshot())
        if expert.call is not self.call:
            self.call = expert.call
            name = getattr(self.call, "object", getattr(self.call, "tool", ""))
            began = Event(self.physics_steps / RATE, "began", name, note=type(self.call).__name__)
            self.events.append(began)
            self.event_steps.append(len(self.actions))
        return rows

    def act(self, rows: Rows) -> None:
        for action in quantize(rows):
            self.execute(action, "joint")

    def ended(self, expert: Expert) -> Demonstration:
        if self.recorder is not None:
            self.recorder.ended(self.world)
        return Demonstration(
            self.has("success"),
            self.physics_steps / RATE,
            self.parts.instruction,
            tuple(expert.failures),
            tuple(self.events),
        )


def open_run(
    world: World, key: TrialKey, recorder: trial.Recorder, setup: trial.TrialSetup | None = None
) -> DemonstrationRun:
    """The demonstration of `key`, begun; passes on what `world` raises."""
    setup = setup or trial.task_parts(key)
    run = DemonstrationRun(world, setup, embodiment(key.embodiment), recorder)
    run.load()
    run.start()
    return run


def demonstrate(world: World, key: TrialKey, recorder: trial.Recorder) -> Demonstration:
    """Run the expert on `key`; passes on what `world` raises."""
    run = open_run(world, key, recorder)
    return run_expert(run, Expert(run.parts.scene, world.snapshot()))


def run_expert(run: DemonstrationRun, expert: Expert) -> Demonstration:
    """Run `expert` to its plan's end, then rest.

    Empty arms go home after the plan only where the goal is not met without. A goal that is lost
    ends it.
    """
    while not expert.finished and not run.has("failed"):
        rows = run.next(expert)
        if expert.plan_done:
            if run.actions:
                run.act(np.repeat(run.actions[-1][None], REST_ACTIONS, axis=0))
            if run.has("success"):
                break
        run.act(rows)
    return run.ended(expert)


def recorded_expert(key: TrialKey, name: str) -> tuple[Episode, bool]:
    """The expert's demonstration of `key` with pictures, as an episode called `name` in the layout
    of official recordings, and whether it met the goal."""
    stride = frame_steps(key.task)
    recorder = FrameRecorder(stride)
    pictures: dict[str, list[bytes]] = {camera.name: [] for camera in DEFAULT_CAMERAS}
    with closing(DemonstrationWorld(render=True)) as world:
        made = demonstrate(world, key, recorder)
        for images in drawn(recorder.frames, DEFAULT_CAMERAS):
            for of, image in zip(pictures.values(), images, strict=True):
                of.append(to_jpeg(image))
    commanded, measured, ee, _ = (of.astype(float) for of in recorder.columns())
    space = embodiment(key.embodiment).action_space("joint")
    about = {**asdict(key), "stride": stride}
    seen = Episode(name, commanded, ee, pictures, space, made.instruction, measured, about)
    return seen, made.success


@dataclass(frozen=True)
class ShownEpisode:
    """A demonstration of some kind; `noise` and `wrong_from` say which frames are whose.

    `prefix_action` (P, D) leads from the trial's start to the first frame.
    """

    kind: str
    demonstration: Demonstration
    space: ActionSpace
    prefix_action: Rows
    noise: Noise | None = field(default=None, repr=False)
    wrong_from: float | None = None
    """Simulated time [s] from which on the plan is a mistake."""

    def annotate(
        self, commanded: Rows, sim_time: NDArray[np.float64]
    ) -> tuple[NDArray[np.uint8], Rows]:
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


def kind_of(key: TrialKey, shares: tuple[float, float, float]) -> str:
    """The kind of the episode `key` in a mixture with these `shares` of noise, mistakes and
    mid-states; `expert` where the scene has no occasion for another. Of any run of seeds the shares
    are of each kind, as nearly as may be."""
    noise, mistakes, midstates = shares
    at = key.seed * GOLDEN % 1.0
    if at < noise:
        return "noise"

    def scene() -> Scene:
        return build_scene(key.task, key.level, key.seed, key.embodiment, key.mode)

    if at < noise + mistakes:
        if found := changed_plans.occasions(scene()):
            chosen = generator_of(key, "mistake").integers(len(found))
            return f"{MISTAKE_PREFIX}{found[int(chosen)]}"
    elif at < noise + mistakes + midstates:
        try:
            changed_plans.middle_plan(scene(), generator_of(key, "midstate"))
        except ValueError:
            return "expert"
        return "midstate"
    return "expert"


def show(
    world: DemonstrationWorld,
    key: TrialKey,
    recorder: trial.Recorder,
    kind: str = "expert",
    setup: trial.TrialSetup | None = None,
) -> ShownEpisode:
    """Make the demonstration `key` of a kind. `setup` is the trial's, if it is known.

    Raises ValueError for an unknown kind and where the scene has no occasion for it; passes on what
    `world` raises.
    """
    setup = setup or trial.task_parts(key)
    if kind == "midstate":
        plan = changed_plans.middle_plan(setup.scene, generator_of(key, "midstate"))
    world.disturbance = None
    before = FrameRecorder(frame_steps(key.task))
    run = open_run(world, key, before if kind == "midstate" else recorder, setup)
    space = run.robot.action_space("joint")
    nothing = np.zeros((0, space.width), np.float32)
    if kind == "midstate":
        made = _from_the_middle(run, key, recorder, plan)
        return ShownEpisode(kind, made, space, before.commanded[1:])
    if kind.startswith(MISTAKE_PREFIX):
        made, wrong_from = _go_wrong(run, kind.removeprefix(MISTAKE_PREFIX))
        return ShownEpisode(kind, made, space, nothing, wrong_from=wrong_from)
    expert = Expert(setup.scene, world.snapshot())
    if kind == "expert":
        return ShownEpisode(kind, run_expert(run, expert), space, nothing)
    if kind != "noise":
        raise ValueError(f"no kind {kind!r}; there are expert, noise, mistake:NAME and midstate")
    noise = Noise(world, expert.workspace, generator_of(key, "noise"))
    world.disturbance = noise.disturb
    try:
        made = run_expert(run, expert)
    finally:
        world.disturbance = None
    return ShownEpisode(kind, made, space, nothing, noise=noise)


def _go_wrong(run: DemonstrationRun, name: str) -> tuple[Demonstration, float]:
    """The mistake `name`, and the time [s] from which on it is made; at its end nothing moves."""
    scene, start = run.parts.scene, run.world.snapshot()
    plan = changed_plans.wrong_plan(name, scene)
    expert = changed_plans.ChangedExpert(scene, start, changed_plans.marked(scene, plan))
    wrong_from: float | None = None
    still = 0
    while not run.has("failed") and still < STILL:
        rows = run.next(expert)
        if wrong_from is None and expert.went_wrong:
            wrong_from = run.physics_steps / RATE
        alone = len(rows) == 1 and (not run.actions or np.array_equal(rows[0], run.actions[-1]))
        still = still + 1 if alone or expert.finished else 0
        run.act(rows)
    end = run.physics_steps / RATE
    return run.ended(expert), end if wrong_from is None else wrong_from


def _from_the_middle(
    run: DemonstrationRun, key: TrialKey, recorder: trial.Recorder, plan: tuple[object, ...]
) -> Demonstration:
    """A demonstration that `recorder` sees from the middle of `plan` on."""
    world, rng = run.world, generator_of(key, "before")
    expert = changed_plans.ChangedExpert(run.parts.scene, world.snapshot(), plan, rng)
    while not (expert.finished or expert.begun or run.has("failed")):
        rows = run.next(expert)
        if expert.begun:
            run.recorder = recorder
            recorder.started(world)
        run.act(rows)
    if not expert.begun:
        raise ValueError(f"{key.slug} does not get to its middle: {'; '.join(expert.failures)}")
    return run_expert(run, expert)


def replay(
    world: World, key: TrialKey, commanded: Rows, prefix_action: Rows, kind: str
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
    policy = RecordedPolicy(executed, "joint")
    scale = allowed / limit
    return trial.run_trial(world, policy, key, policy_seed=0, step_scale=scale, replayed=True)
