"""Execute recorded actions again, without the model that chose them.

The world decides everything else, so a repeatable world gives the same record.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from robospa.harness.running.manifest import this_processor
from robospa.harness.running.record_store import ActionRecorder, read_trace
from robospa.harness.trial import (
    Recorder,
    TrialSetup,
    policy_seed,
    run_trial,
    task_parts,
    trial_id,
)
from robospa.harness.world import JOINTS_FROM_EE, ActionError, Poll, StepResult, World
from robospa.observation import CameraSpec, Observation
from robospa.protocol.errors import PolicyAnswerError
from robospa.protocol.policy import POINT, Policy, PolicySpec, TrialInfo
from robospa.results.records.manifest import read_manifest
from robospa.results.records.runs import action_path, differences
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

CHUNK = 1000
OUTCOME = frozenset(("success", "done", "best"))
ENDED = "the recorded actions end here"
"""What a record says whose goal was not met by then."""


class ReplayError(Exception):
    """A trial does not come again; the message says which one and why."""


class RecordedPolicy:
    """Sends recorded `actions`, float32 (T, D), of the action `space`; then it has nothing more to
    say, which counts as an answer that cannot be executed."""

    def __init__(self, actions: NDArray[np.float32], space: str) -> None:
        self._actions = actions
        self.spec = PolicySpec(
            name="recorded",
            cameras=(),
            state="none",
            action=space,
            horizon=CHUNK,
            seeded=True,
            action_dim=actions.shape[1] or None,
        )

    def reset(self, trial: TrialInfo) -> None:
        """Nothing depends on the trial."""

    def infer(self, observation: Observation) -> NDArray[np.float32]:
        """The recorded actions from this step on; PolicyAnswerError after the last."""
        chunk = self._actions[int(observation["step"]) :][:CHUNK]
        if not len(chunk):
            raise PolicyAnswerError(ENDED)
        return chunk


class RecordedPoint:
    """Points where a record says; its spec sees that picture alone."""

    def __init__(self, at: Sequence[float], camera: CameraSpec) -> None:
        self.spec = PolicySpec("recorded", cameras=(camera,), state="none", action=POINT)
        self._call: dict[str, object] = {"skill": POINT, "at": at}

    def reset(self, trial: TrialInfo) -> None:
        """Nothing depends on the trial."""

    def infer(self, observation: Observation) -> list[dict[str, object]]:
        """The recorded point."""
        return [self._call]


class _Following:
    """A world that executes recorded joint actions in place of what it is sent."""

    def __init__(self, world: World, joints: NDArray[np.float32]) -> None:
        self._world = world
        self._joints = iter(joints)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._world, name)

    def step(self, action: NDArray[np.float32], space: str, poll: Poll) -> StepResult:
        """Execute the next recorded joint action; ActionError after the last."""
        recorded = next(self._joints, None)
        if recorded is None:
            raise ActionError("the recorded joint actions end here")
        kind = JOINTS_FROM_EE if space == "ee" else "joint"
        return replace(self._world.step(recorded, kind, poll), joints=recorded)


def replay(
    world: World,
    key: TrialKey,
    actions: NDArray[np.float32],
    space: str,
    *,
    joints: NDArray[np.float32] | None = None,
    of: TrialRecord | None = None,
    policy_seed: int = 0,
    recorder: Recorder | None = None,
    parts: Callable[[TrialKey], TrialSetup] = task_parts,
    step_scale: float = 1.0,
) -> TrialRecord:
    """The record that `actions` give on `key` in `world`, with step limits of `step_scale`.

    `joints` are joint actions to execute in their place, as an earlier run did. The record that
    they are `of` says what was pointed at where nothing was moved.
    """
    call, *_ = (of and of.diagnostics.get("calls")) or [{}]
    if call.get("skill") == POINT:
        policy: Policy = RecordedPoint(call["at"], CameraSpec(call["camera"], *call["size"]))
    else:
        policy = RecordedPolicy(actions, space)
    return run_trial(
        world if joints is None else cast(World, _Following(world, joints)),
        policy,
        key,
        policy_seed=policy_seed,
        recorder=recorder,
        parts=parts,
        step_scale=step_scale,
        replayed=True,
    )


def replay_record(
    world: World,
    record: TrialRecord,
    folder: Path,
    recorder: Recorder,
    *,
    parts: Callable[[TrialKey], TrialSetup] = task_parts,
    step_scale: float = 1.0,
) -> None:
    """Replay the trial of `record`, whose actions are in the run in `folder`, for `recorder`.

    Raises ReplayError if it ends otherwise, or in another state on a processor of the run's kind,
    RunError if its actions cannot be read, and what
    `world` raises.
    """
    key = record.key
    setup = parts(key)
    if setup.scene.digest != record.scene_digest:
        raise ReplayError(
            f"{key.slug} was run in another scene than this version of robospa makes of its key"
        )
    actions, space, joints = read_trace(action_path(folder, key))
    # A trial with a time limit of its own may have more actions than its step limit has.
    limit = setup.task.levels[key.level].steps
    again = replay(
        world,
        key,
        actions,
        space,
        joints=joints,
        of=record,
        policy_seed=record.policy_seed,
        recorder=recorder,
        parts=parts,
        step_scale=max(step_scale, len(actions) / limit),
    )
    if again.digest == record.digest:
        return
    differs = OUTCOME & set(differences(record, again))
    if differs or this_processor().kind in {p.kind for p in read_manifest(folder).about.processors}:
        raise ReplayError(
            f"{key.slug} played again ends in another {min(differs, default='state')}: the run is "
            "not repeatable on this machine"
        )


def expert_actions(world: World, expert: Policy, key: TrialKey) -> NDArray[np.float32]:
    """What the expert does in the scene of `key`, float32 (T, D)."""
    recorder = ActionRecorder()
    run_trial(world, expert, key, policy_seed=0, recorder=recorder)
    return recorder.actions


def rehearse(
    world: World, policy: Policy, run_seed: str, key: TrialKey, setup: TrialSetup
) -> TrialRecord:
    """The record of `key` with this scene, goal and instruction, which serve for one trial."""
    return run_trial(
        world,
        policy,
        key,
        policy_seed=policy_seed(key, run_seed),
        trial_id=trial_id(key, run_seed),
        parts=lambda _: setup,
    )
