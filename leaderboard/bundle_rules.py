"""What a bundle says about its run: settings that count, seeds that are listed, facts that hold.

The same rules are applied when a run is packed and when a bundle is read.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from robospa.action_space import KINDS
from robospa.harness.trial import policy_seed
from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.reference import LEVELS, Reference
from robospa.results.records.run_io import finished
from robospa.results.records.trial_record import TrialRecord
from robospa.tasks.events import Event, outcome
from robospa.trial import TrialKey

CONTROLS = ("rest_to_rest",)
"""Ways of executing an action that the benchmark's numbers are made with."""
VERSIONS = ("robospa", "python", "numpy", "sapien")
ONE = ("embodiment", "mode", "split")
COUNT = frozenset(("subtask_done", "subtask_undone", "success", "failed"))
"""Events that decide success and progress."""


def spec_of(settings: Mapping[str, Any], task: str) -> Mapping[str, Any]:
    """The spec of the policy that did `task`; BundleError if the settings hold none."""
    policies = settings.get("policies") or {}
    policy = policies.get(task) if policies else settings.get("policy")
    spec = policy.get("spec") if isinstance(policy, Mapping) else None
    if (
        not isinstance(spec, Mapping)
        or not isinstance(spec.get("name"), str)
        or spec.get("action") not in KINDS
    ):
        raise BundleError(f"the run's settings hold no policy spec for {task}")
    return spec


def check_settings(run: Mapping[str, Any], reference: Reference) -> None:
    """BundleError if the run `run` (as in run.json) is one that cannot enter."""
    settings, about = run.get("settings"), run.get("about")
    if not isinstance(settings, Mapping) or not isinstance(about, Mapping):
        raise BundleError("the run has no settings or does not say where it ran")
    if run.get("suite") != reference.suite:
        raise BundleError(
            f"the run is of the suite {str(run.get('suite'))[:40]!a}; this robospa has "
            f"{reference.suite!r}: verify it with the version that it was made with"
        )
    if settings.get("privileged") is not False or _privileged(settings):
        raise BundleError("the run's policy is privileged: it saw the exact state, not images")
    if settings.get("step_scale", 1.0) != 1.0:
        raise BundleError("the run's step limits are not the official ones")
    if not isinstance(settings.get("run_seed"), int):
        raise BundleError("the run's settings have no run_seed")
    world = settings.get("world")
    if not isinstance(world, Mapping) or world.get("factory") != reference.world:
        raise BundleError("the run was made in another world than the benchmark's simulator")
    if world.get("control", CONTROLS[0]) not in CONTROLS:
        raise BundleError(
            "the run executes actions at a fixed rate; the benchmark moves from rest to rest"
        )
    for name in ONE:
        if not (isinstance(settings.get(name), list) and len(settings[name]) == 1):
            raise BundleError(f"the run mixes {name}s or names none; a bundle has one")
    versions = about.get("versions")
    if not isinstance(versions, Mapping) or not all(
        isinstance(versions.get(name), str) for name in VERSIONS
    ):
        raise BundleError(f"the run does not say its versions of {', '.join(VERSIONS)}")
    if not all(isinstance(about.get(name, {}), Mapping) for name in ("git", "machine", "world")):
        raise BundleError("the run's description of code and machine is malformed")
    if not isinstance(about.get("code"), str):
        raise BundleError("the run does not say which code it was made with")


def _privileged(settings: Mapping[str, Any]) -> bool:
    found = [settings.get("policy"), *dict(settings.get("policies") or {}).values()]
    specs = [p.get("spec") for p in found if isinstance(p, Mapping)]
    return any(isinstance(s, Mapping) and s.get("privileged") for s in specs)


def check_card_fits(card: Mapping[str, Any], settings: Mapping[str, Any], task: str) -> None:
    """BundleError if card and policy spec disagree about the actions of `task`."""
    spec, said = spec_of(settings, task), card["actions"]
    for name, found in (("space", spec["action"]), ("chunk", spec.get("horizon"))):
        if said[name] != found:
            raise BundleError(
                f"the model card says {name} = {said[name]!r}, but the policy that did {task} "
                f"said {found!a}"
            )


def check_seeds(keys: Sequence[TrialKey], reference: Reference, practice: bool) -> None:
    """BundleError unless `keys` are the listed seeds of whole categories, once each.

    For practice the first few seeds of any variants are enough.
    """
    if not keys:
        raise BundleError("there is not a single trial")
    seeds: dict[tuple[str, int], list[int]] = {}
    for key in keys:
        seeds.setdefault(key.variant, []).append(key.seed)
    for (task, level), found in seeds.items():
        where = f"{task} L{level}"
        try:
            category = reference.facts(task, level).category
            listed = list(reference.seeds(task, level))
        except LookupError:
            raise BundleError(f"{where[:80]!a} is no variant with a list of seeds") from None
        known, there = set(listed), set(found)
        if len(there) < len(found):
            twice = Counter(found).most_common(1)[0][0]
            raise BundleError(f"{where} has seed {twice} more than once")
        if strange := [s for s in found if s not in known]:
            raise BundleError(f"{where} has seed {strange[0]}, which is not in the shipped list")
        wanted = listed[: len(found)] if practice else listed
        if missing := [s for s in wanted if s not in there]:
            raise BundleError(
                f"{where} is incomplete: {len(missing)} of its {len(wanted)} listed seeds are "
                f"missing, such as {missing[0]}"
            )
        if not practice:
            for other in reference.members(category):
                for step in LEVELS:
                    if (other, step) not in seeds:
                        raise BundleError(
                            f"the run is incomplete: it has {where} but not {other} L{step}; "
                            "every task and level of a category belongs to it"
                        )


def check_categories(run: Mapping[str, Any], tasks: Sequence[str], reference: Reference) -> None:
    """BundleError unless the run says the category of each of its tasks, and says it right."""
    if run.get("categories") != {t: reference.facts(t, LEVELS[0]).category for t in tasks}:
        raise BundleError("the run's categories are not those of its tasks")


def check_record(record: TrialRecord, reference: Reference, run_seed: int) -> None:
    """BundleError if `record` contradicts its task, its own events, or is no result at all."""
    key = record.key
    if not finished(record):
        raise BundleError(f"{key.slug} is incomplete: the trial was lost and has no result")
    facts = reference.facts(key.task, key.level)
    for name, found, right in (
        ("category", record.category, facts.category),
        ("candidates", record.candidates, facts.candidates),
        ("total", record.total, facts.subtasks),
        ("policy_seed", record.policy_seed, policy_seed(key, run_seed)),
    ):
        if found != right:
            raise BundleError(f"{key.slug}: {name} is {found!a}, not {right!r}")
    if min(record.attempts - 1, record.policy_calls, record.physics_steps, record.wall_time) < 0:
        raise BundleError(f"{key.slug} counts attempts, calls, steps or seconds below zero")
    if not 0 <= record.steps <= facts.steps:
        raise BundleError(f"{key.slug} has {record.steps} actions; the limit is {facts.steps}")
    counted = [Event(0.0, e["kind"], "", e["index"]) for e in record.events if e["kind"] in COUNT]
    told = outcome(counted, record.total)
    claimed = (record.success, record.done, record.best)
    if claimed != (told.success, told.done, told.best):
        raise BundleError(
            f"{key.slug} claims success {record.success}, {record.done} done, {record.best} at "
            f"best; its events say {told.success}, {told.done}, {told.best}"
        )
    if record.success != (record.end == "success"):
        raise BundleError(f"{key.slug} ends in {record.end} and claims success {record.success}")


def check_trace(record: TrialRecord, actions: int, digest: str) -> None:
    """BundleError unless a trial's stored `actions` with this `digest` are what it executed.

    The action for which a policy error was declared was refused, so it may not be stored.
    """
    refused = record.end == "policy_error" and actions == record.steps - 1
    if actions != record.steps and not refused:
        raise BundleError(
            f"{record.key.slug} has {record.steps} actions in its record and {actions} stored"
        )
    if not refused and digest != record.actions_digest:
        raise BundleError(f"{record.key.slug}: the stored actions are not those of its record")
