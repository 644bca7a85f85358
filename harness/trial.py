"""One trial: a world, a policy and a key in; a record out.

Pure of processes, files and networks, so that the same key and the same actions give the same
record wherever it runs. The policy is asked only when a new chunk is needed, and the world renders
only then (plus at the past steps that the policy's history offsets will need).

What goes wrong is sorted once, here:

    an action or an answer that breaks the spec    -> the record ends in "policy_error": a failure
    anything else that the policy or world raises  -> passed on: not run, the caller may retry
"""

from __future__ import annotations

import hashlib
import secrets
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Protocol, cast

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import quantize
from robospa.harness.clock.policy_clock import PolicyClock
from robospa.harness.clock.real_time import RealTime
from robospa.harness.effects import Effects
from robospa.harness.policy_calls import PolicyCaller, Stopwatch, answer_times
from robospa.harness.robots import embodiment
from robospa.harness.robots.embodiment import Embodiment
from robospa.harness.world import ActionError, StepResult, World
from robospa.observation import Observation, View
from robospa.protocol.errors import PolicyAnswerError, PolicyError
from robospa.protocol.policy import (
    CALLED,
    POINT,
    SKILL,
    Policy,
    PolicySpec,
    TrialInfo,
    check_chunk,
)
from robospa.results.records.action_problems import KINDS, ProblemKind
from robospa.results.records.trial_record import (
    LEAD,
    PROCESSOR,
    EventRow,
    TrialRecord,
    query_entries,
)
from robospa.tasks.catalog import build_scene
from robospa.tasks.catalog import task as find_task
from robospa.tasks.descriptions import describe_objects
from robospa.tasks.events import Event, outcome
from robospa.tasks.goals.monitors import ClutterMonitor, GraspMonitor
from robospa.tasks.scene import Scene
from robospa.tasks.snapshot import Snapshot
from robospa.tasks.task import Task, Tracker
from robospa.trial import TrialKey

FINAL = "final"
"""The diagnostic that says where objects lie in the end [m], to the hundredth of a millimetre."""
MICROSECONDS = 6
"""Decimals of the times in a record [s]: more are noise, a fifth of what a bundle has to carry."""


class Recorder(Protocol):
    """Called while a trial runs, to record it."""

    def started(self, world: World) -> None:
        """The scene has settled; no action has been executed."""

    def polled(self, world: World, time: float) -> None:
        """An action is being executed; `time` [s, simulated] since the start. 50 Hz."""

    def executed(self, world: World, action: NDArray[np.float32], done: StepResult) -> None:
        """`action` has just been executed."""
        return

    def ended(self, world: World) -> None:
        """The trial is over."""
        return


@dataclass(frozen=True)
class TrialSetup:
    """Scene, task, goal and instruction of a trial; tests replace them."""

    scene: Scene
    task: Task
    tracker: Tracker
    instruction: str


def task_parts(key: TrialKey, salt: str = "") -> TrialSetup:
    """Scene, goal and instruction of `key` from the catalog; KeyError or ValueError if unknown.

    `salt` is the secret of hidden scenes.
    """
    from robospa.tasks.sentences import instruction

    task = find_task(key.task)
    scene = build_scene(key.task, key.level, key.seed, key.embodiment, key.mode, salt)
    return TrialSetup(scene, task, task.goal(scene), instruction(scene, key.split, salt))


@dataclass
class TrialState:
    """A trial in progress: what its world, its goal and its record know. It asks no policy, so that
    `run_trial` and an environment that is stepped from outside execute actions alike."""

    world: World
    parts: TrialSetup
    robot: Embodiment
    recorder: Recorder | None = None
    stopwatch: Stopwatch = field(default_factory=Stopwatch)
    grasps: GraspMonitor | None = None
    clutter: ClutterMonitor | None = None
    events: list[Event] = field(default_factory=list)
    event_steps: list[int] = field(default_factory=list)
    """For every event the number of actions started by then."""
    actions: list[NDArray[np.float32]] = field(default_factory=list)
    replayed: bool = False
    """Whether its actions are those of a record, on which the scene's mode has acted already."""
    effects: Effects = field(init=False)
    past: dict[int, View] = field(default_factory=dict)
    """Views that history offsets may ask for, by the number of actions executed then."""
    physics_steps: int = 0
    physics_seconds: float = 0.0
    problems: dict[ProblemKind, int] = field(default_factory=dict)
    """How many actions were executed otherwise than sent, by kind."""
    first_problems: dict[ProblemKind, str] = field(default_factory=dict)
    last_problems: tuple[str, ...] = ()
    """What of the last action was executed otherwise than sent."""
    calls: list[dict[str, object]] = field(default_factory=list)
    """Calls so far, each with its feedback and when it began."""
    last_joints: NDArray[np.float32] | None = None
    """The joint action that was executed in the place of the last one, if that was of poses."""

    def load(self) -> None:
        """Bring the scene to rest; raises SceneUnstable."""
        world, tracker, scene = self.world, self.parts.tracker, self.parts.scene
        self.effects = Effects(scene)
        self.stopwatch.call("loading", world.load, scene, tracker.needs_contacts)
        if "start" in scene.strengths:
            state = world.observe(PolicySpec("start", cameras=(), state="commanded"))["state"]
            action = self.effects.start(state, self.robot.action_space("joint"))
            world.step(quantize(action), "joint", lambda snapshot: False)
        if tracker.roles:
            self.grasps = GraspMonitor(tracker.roles, scene, world.contacts)
        if scene.clutter:
            self.clutter = ClutterMonitor(scene.clutter, world.snapshot())

    def start(self) -> bool:
        """Note what holds before the first action; True if the goal is met or lost already."""
        if self.recorder is not None:
            self.stopwatch.call("recording", self.recorder.started, self.world)
        self.note(self.parts.tracker.start(self.world.snapshot()))
        return any(event.kind in ("success", "failed") for event in self.events)

    def poll(self, snapshot: Snapshot) -> bool:
        """Update the goal; True once it is met or lost."""
        started = time.perf_counter()
        new = self.parts.tracker.update(snapshot)
        if self.clutter is not None:
            new = (*self.clutter.update(snapshot), *new)
        if self.grasps is not None:
            new = (*self.grasps.update(snapshot), *new)
        self.stopwatch.add("goal", started)
        if self.recorder is not None:
            self.stopwatch.call("recording", self.recorder.polled, self.world, snapshot.time)
        if not new:
            return False
        self.note(new)
        return any(event.kind in ("success", "failed") for event in new)

    def note(self, new: tuple[Event, ...]) -> None:
        """Keep events, with the action during which they happened."""
        self.events.extend(new)
        self.event_steps.extend([len(self.actions)] * len(new))

    def rows(self, first: int = 0) -> tuple[EventRow, ...]:
        """The events from number `first` on as a record keeps them."""
        rows = zip(self.events[first:], self.event_steps[first:], strict=True)
        return tuple(cast(EventRow, {**asdict(event), "step": step}) for event, step in rows)

    def observation(self, spec: PolicySpec) -> Observation:
        """The observation of this instant that `spec` asks for."""
        step = len(self.actions)
        view: Observation = self.stopwatch.call("rendering", self.world.observe, spec)
        observation = self.effects.seen(view, step).copy()
        observation["instruction"] = self.parts.instruction
        observation["step"] = step
        if spec.action in CALLED:
            observation["calls"] = [dict(call) for call in self.calls]
        if spec.history:
            self.past[step] = _images_and_state(observation)
            observation["history"] = {
                offset: self.past[max(step + offset, 0)] for offset in spec.history
            }
            oldest = step + min(spec.history)
            self.past = {s: o for s, o in self.past.items() if s >= oldest or s == 0}
        return observation

    def remember(self, spec: PolicySpec, next_query: int) -> None:
        """Keep this step's view if a later query may ask for it.

        Offsets that reach `next_query` exactly are needed; those that reach beyond it may be,
        because the length of later chunks is not known.
        """
        step = len(self.actions)
        if step not in self.past and any(step - offset >= next_query for offset in spec.history):
            plain = replace(spec, privileged=False, environment_state=False)
            view: Observation = self.stopwatch.call("rendering", self.world.observe, plain)
            self.past[step] = _images_and_state(self.effects.seen(view, step))

    def checked(self, answer: object, spec: PolicySpec) -> NDArray[np.float32]:
        """The chunk that `spec` promises, as wide as this trial's robot takes it, quantised as it
        is executed; raises PolicyAnswerError."""
        chunk = check_chunk(answer, spec)
        space = self.robot.action_space(spec.action)
        if chunk.shape[1] != space.width:
            raise PolicyAnswerError(
                f"the policy answered {chunk.shape[1]} numbers per action, but a {spec.action} "
                f"action of {self.robot.name} has {space.width}"
            )
        if not self.replayed:
            chunk = self.effects.acted(chunk, len(self.actions), space)
        return quantize(chunk)

    def execute(self, action: NDArray[np.float32], space: str) -> bool:
        """Execute `action`; True if the goal was met or lost during it."""
        self.actions.append(action)
        started, other = time.perf_counter(), self.stopwatch.sum("goal", "recording")
        done = self.world.step(action, space, self.poll)
        elapsed = time.perf_counter() - started
        self.physics_seconds += elapsed - (self.stopwatch.sum("goal", "recording") - other)
        self.physics_steps += done.physics_steps
        self.last_joints = done.joints
        self.last_problems = tuple(problem.text for problem in done.problems)
        for problem in done.problems:
            example = f"action {len(self.actions)}: {problem.text}"
            self.first_problems.setdefault(problem.kind, example)
        for kind in {problem.kind for problem in done.problems}:
            self.problems[kind] = self.problems.get(kind, 0) + 1
        if self.recorder is not None:
            self.stopwatch.call("recording", self.recorder.executed, self.world, action, done)
        return bool(done.stopped)

    @property
    def end(self) -> str:
        """The end reason of a trial that is over without an error."""
        reached = outcome(self.events, self.parts.tracker.total)
        if reached.success:
            return "success"
        return "goal_lost" if reached.failed else "step_limit"

    def finish(self) -> None:
        """The trial is over: what its grippers were about is noted, and the recorder told."""
        if self.grasps is not None:
            self.note(self.grasps.finish(self.world.snapshot().time))
        if self.recorder is not None:
            self.stopwatch.call("recording", self.recorder.ended, self.world)


def _images_and_state(observation: Observation) -> View:
    return cast(View, {k: v for k, v in observation.items() if k in ("images", "state")})


def _loop(run: TrialState, answers: PolicyCaller, limit: int) -> str:
    """Act until the goal is met or lost or `limit` actions are spent; returns the end reason."""
    spec = answers.policy.spec
    while len(run.actions) < limit:
        chunk = answers.next_actions(run, spec)
        actions = chunk[: spec.execute] if spec.execute else chunk
        actions = actions[: limit - len(run.actions)]
        next_query = len(run.actions) + len(actions)
        for action in actions:
            if spec.history and run.actions:
                run.remember(spec, next_query)
            if run.execute(action, spec.action):
                return run.end
    return "step_limit"


def actions_digest(actions: list[NDArray[np.float32]]) -> str:
    """sha256 over the executed actions as little-endian float32."""
    digest = hashlib.sha256()
    for action in actions:
        digest.update(np.ascontiguousarray(action, dtype="<f4").tobytes())
    return digest.hexdigest()


def _play(
    run: TrialState, answers: PolicyCaller, info: TrialInfo, limit: int, real: RealTime | None
) -> tuple[str, str]:
    """(end reason, message) of the trial whose scene is loaded."""
    try:
        run.stopwatch.ask(answers.policy, answers.policy.reset, info)
        if run.start():
            return run.end, "the goal was decided before the first action"
        if real is not None:
            return real.act(limit), ""
        if answers.policy.spec.action == POINT:
            from robospa.harness.pointing import answer_question

            return answer_question(run, answers), ""
        if answers.policy.spec.action == SKILL:
            from robospa.harness.skill_calls import SkillTrial

            return SkillTrial(run, answers, limit).act(), ""
        return _loop(run, answers, limit), ""
    except (ActionError, PolicyError) as error:
        return "policy_error", str(error)


def _diagnostics(run: TrialState) -> dict[str, object]:
    """The goal's diagnostics, what the objects are, and actions executed otherwise than sent."""
    found = dict(run.parts.tracker.diagnostics())
    poses = run.world.snapshot().poses
    found[FINAL] = {name: [round(x, 5) for x in pose.position] for name, pose in poses.items()}
    task, scene = run.parts.task, run.parts.scene
    if task.lead is not None:
        found[LEAD] = round(task.lead(scene), 5)
    if run.calls:
        found["calls"] = run.calls
    if run.events:
        found["objects"] = describe_objects(run.parts.scene)
    if run.grasps is not None:
        found.update(run.grasps.diagnostics())
    if run.clutter is not None:
        found.update(run.clutter.diagnostics())
    for kind in KINDS:
        if kind in run.problems:
            found[kind.name] = run.problems[kind]
            found[kind.first] = run.first_problems[kind]
    return found


def open_trial(
    world: World, key: TrialKey, setup: TrialSetup, recorder: Recorder | None = None
) -> TrialState:
    """The trial `setup` in `world`, its scene at rest; raises SceneUnstable."""
    run = TrialState(world, setup, embodiment(key.embodiment), recorder)
    run.load()
    return run


def step_limit(task: Task, level: int, scale: float = 1.0) -> int:
    """Actions that a trial may take; a `scale` other than 1 departs from the benchmark."""
    return max(1, round(task.levels[level].steps * scale))


def run_trial(
    world: World,
    policy: Policy,
    key: TrialKey,
    *,
    policy_seed: int,
    trial_id: str = "",
    recorder: Recorder | None = None,
    parts: Callable[[TrialKey], TrialSetup] = task_parts,
    step_scale: float = 1.0,
    clock: PolicyClock | None = None,
    processor: Callable[[], float] = time.process_time,
    replayed: bool = False,
) -> TrialRecord:
    """Run the trial `key` to its end and return its record.

    `policy_seed` and `trial_id` are what the policy is sent (`robospa.harness.trial`).
    `step_scale` multiplies the task's step limit; anything but 1 departs from the benchmark.
    `clock`: a real one, in a `world` whose actions take its period; None for the paused one.
    `processor` tells its time [s] where several trials share a process. `replayed`: `policy` sends
    what a record says was executed.
    A PolicyError and an ActionError end the trial; whatever else `policy` or `world` raise is
    passed on. `world` may be used for any other trial before and after.
    """
    started, busy = time.perf_counter(), processor()
    run, answers = open_trial(world, key, parts(key), recorder), PolicyCaller(policy)
    run.replayed = replayed
    info = TrialInfo(
        task=key.task,
        embodiment=key.embodiment,
        instruction=run.parts.instruction,
        policy_seed=policy_seed,
        id=trial_id,
        key=key if policy.spec.needs_trial_key else None,
        joints=run.robot.action_space("joint").joints,
    )
    clock = run.effects.timed(clock)
    real = None if clock is None else RealTime(run, answers, clock, policy_seed)
    limit = step_limit(run.parts.task, key.level, step_scale)
    end, message = _play(run, answers, info, limit, real)
    run.finish()
    record = record_of(run, key, end, message, policy_seed, answers.asked)
    timing = {
        **run.stopwatch.seconds,
        "physics": run.physics_seconds,
        PROCESSOR: processor() - busy,
    }
    more = answers.usage() | (real.log.entry() if real is not None else {})
    return replace(
        record,
        diagnostics={**record.diagnostics, **more},
        latency=answer_times(answers.latencies, answers.server_timings),
        wall_time=round(time.perf_counter() - started, MICROSECONDS),
        timing={purpose: round(seconds, MICROSECONDS) for purpose, seconds in timing.items()},
    )


def record_of(
    run: TrialState, key: TrialKey, end: str, message: str, policy_seed: int, asked: Sequence[int]
) -> TrialRecord:
    """The record of a trial that has ended, without its times. `asked`: how many actions had been
    begun at each query of the policy."""
    setup, tracker = run.parts, run.parts.tracker
    reached = outcome(run.events, tracker.total)
    return TrialRecord(
        key=key,
        category=setup.task.category,
        instruction=setup.instruction,
        scene_digest=setup.scene.digest,
        end=end,
        success=reached.success,
        done=reached.done,
        best=reached.best,
        total=tracker.total,
        candidates=setup.task.levels[key.level].candidates,
        steps=len(run.actions),
        physics_steps=run.physics_steps,
        policy_calls=len(asked),
        digest=run.world.digest(),
        actions_digest=actions_digest(run.actions),
        wall_time=0.0,
        policy_seed=policy_seed,
        message=message,
        events=run.rows(),
        diagnostics={**_diagnostics(run), **query_entries(asked, len(run.actions))},
    )


def new_run_seed() -> str:
    """A secret from which a run's ids and policy seeds follow: 64 hexadecimal digits."""
    return secrets.token_hex(32)


def policy_seed(key: TrialKey, run_seed: str | int) -> int:
    """The seed that a stochastic policy gets for `key`, 0 to 2^31 - 1.

    Like `trial_id` it follows from the key and the run's seed: the same in every worker and order,
    and whenever a trial is repeated. Who does not know the run's seed learns nothing of the key.
    """
    return int.from_bytes(_digest(f"{run_seed}/{key.slug}")[:4], "big") >> 1


def trial_id(key: TrialKey, run_seed: str | int) -> str:
    """The name by which a policy knows the trial `key`: 16 hexadecimal digits."""
    return _digest(f"id/{run_seed}/{key.slug}")[:8].hex()


def salt_hash(salt: str) -> str:
    """What may be published of a salt."""
    return hashlib.sha256(salt.encode()).hexdigest()


def _digest(text: str) -> bytes:
    return hashlib.sha256(text.encode()).digest()
