"""Level 2, *replayed*: recorded actions fed to the simulator, ends compared with the records.

A trial is *identical* if everything that a repeatable world decides is equal, the final state to
the last bit; it *agrees* if only the final state is not, as on another kind of processor or with
another build of the simulator; otherwise it is *different*. How far objects lie from where the
records say is measured. Neither a GPU nor rendering is needed. The caller judges.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from concurrent.futures import as_completed
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from robospa.harness.factory import load_function
from robospa.harness.pool import JobProcess, Pool, WorkerDied
from robospa.harness.running.manifest import about_machine, changed_settings, this_processor
from robospa.harness.trial import FINAL
from robospa.harness.worlds import open_world
from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.evidence import APART, ReplayEvidence, drawn, what_it_catches
from robospa.leaderboard.rules import Reference, spec_of
from robospa.leaderboard.traces import Trace, split_trace
from robospa.leaderboard.verify import Valid, read_traces
from robospa.results.records.runs import differences
from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.first_choice import first_choice, held_at_start
from robospa.trial import TrialKey

if TYPE_CHECKING:
    from robospa.harness.trial import TrialSetup
    from robospa.harness.world import World

IDENTICAL, AGREES, DIFFERENT = "identical", "agrees", "different"
LAST_BITS = {"digest", "physics_steps", "steps", "actions_digest"}
"""What may be others on another processor, where the same end may come earlier."""
FROM_EVENTS = {"first choice": first_choice, "subtasks at the start": held_at_start}
"""Outcomes that no field of a record says."""
SAME = ("versions", "code")
"""What of run and installation decides the bits."""
LOST = 1e6
"""How far apart things lie [mm] of which a record says nonsense."""


@dataclass(frozen=True)
class Replayed:
    """What became of one trial: `kind`, the fields in which it `differs`, the new record, and how
    far `apart` [mm] an object lies; None where the record does not say."""

    key: TrialKey
    kind: str
    differs: tuple[str, ...]
    record: TrialRecord | None
    trouble: str = ""
    apart: float | None = None


@dataclass(frozen=True)
class SampleReplay:
    """The replayed sample of a bundle, and the evidence for the badge."""

    trials: tuple[Replayed, ...]
    evidence: ReplayEvidence

    def sentences(self) -> list[str]:
        """What this shows and what it does not, for people."""
        found = self.evidence
        said = [found.sentence, what_it_catches(found.trials, found.sampled)]
        why = "versions are those of the run, so processor or library build differ, or the run"
        if found.same_kind:
            why = "versions and kind of processor are those of the run"
        if found.changed_versions:
            why = "other versions: " + "; ".join(found.changed_versions)
        if found.median > APART:
            said.append(f"Half of the trials may lie no more than {APART:g} mm apart ({why}).")
        if first := next((trial for trial in self.trials if trial.kind == DIFFERENT), None):
            what = first.trouble or "other " + ", ".join(first.differs)
            said.append(f"First difference: {first.key.slug}: {what} ({why}).")
        elif not found.exact:
            said.append(f"Outcomes agree but not all final states do, to the bit ({why}).")
        return said


def replay(
    valid: Valid,
    challenge: str,
    count: int,
    reference: Reference,
    workers: int = 1,
    on_trial: Callable[[Replayed], None] = lambda trial: None,
) -> SampleReplay:
    """Play `count` trials of a valid bundle again, chosen by `challenge`, in `workers` processes.

    `on_trial` hears of each as it ends. Raises BundleError if the simulator does not run here.
    """
    keys = drawn(challenge, valid.manifest.bundle, valid.keys, count)
    traces = read_traces(valid, keys)
    spaces = {key: spec_of(valid.settings, key.task).space for key in keys}
    jobs = [(valid.run.records[key], traces[key], spaces[key]) for key in keys]
    found: dict[TrialKey, Replayed] = {}
    where = (reference.world, reference.parts)
    start = partial(JobProcess, _replayer, where, name="replay")
    with Pool[Job, Replayed](start, max(1, workers), deaths=1) as pool:
        try:
            for future in as_completed([pool.submit(job) for job in jobs]):
                trial = future.result()
                found[trial.key] = trial
                on_trial(trial)
        except WorkerDied:
            raise BundleError(
                "the simulator does not run here, or crashed: `robospa check` says what is missing"
            ) from None
    trials, about = tuple(found[key] for key in keys), valid.run.manifest.about
    before, now = (
        {name: getattr(one, name) for name in SAME} for one in (about, about_machine({}))
    )
    kinds = Counter(trial.kind for trial in trials)
    apart = [trial.apart for trial in trials if trial.apart is not None]
    evidence = ReplayEvidence(
        bundle=valid.manifest.bundle,
        challenge=challenge.strip(),
        sampled=len(trials),
        trials=len(valid.keys),
        identical=kinds[IDENTICAL],
        agrees=kinds[AGREES],
        different=kinds[DIFFERENT],
        changed_versions=tuple(changed_settings(before, now)),
        different_trials=tuple(trial.key.slug for trial in trials if trial.kind == DIFFERENT),
        ran_on=about.processors,
        played_on=this_processor(),
        placed=len(apart),
        median=float(np.median(apart)) if apart else 0.0,
        most=max(apart, default=0.0),
    )
    return SampleReplay(trials, evidence)


def judge(claimed: TrialRecord, again: TrialRecord) -> Replayed:
    """How a trial that was played again compares with its record."""
    differs = [name for name in differences(claimed, again) if name != "end"]
    differs += [name for name, of in FROM_EVENTS.items() if of(claimed) != of(again)]
    ends = (claimed.end, again.end)
    if "policy_error" in ends and claimed.end == again.end:
        # The refused action is not in the recording: one step less, with the same final state.
        differs = [name for name in differs if name not in ("steps", "actions_digest")]
    elif claimed.end != again.end and ends != ("done", "policy_error"):  # what said so is not there
        differs.append("end")
    far = _apart(claimed, again)
    kind = AGREES if set(differs) <= LAST_BITS else DIFFERENT
    return Replayed(claimed.key, kind if differs else IDENTICAL, tuple(differs), again, apart=far)


def _apart(claimed: TrialRecord, again: TrialRecord) -> float | None:
    """How far an object lies from where `claimed` says [mm], at most; None if it does not say."""
    if FINAL not in claimed.diagnostics:
        return None
    said, found = claimed.diagnostics[FINAL], again.diagnostics[FINAL]
    try:
        assert said.keys() == found.keys()
        apart = np.array([np.subtract(said[name], place) for name, place in found.items()])
    except (AttributeError, AssertionError, TypeError, ValueError):
        return LOST
    far = float(np.linalg.norm(apart.reshape(-1, 3), axis=1).max(initial=0))
    return min(LOST, 1000 * far) if math.isfinite(far) else LOST


Job = tuple[TrialRecord, Trace, str]
"""What a record claims, what was executed, and in which action space."""


def _replayer(where: tuple[str, str]) -> Callable[[Job], Replayed]:
    """What plays trials again in one process: in a world without renderer, with scenes and goals of
    these parts."""
    world, parts = where
    try:
        return partial(_again, open_world(world, render=False), load_function(parts))
    except Exception as error:
        raise WorkerDied(str(error)) from None


def _again(world: World, parts: Callable[[TrialKey], TrialSetup], job: Job) -> Replayed:
    """Play one trial again and compare."""
    from robospa.harness.replay import replay

    claimed, trace, space = job
    try:
        actions, joints = split_trace(trace, claimed.key.embodiment, space)
        again = replay(
            world,
            claimed.key,
            actions,
            space,
            joints=None if joints is trace else joints,
            policy_seed=claimed.policy_seed,
            parts=parts,
        )
    except Exception as error:  # a trace that the world cannot even start is no result
        text = " ".join(str(error).split())[:200]
        return Replayed(claimed.key, DIFFERENT, (), None, f"{type(error).__name__}: {text}")
    return judge(claimed, again)
