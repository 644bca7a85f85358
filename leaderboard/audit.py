"""What a maintainer looks at before believing numbers: `robospa report RUN --audit`.

Each check gives one sentence with its numbers. `suspicious` is no proof, and nothing suspicious is
none either: an honest model may be near the expert it learned from, and a cheat may add noise.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robospa.harness.factory import load_function, open_policy
from robospa.harness.replay import expert_actions, rehearse
from robospa.harness.running.record_store import read_trace
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.trial import TrialSetup, new_run_seed, task_parts
from robospa.leaderboard.agreement import Counts, agreement
from robospa.leaderboard.rules import shipped, spec_of
from robospa.leaderboard.traces import Trace, split_trace, with_joints
from robospa.leaderboard.verify import read_traces, verify
from robospa.results.records.runs import Run, action_path, finished, read_run
from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.first_choice import after_others
from robospa.results.scoring.repeats import fault_rates
from robospa.tasks.seeds import accepted
from robospa.tasks.sentences import sentences
from robospa.trial import TrialKey

ALPHA = 0.01
NEAR = 0.01
"""Mean distance of a joint [rad] from the expert's path below which a path is suspicious: a model
that learned from demonstrations is some hundredths off, on scenes that it has never seen."""
POINTS = 200
"""Places at which two paths are compared."""
EXPERT = "robospa.baselines.oracle:create"
CHOSE = "successes follow other choices no more often than those of a policy that reads."
STILL = 0.8
"""Share of the successes that may not remain when the sentences are another trial's."""

Parts = Callable[[TrialKey], TrialSetup]


@dataclass(frozen=True)
class AuditFinding:
    """What one check found."""

    check: str
    sentence: str
    suspicious: bool


def audit(
    path: Path,
    reproduction: Path | None = None,
    policy: str | None = None,
    samples: int = 10,
    token: str | None = None,
) -> list[AuditFinding]:
    """All findings on the run or the bundle at `path`; `reproduction` is the folder of the same
    policy's run on hidden scenes, `policy` the URL of its server.

    `samples` of its successful trials are held against the expert's, and the policy is asked for so
    many with exchanged sentences.
    """
    run, traces = executed_paths(path, samples)
    results = [record for record in run.records.values() if finished(record)]
    told = after_others(results)
    findings = [*faults(run), AuditFinding("choices", told or CHOSE, bool(told))]
    if reproduction is not None:
        findings.append(hidden_gap(run, read_run(reproduction)))
    if samples and not run.manifest.settings.salt_sha256:
        with closing(SapienWorld(render=False)) as world:
            expert = partial(expert_actions, world, load_function(EXPERT)())
            findings.append(expert_likeness(traces, expert))
    if policy is not None and samples:
        with closing(SapienWorld()) as world:
            asked = open_policy(policy, {"token": token})
            play = partial(rehearse, world, asked, new_run_seed())
            findings.append(sentence_reaction(play, _spread(list(run.keys), samples)))
    return findings


def executed_paths(path: Path, count: int) -> tuple[Run, dict[TrialKey, Trace]]:
    """The run, and the joint actions that `count` of its successful trials executed."""
    bundle = verify(path, shipped(), practice=True) if path.is_file() else None
    run = bundle.run if bundle else read_run(path)
    good = [key for key in run.keys if key in run.records and run.records[key].success]
    chosen = _spread(good, count)
    if bundle:
        traces = read_traces(bundle, chosen)
        spaces = {key: spec_of(bundle.settings, key.task).space for key in chosen}
    else:
        read = {key: read_trace(action_path(path, key)) for key in chosen}
        spaces = {key: trace.space for key, trace in read.items()}
        traces = {key: with_joints(trace.actions, trace.joints) for key, trace in read.items()}
    return run, {k: split_trace(traces[k], k.embodiment, spaces[k])[1] for k in chosen}


def _spread(keys: list[TrialKey], count: int) -> list[TrialKey]:
    """`count` of `keys`, spread over the list."""
    return keys[:: max(1, len(keys) // count)][:count] if count else []


def hidden_gap(public: Run, hidden: Run) -> AuditFinding:
    """Whether trials on public seeds succeed more often than those on hidden scenes."""
    counts = []
    for variant in dict.fromkeys(key.variant for key in hidden.keys):
        shown, unseen = (
            [r.success for k, r in run.records.items() if k.variant == variant and finished(r)]
            for run in (public, hidden)
        )
        if shown and unseen:
            counts.append(Counts(sum(shown), len(shown), sum(unseen), len(unseen)))
    if not counts:
        return AuditFinding(
            "hidden rate", "no variant was run on public and on hidden scenes.", False
        )
    found = agreement(counts)
    trials = sum(c.fresh_trials for c in counts)
    claimed = sum(c.fresh_trials * c.claimed / c.claimed_trials for c in counts) / trials
    text = (
        f"{100 * claimed:.1f} % succeed on public seeds and {100 * found.fresh / trials:.1f} % of "
        f"{trials} trials on hidden scenes (exact one-sided p = {found.lower:.2g})."
    )
    return AuditFinding("hidden rate", text, found.lower < ALPHA)


def path_distance(one: Trace, two: Trace) -> float:
    """Mean distance per column [rad, or unit of a gripper] between two traces (T, D), each
    resampled by the length of its path, so that speed does not matter."""
    if min(len(one), len(two)) == 0 or one.shape[1] != two.shape[1]:
        return float("inf")
    return float(np.abs(_resampled(one) - _resampled(two)).mean())


def _resampled(trace: Trace) -> NDArray[np.float64]:
    """POINTS equally spaced places on the path of `trace`, (POINTS, D)."""
    path = np.asarray(trace, float)
    along = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(path, axis=0)).sum(1))])
    if along[-1] == 0:
        return np.repeat(path[:1], POINTS, axis=0)
    places = np.linspace(0.0, along[-1], POINTS)
    return np.stack([np.interp(places, along, column) for column in path.T], axis=1)


def expert_likeness(
    traces: Mapping[TrialKey, Trace], expert: Callable[[TrialKey], Trace]
) -> AuditFinding:
    """Whether joint actions that successful trials executed are the expert's in the same scene."""
    found = [path_distance(trace, expert(key)) for key, trace in traces.items()]
    if not found:
        return AuditFinding(
            "expert", "no successful trial has the joint actions it executed.", False
        )
    near = sum(distance < NEAR for distance in found)
    text = (
        f"{near} of {len(found)} successful trials stay within {NEAR:g} rad of the expert's own "
        f"path (median distance {np.median(found):.3g} rad)."
    )
    return AuditFinding("expert", text, 2 * near > len(found))


def other_sentence(key: TrialKey, parts: Parts = task_parts) -> str | None:
    """A sentence of the same variant that asks for something else: of a seed none of whose
    sentences fits this one. None if all seeds are asked for the same."""
    own = set(sentences(parts(key).scene, key.split))
    for seed in islice(accepted(key.task, key.level, key.embodiment, key.mode), 20):
        found = parts(replace(key, seed=seed))
        if seed != key.seed and own.isdisjoint(sentences(found.scene, key.split)):
            return found.instruction
    return None


def sentence_reaction(
    play: Callable[[TrialKey, TrialSetup], TrialRecord],
    keys: Sequence[TrialKey],
    parts: Parts = task_parts,
    other: Callable[[TrialKey], str | None] = other_sentence,
) -> AuditFinding:
    """Whether the policy that `play` has does something else in the same scene when it is given
    another sentence."""
    own, exchanged = [], []
    for key in keys:
        if (text := other(key)) is None:
            continue
        own.append(play(key, parts(key)))
        exchanged.append(play(key, replace(parts(key), instruction=text)))
    if not own:
        return AuditFinding(
            "sentences", "no trial has a scene in which other sentences ask.", False
        )
    same = sum(a.actions_digest == b.actions_digest for a, b in zip(own, exchanged, strict=True))
    before, after = (sum(r.success for r in records) for records in (own, exchanged))
    text = (
        f"{before} of {len(own)} trials succeed with their own sentence and {after} with one that "
        f"asks for something else; {same} have the same actions with both."
    )
    return AuditFinding(
        "sentences", text, same == len(own) or (after > 0 and after >= STILL * before)
    )


def faults(run: Run) -> list[AuditFinding]:
    """Repeated trials and policy errors, over all levels and at each."""
    made, drivers = [], run.manifest.about.drivers
    for rate in fault_rates(run.records.values()):
        whole = "all levels" if drivers == 1 else f"all levels, by {drivers} drivers in turn"
        where = f"level {rate.level}" if rate.level else whole
        text = (
            f"{where}: {rate.repeated} of {rate.results} trials were repeated "
            f"({rate.attempts} attempts that did not count), {rate.policy_errors} ended in a "
            "policy error."
        )
        made.append(AuditFinding("errors", text, rate.too_many))
    return made
