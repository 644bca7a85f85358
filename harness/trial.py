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
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from robospa.harness.quantize import quantize
from robospa.harness.world import ActionError, World
from robospa.protocol.errors import PolicyAnswerError
from robospa.protocol.policy import Policy, PolicySpec, TrialInfo
from robospa.protocol.validation import check_chunk
from robospa.results.records.trial_record import PROCESSOR, TrialRecord
from robospa.tasks.catalog import build_scene
from robospa.tasks.catalog import task as find_task
from robospa.tasks.events import Event, outcome
from robospa.tasks.goals.hands import Hands
from robospa.tasks.scene import Scene
from robospa.tasks.snapshot import Snapshot
from robospa.tasks.task import Task, Tracker
from robospa.trial import TrialKey

SERVER_TIMES = {"queue": "queue_ms", "infer": "infer_ms", "batch": "batch"}
"""Entries of a record's `latency` that come from the server, and what the wire calls them."""


class Recorder(Protocol):
    """Looks on while a trial runs."""

    def started(self, world: World) -> None:
        """The scene has settled; no action has been executed."""

    def polled(self, world: World, time: float) -> None:
        """An action is being executed; `time` [s, simulated] since the start. 50 Hz."""

    def executed(self, world: World, action: NDArray[np.float32]) -> None:
        """`action` has just been executed."""

    def ended(self, world: World) -> None:
        """The trial is over."""


@dataclass(frozen=True)
class TrialParts:
    """What a trial needs of its task; tests replace it to run without the task catalog."""

    scene: Scene
    task: Task
    tracker: Tracker
    instruction: str


def task_parts(key: TrialKey) -> TrialParts:
    """Scene, goal and instruction of `key` from the catalog; KeyError or ValueError if unknown."""
    from robospa.tasks.sentences import instruction

    task = find_task(key.task)
    scene = build_scene(key.task, key.level, key.seed, key.embodiment, key.mode)
    return TrialParts(scene, task, task.goal(scene), instruction(scene, key.split))


def policy_seed(key: TrialKey, run_seed: int = 0) -> int:
    """The seed that a stochastic policy gets for `key`: the same in every worker and order."""
    digest = hashlib.sha256(f"{run_seed}/{key.slug}".encode()).digest()
    return int.from_bytes(digest[:4], "big") >> 1


class _Stopwatch:
    """Seconds by purpose."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    def call(self, purpose: str, work: Callable[..., Any], *args: Any) -> Any:
        begun = time.perf_counter()
        try:
            return work(*args)
        finally:
            self.add(purpose, begun)

    def add(self, purpose: str, begun: float) -> None:
        """The time since `begun` on the clock."""
        self.seconds[purpose] = self.seconds.get(purpose, 0.0) + time.perf_counter() - begun

    def sum(self, *purposes: str) -> float:
        return sum(self.seconds.get(purpose, 0.0) for purpose in purposes)


@dataclass
class _Run:
    """The state of one trial in progress."""

    world: World
    policy: Policy
    parts: TrialParts
    recorder: Recorder | None
    watch: _Stopwatch = field(default_factory=_Stopwatch)
    hands: Hands | None = None
    events: list[Event] = field(default_factory=list)
    when: list[int] = field(default_factory=list)
    """For every event the number of actions begun by then."""
    actions: list[NDArray[np.float32]] = field(default_factory=list)
    latencies: list[float] = field(default_factory=list)
    told: list[Mapping[str, float]] = field(default_factory=list)
    """What the policy's server said of the time of every answer."""
    past: dict[int, dict[str, Any]] = field(default_factory=dict)
    physics_steps: int = 0
    physics_seconds: float = 0.0
    unreachable: int = 0
    first_problem: str = ""

    def poll(self, snapshot: Snapshot) -> bool:
        begun = time.perf_counter()
        new = self._look(snapshot)
        self.watch.add("goal", begun)
        if self.recorder is not None:
            self.watch.call("recording", self.recorder.polled, self.world, snapshot.time)
        if not new:
            return False
        self.note(new)
        return any(event.kind in ("success", "failed") for event in new)

    def _look(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """What the goal and the hands say of this instant."""
        new = self.parts.tracker.update(snapshot)
        if self.hands is not None:
            tried = self.hands.update(snapshot)
            return (*tried, *new) if tried else new
        return new

    def note(self, new: tuple[Event, ...]) -> None:
        """Keep events, with the action during which they happened."""
        self.events.extend(new)
        self.when.extend([len(self.actions)] * len(new))

    def observation(self, spec: PolicySpec) -> dict[str, Any]:
        """What the policy asked for, at this instant."""
        step = len(self.actions)
        seen = self.watch.call("rendering", self.world.observe, spec)
        observation = dict(seen)
        observation["instruction"] = self.parts.instruction
        observation["step"] = step
        if spec.history:
            self.past[step] = _present(seen)
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
            plain = replace(spec, privileged=False)
            self.past[step] = _present(self.watch.call("rendering", self.world.observe, plain))

    def ask(self, spec: PolicySpec) -> NDArray[np.float32]:
        """The policy's next actions, float32 (T, D), quantised as they are executed."""
        observation = self.observation(spec)
        begun = time.perf_counter()
        answer = self.watch.call("waiting", self.policy.infer, observation)
        self.latencies.append(1000.0 * (time.perf_counter() - begun))
        self.told.append(getattr(self.policy, "last_timing", {}))
        return quantize(check_chunk(answer, spec))

    def execute(self, action: NDArray[np.float32], space: str) -> bool:
        """Whether the goal was met or lost during `action`."""
        self.actions.append(action)
        begun, other = time.perf_counter(), self.watch.sum("goal", "recording")
        done = self.world.step(action, space, self.poll)
        spent = time.perf_counter() - begun
        self.physics_seconds += spent - (self.watch.sum("goal", "recording") - other)
        self.physics_steps += done.physics_steps
        if done.problems:
            self.unreachable += 1
            self.first_problem = self.first_problem or f"action {len(self.actions)}: " + "; ".join(
                done.problems
            )
        if self.recorder is not None:
            self.watch.call("recording", self.recorder.executed, self.world, action)
        return bool(done.stopped)


def _present(observation: Mapping[str, Any]) -> dict[str, Any]:
    return {name: observation[name] for name in ("images", "state") if name in observation}


def _loop(run: _Run, limit: int) -> str:
    """Act until the goal is met or lost or `limit` actions are spent; returns the end reason."""
    spec = run.policy.spec
    while len(run.actions) < limit:
        chunk = run.ask(spec)
        wanted = chunk[: spec.execute] if spec.execute else chunk
        wanted = wanted[: limit - len(run.actions)]
        next_query = len(run.actions) + len(wanted)
        for action in wanted:
            if spec.history and run.actions:
                run.remember(spec, next_query)
            if run.execute(action, spec.action):
                return _end_of(run)
    return "step_limit"


def _end_of(run: _Run) -> str:
    reached = outcome(run.events, run.parts.tracker.total)
    if reached.success:
        return "success"
    return "goal_lost" if reached.failed else "step_limit"


def _answer_times(latencies: list[float], told: list[Mapping[str, float]]) -> dict[str, float]:
    """Percentiles as the client saw them, and means of what the server told, if it did [ms]."""
    if not latencies:
        return {}
    p50, p95, p99 = (float(v) for v in np.percentile(latencies, [50, 95, 99]))
    found = {"p50": p50, "p95": p95, "p99": p99, "max": max(latencies)}
    for name, entry in SERVER_TIMES.items():
        values = [timing.get(entry) for timing in told]
        usable = [v for v in values if isinstance(v, (int, float)) and 0.0 <= v < 1e9]
        if usable:
            found[name] = sum(usable) / len(usable)
    return found


def actions_digest(actions: list[NDArray[np.float32]]) -> str:
    """sha256 over the executed actions as little-endian float32."""
    digest = hashlib.sha256()
    for action in actions:
        digest.update(np.ascontiguousarray(action, dtype="<f4").tobytes())
    return digest.hexdigest()


def _play(run: _Run, info: TrialInfo, limit: int) -> tuple[str, str]:
    """(end reason, message) of the trial whose scene is loaded."""
    try:
        run.watch.call("waiting", run.policy.reset, info)
        if run.recorder is not None:
            run.watch.call("recording", run.recorder.started, run.world)
        run.note(run.parts.tracker.start(run.world.snapshot()))
        if any(event.kind in ("success", "failed") for event in run.events):
            return _end_of(run), "the goal was decided before the first action"
        return _loop(run, limit), ""
    except (ActionError, PolicyAnswerError) as error:
        return "policy_error", str(error)


def _diagnostics(run: _Run) -> dict[str, Any]:
    """What stands beside the result: the goal's own, and actions that were not done as asked."""
    own = getattr(run.parts.tracker, "diagnostics", None)
    found = dict(own()) if own is not None else {}
    if run.hands is not None:
        found.update(run.hands.diagnostics())
    if run.unreachable:
        found["unreachable_actions"] = run.unreachable
        found["first_unreachable"] = run.first_problem
    return found


def run_trial(
    world: World,
    policy: Policy,
    key: TrialKey,
    *,
    policy_seed: int,
    recorder: Recorder | None = None,
    parts: Callable[[TrialKey], TrialParts] = task_parts,
    step_scale: float = 1.0,
) -> TrialRecord:
    """Run the trial `key` to its end and return its record.

    `step_scale` multiplies the task's step limit; anything but 1 departs from the benchmark.
    Whatever `policy` or `world` raise apart from bad actions and answers is passed on: the caller
    decides whether to try again. `world` may be used for any other trial before and after.
    """
    begun, worked = time.perf_counter(), time.process_time()
    wanted = parts(key)
    run = _Run(world, policy, wanted, recorder)
    level = wanted.task.levels[key.level]
    tracker = wanted.tracker
    run.watch.call("loading", world.load, wanted.scene, tracker.needs_contacts)
    info = TrialInfo(
        task=key.task,
        level=key.level,
        seed=key.seed,
        embodiment=key.embodiment,
        mode=key.mode,
        split=key.split,
        instruction=wanted.instruction,
        policy_seed=policy_seed,
    )
    roles = getattr(tracker, "roles", None)
    if roles:
        run.hands = Hands(roles, wanted.scene, world.contacts)
    end, message = _play(run, info, max(1, round(level.steps * step_scale)))
    if run.hands is not None:
        run.note(run.hands.finish(world.snapshot().time))
    if recorder is not None:
        run.watch.call("recording", recorder.ended, world)
    reached = outcome(run.events, tracker.total)
    timing = dict(run.watch.seconds)
    timing["physics"] = run.physics_seconds
    timing[PROCESSOR] = time.process_time() - worked
    return TrialRecord(
        key=key,
        category=wanted.task.category,
        instruction=wanted.instruction,
        scene_digest=wanted.scene.digest,
        end=end,
        success=reached.success,
        done=reached.done,
        best=reached.best,
        total=tracker.total,
        candidates=level.candidates,
        steps=len(run.actions),
        physics_steps=run.physics_steps,
        policy_calls=len(run.latencies),
        digest=world.digest(),
        actions_digest=actions_digest(run.actions),
        wall_time=time.perf_counter() - begun,
        policy_seed=policy_seed,
        message=message,
        events=tuple(
            {**asdict(event), "step": step}
            for event, step in zip(run.events, run.when, strict=True)
        ),
        latency=_answer_times(run.latencies, run.told),
        timing=timing,
        diagnostics=_diagnostics(run),
    )
