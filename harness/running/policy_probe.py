"""The policies of a run: one for all tasks, or one for each, probed before anything is written.

A map from base task to policy is a JSON file, {"Pick_Blocks_Size": "ws://gpu1:8000", ...}: the
paper's protocol trains one checkpoint per base task, so one "model" is as many servers. Where one
server is not enough there may be a list of them, which have to be replicas of one policy.
"""

from __future__ import annotations

import time
from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robospa.harness.clock.policy_clock import PolicyClock
from robospa.harness.factory import is_url, open_policy
from robospa.harness.robots import embodiment
from robospa.observation import CAMERAS
from robospa.protocol.client import Identity, identity_of
from robospa.protocol.conformance import synthetic_observation, trial_for
from robospa.protocol.errors import PolicyError, TransportError
from robospa.protocol.policy import CALLED, POINT, Policy, PolicySpec, has
from robospa.results.records.manifest import PolicySettings, RunError
from robospa.schema import parse_json
from robospa.tasks.catalog import task as find_task
from robospa.text import some
from robospa.trial import TrialKey

if TYPE_CHECKING:
    from robospa.harness.running.worker import Targets, WorkerConfig

SECOND_LOOK = 1.1
"""[s] between two greetings of one server: a clock in whole seconds differs by then."""


@dataclass(frozen=True)
class ProbedPolicy:
    """A policy that has answered: `hello` is its greeting, or says that it runs in process.

    `replicas` are further servers of the same policy.
    """

    target: str
    spec: PolicySpec
    hello: Mapping[str, Any]
    replicas: tuple[ProbedPolicy, ...] = ()
    volatile: frozenset[str] = frozenset()
    """Names in its greeting that changed from one connection to the next."""
    hints: tuple[str, ...] = ()
    """What its first actions look as if they got wrong, a sentence each."""

    @property
    def identity(self) -> Identity:
        """Who it is; the same at every connection."""
        return identity_of({**self.hello, "spec": self.spec.to_json()}, self.volatile)

    def settings(self) -> PolicySettings:
        """What of it decides a result."""
        hello = self.hello
        return PolicySettings(self.spec.to_json(), hello.get("dialect"), hello.get("options", {}))


def read_map(file: Path, tasks: Sequence[str], known: Collection[str]) -> dict[str, Targets]:
    """The policy of every task in `tasks`, or its policies, from the JSON `file`.

    Raises RunError if the file is no such map, names a task that does not exist, or lacks one.
    """
    try:
        found = parse_json(file.read_text())
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise RunError(f"--policy-map {file} cannot be read: {why}") from error
    if not isinstance(found, dict) or not all(map(_is_targets, found.values())):
        raise RunError(
            f"--policy-map {file} is no map from tasks to URLs: write "
            '{"Pick_Blocks_Size": "ws://host:8000", ...}, or a list of different URLs for a task'
        )
    if unknown := [task for task in found if task not in known]:
        names = some([name[:80] for name in unknown])
        raise RunError(f"--policy-map {file} names tasks that do not exist: {names}")
    if missing := [task for task in tasks if task not in found]:
        raise RunError(
            f"--policy-map {file} has no policy for {some(missing)}; add them or choose fewer "
            "--tasks"
        )
    return {t: v if isinstance(v := found[t], str) else tuple(v) for t in tasks}


def _is_targets(value: object) -> bool:
    if not isinstance(value, list):
        return bool(value) and isinstance(value, str)
    return all(v and isinstance(v, str) for v in value) and len(set(value)) == len(value) > 0


def probe(
    target: str, given: Mapping[str, Any], wait: float = 0.0, look: bool = False
) -> ProbedPolicy:
    """The policy at `target`, after at most `wait` s of nobody listening; `look`: at its first
    actions, too. One that does not answer says so in its trials.

    Raises what connecting raises, and RunError if a server of another project answers an error: its
    names or shapes are not those that its dialect's options say.
    """
    options = dict(given)
    if "timeouts" in options:
        options["timeouts"] = replace(options["timeouts"], wait=wait)
    policy = open_policy(target, options)
    hello = dict(policy.hello) if has(policy, "hello") else {"dialect": "in process"}
    hints: list[str] = []
    try:
        if look:
            from robospa.harness.convention_check import initial_actions

            if hello["dialect"] not in ("in process", "robospa.v1"):
                _ask_once(policy, target)
            with suppress(Exception):
                hints, _ = initial_actions.hints(policy)
    finally:
        if has(policy, "close"):
            policy.close()
    return ProbedPolicy(target, policy.spec, hello, hints=tuple(hints))


def _ask_once(policy: Policy, target: str) -> None:
    trial, seen = trial_for(policy.spec), synthetic_observation(policy.spec)
    with suppress(TransportError):
        try:
            policy.reset(trial)
            policy.infer(seen)
        except PolicyError as error:
            raise RunError(
                f"{target} cannot answer an observation of this form, and no trial was begun: "
                f"{error}; see the options of its dialect in docs/clients.md"
            ) from error


def probe_policies(
    config: WorkerConfig, keys: Sequence[TrialKey], wait: float = 0.0, look: bool = False
) -> dict[str, ProbedPolicy]:
    """The policy of every task of `keys`, each server asked once; `look`: at first actions, too.

    Raises what connecting raises, and RunError if one does not drive the embodiment asked for or
    if those of one task differ.
    """
    tasks = list(dict.fromkeys(key.task for key in keys))
    targets = dict.fromkeys(target for task in tasks for target in config.targets(task))
    seen = without_volatile(
        {target: probe(target, config.options, wait, look) for target in targets}, config.options
    )
    found: dict[str, ProbedPolicy] = {}
    for task in tasks:
        servers = [seen[target] for target in config.targets(task)]
        found[task] = combine_replicas(servers, task if config.policies else "")
        check_fit(found[task], [key for key in keys if key.task == task])
    return found


def without_volatile(
    seen: Mapping[str, ProbedPolicy], options: Mapping[str, Any]
) -> dict[str, ProbedPolicy]:
    """The probed policies, each with the names that differ in its second greeting.

    Only servers that say more of themselves than a protocol fixes are greeted again.
    """
    talkative = [t for t, p in seen.items() if is_url(t) and any(p.identity.own_parts())]
    if talkative:
        time.sleep(SECOND_LOOK)
    found = dict(seen)
    for target in talkative:
        again = probe(target, options)
        repeated = seen[target].identity.repeated_in(again.identity)
        found[target] = replace(seen[target], volatile=repeated.volatile)
    return found


def combine_replicas(servers: Sequence[ProbedPolicy], task: str = "") -> ProbedPolicy:
    """The first of `servers` with the others as replicas; raises RunError if one differs."""
    first, *others = servers
    expected = _flat(first)
    for other in others:
        found = _flat(other)
        changes = [
            f"{name} is {expected.get(name, 'unset')!r} and {found.get(name, 'unset')!r}"
            for name in sorted({*expected, *found})
            if expected.get(name, "unset") != found.get(name, "unset")
        ]
        if changes:
            where = f" of {task}" if task else ""
            raise RunError(
                f"the policy servers {first.target} and {other.target}{where} are not the same: "
                f"{'; '.join(changes)}; start both with the same options, or give each its own "
                "tasks with --policy-map"
            )
    return replace(first, replicas=tuple(others))


def _flat(policy: ProbedPolicy) -> dict[str, object]:
    """Settings and what names its checkpoint, by dotted name, without what may differ: how many
    observations one call holds."""
    settings = policy.settings()
    spec = {f"spec.{name}": v for name, v in settings.spec.items() if name != "batch"}
    told = {"dialect": settings.dialect, "options": settings.options}
    return {**dict(policy.identity.checkpoints()), **told, **spec}


def check_fit(policy: ProbedPolicy, keys: Sequence[TrialKey]) -> None:
    """Raises RunError if the policy does not drive a robot that is asked for, if its actions have
    another number of columns, or if it asks for a camera that there is not."""
    spec = policy.spec
    if unknown := [camera.name for camera in spec.cameras if camera.name not in CAMERAS]:
        raise RunError(
            f"the policy {spec.name!r} asks for the camera {unknown[0]!r}; there are "
            f"{', '.join(CAMERAS)}"
        )
    asked = {key.task: find_task(key.task).dimension for key in keys if spec.action == POINT}
    if task := next((name for name, kind in asked.items() if kind == "procedural"), ""):
        raise RunError(
            f"the policy {spec.name!r} answers a point, and {task} asks for more than that: choose "
            "--tasks spatial,basic"
        )
    has_option = "embodiment" in dict(policy.hello.get("options", {}))
    for robot in sorted({key.embodiment for key in keys}):
        if spec.embodiments and robot not in spec.embodiments:
            option = f", or write ?embodiment={robot} if it was trained with that" * has_option
            raise RunError(
                f"the policy {spec.name!r} drives {', '.join(spec.embodiments)}, not {robot}; "
                f"choose another --embodiment{option}"
            )
        space = embodiment(robot).action_space(spec.executed)
        if spec.action_dim not in (None, space.width):
            raise RunError(
                f"the policy {spec.name!r} answers {spec.action_dim} numbers per action, but a "
                f"{spec.action} action of {robot} has {space.width}: it cannot drive that robot"
            )


def check_blind(policies: Iterable[ProbedPolicy]) -> None:
    """Raises RunError if a policy of a run on hidden scenes could learn what a scene holds."""
    for policy in policies:
        spec = policy.spec
        if not is_url(policy.target):
            raise RunError(
                f"{policy.target} runs in the process that knows the secret of the hidden scenes: "
                "serve it somewhere else and give the URL of its server"
            )
        if spec.sees_state or spec.needs_trial_key:
            asks = "the exact state" if spec.sees_state else "the key of every trial"
            raise RunError(
                f"the policy {spec.name!r} asks for {asks}, which a run on hidden scenes gives to "
                "none: let it act on what it sees"
            )


def check_clock(clock: PolicyClock | None, specs: Iterable[PolicySpec]) -> None:
    """Raises RunError if a policy's chunks cannot follow each other as `clock` says."""
    for spec in specs:
        if clock is not None and spec.action in CALLED:
            raise RunError(
                f"the policy {spec.name!r} answers calls of skills, which take as long as they "
                "take: leave out --clock"
            )
        if clock is not None and clock.switching.kind == "ensemble" and spec.action != "joint":
            raise RunError(
                f"the policy {spec.name!r} answers {spec.action} actions, whose mean is no pose: "
                "an ensemble takes joint actions, so choose another --switch"
            )
        if clock is not None and clock.switching.kind == "rtc" and not spec.committed_actions:
            raise RunError(
                f"the policy {spec.name!r} does not read the actions that are committed while it "
                "computes, which real-time chunking needs: serve one whose spec has "
                f"committed_actions, or choose --switch after:{clock.switching.after}"
            )


def warnings_of(
    policies: Mapping[str, ProbedPolicy], instructions: Mapping[str, str], step_scale: float
) -> list[str]:
    """Everything that a user should know before the first trial, once each.

    `instructions` has one of every task.
    """
    found: list[str] = []
    if step_scale != 1:
        found.append(
            f"step limits are {step_scale:g} times the official ones: the results are not "
            "comparable with those of other runs"
        )
    budgets: dict[int, dict[str, str]] = {}
    for task, policy in policies.items():
        found += [
            f"{server.target} does not say which checkpoint it serves: another one in its place "
            "would go unnoticed; name it in the `checkpoint` of its PolicySpec, or in its metadata"
            for server in (policy, *policy.replicas)
            if is_url(server.target) and not server.identity.checkpoint
        ]
        for other in policy.replicas:
            first, second = policy.hello.get("server"), other.hello.get("server")
            if first != second:
                found.append(
                    f"{policy.target} calls itself {first!r} and {other.target} {second!r}: make "
                    "sure that both serve the same checkpoint"
                )
        found += [str(text) for text in policy.hello.get("warnings", ())]
        found += [f"{p.target}: {text}" for p in (policy, *policy.replicas) for text in p.hints]
        if (budget := policy.spec.text_budget) is not None:
            budgets.setdefault(budget, {})[task] = instructions.get(task, "")
    if budgets:
        from robospa.clients.chunks import budget_warning

        found += [
            text
            for budget, texts in budgets.items()
            if (text := budget_warning(budget, texts)) is not None
        ]
    return list(dict.fromkeys(found))


def over_budget(spec: PolicySpec, instruction: str) -> dict[str, int] | None:
    """What a trial's record keeps if its instruction was too long for the model to read whole."""
    budget = spec.text_budget
    if budget is None:
        return None
    from robospa.clients.chunks import least_tokens

    count = least_tokens(instruction)
    return {"instruction_tokens": count, "text_budget": budget} if count > budget else None
