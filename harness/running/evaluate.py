"""One evaluation from start to finish: probe the policy and the world, fix the trials, run them.

Nothing is written before the policy has answered, the world has been built and the settings fit an
earlier run of the same folder.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from msgspec import structs, to_builtins

from robospa.harness.clock.policy_clock import timed_suite, timing_warning
from robospa.harness.factory import is_url
from robospa.harness.pool import JobProcess, WorkerDied, WorkerStuck
from robospa.harness.progress import Progress, summary
from robospa.harness.running.atomic_file import replace_file, run_lock
from robospa.harness.running.attempts import attempts_spent, earlier_retries
from robospa.harness.running.films import film_lines, films_of, finish_films
from robospa.harness.running.manifest import about_machine, add_processor, check_folder, open_run
from robospa.harness.running.policy_probe import (
    ProbedPolicy,
    check_blind,
    check_clock,
    probe_policies,
    warnings_of,
)
from robospa.harness.running.ray_executor import RayExecutor, loopback_warnings
from robospa.harness.running.record_store import recover_folder, remove_partial_files
from robospa.harness.running.runner import Runner, RunOptions
from robospa.harness.running.status import Status
from robospa.harness.running.tracking import CarefulTracker
from robospa.harness.running.worker import WorkerConfig, describe, load_parts
from robospa.harness.settings import FILE, Compute, EvaluationSettings, to_toml
from robospa.harness.trial import new_run_seed, salt_hash
from robospa.harness.worlds import open_world, world_kind
from robospa.results.records.manifest import (
    ClockSettings,
    RunManifest,
    RunSettings,
    ServerFacts,
    ServerIdentity,
    WorldSettings,
    read_manifest,
)
from robospa.results.records.manifest import make_manifest as new_manifest
from robospa.results.records.runs import finished, lost_actions, read_records
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

PROBE_SECONDS = 120.0
IN_PROCESS = "robospa.evaluate"
"""Where a run says its policy is if that was served for one call only: its address means nothing
afterwards, and its code and weights are those of the calling process."""


@dataclass(frozen=True)
class Request:
    """What to evaluate: `keys` with the policy and world of `config`, as `options` say.

    `settings` are what all of this was made from, saved with the run to be used again;
    `arguments`, and where the `seeds` come from, are only kept in the manifest. `wait`: how long
    the policy's server may take to come up at the start [s]. `look`: whether the first actions of
    a policy are looked at before its trials.
    """

    config: WorkerConfig
    keys: Sequence[TrialKey]
    options: RunOptions = field(default_factory=RunOptions)
    settings: EvaluationSettings | None = None
    arguments: Mapping[str, Any] = field(default_factory=dict)
    seeds: Sequence[Mapping[str, str]] = ()
    resume: bool = False
    wait: float = 0.0
    compute: Compute = field(default_factory=Compute)
    """Where the workers are."""
    in_process: bool = False
    """The policy's server is one of this process, which ends with the run."""
    look: bool = False
    after_trials: Callable[[], bool] = lambda: True
    """Called before the films that a run still owes; False: they are not waited for."""


class WorldBroken(Exception):
    """No world can be built on this machine."""


def world_info(
    asked: tuple[str, Mapping[str, object], bool | None],
) -> Callable[[None], dict[str, Any]]:
    """What asks a world of this kind with these arguments, drawing or not, about itself."""

    def ask(_: None) -> dict[str, Any]:
        try:
            world = open_world(*asked)
            info = dict(world.info())
            world.close()
        except Exception as error:
            raise WorldBroken(describe(error)) from None
        return info

    return ask


def probe_world(config: WorkerConfig, render: bool) -> dict[str, Any]:
    """What a world says about itself, built once in a process of its own.

    Raises WorldBroken: better now than in every trial.
    """
    asked = (config.world, config.world_arguments, True if render else None)
    worker = JobProcess(world_info, asked, seconds=PROBE_SECONDS, name="world")
    advice = "`robospa check` says what is missing"
    try:
        return worker.run(None)
    except WorkerStuck:
        raise WorldBroken(f"the world was not ready after {PROBE_SECONDS:g} s") from None
    except WorkerDied as error:
        raise WorldBroken(f"the simulator crashed while starting ({error}); {advice}") from error
    except WorldBroken as error:
        raise WorldBroken(f"no world can be built: {error}; {advice}") from error
    finally:
        worker.kill()


def make_manifest(request: Request, policies: Mapping[str, ProbedPolicy]) -> RunManifest:
    """The run's manifest, with the policy of every task; the world is built once to describe it."""
    config = request.config
    if request.in_process:
        policies = {task: replace(p, target=IN_PROCESS) for task, p in policies.items()}
    specs = [policy.spec for policy in policies.values()]
    world = probe_world(config, config.video != "none" or _renders(policies))
    parts = load_parts(config)
    first = {key.task: key for key in reversed(list(request.keys))}
    found = {task: parts(key) for task, key in first.items()}
    one, several = next(iter(policies.values())), bool(config.policies)
    instructions = {task: getattr(part, "instruction", "") for task, part in found.items()}
    warnings = warnings_of(policies, instructions, config.step_scale)
    overlap: dict[str, object] = {}
    if (official := config.parts_arguments.get("sentences")) is not None:
        from robospa.harness.official.sentences import report, sentence_of

        overlap = report(official)
        warnings.append(sentence_of(official))
    layout, odd = world_kind(config.world).layout(config.parts_arguments)
    warnings += odd
    steps = world.get("action_steps", config.world_arguments.get("action_steps"))
    suite = timed_suite(next(iter(found.values())).scene.suite, steps)
    if steps is not None:
        warnings.append(timing_warning(suite, steps, config.clock))
    settings = RunSettings(
        **{
            name: tuple(sorted({getattr(key, name) for key in request.keys}))
            for name in ("embodiment", "mode", "split")
        },
        policy=one.settings(),
        privileged=any(spec.sees_state for spec in specs),
        needs_trial_key=any(spec.needs_trial_key for spec in specs),
        run_seed=config.run_seed,
        step_scale=config.step_scale,
        world=WorldSettings(config.world, dict(config.world_arguments)),
        clock=None if config.clock is None else ClockSettings(**config.clock.to_json()),
        salt_sha256=salt_hash(config.salt) if config.salt else "",
        policies={task: p.settings() for task, p in policies.items()} if several else {},
        instructions="" if official is None else official.digest,
        layout=layout,
        profile=request.arguments.get("profile") is not None,
    )
    about = structs.replace(
        about_machine(world),
        policy=_about_policy(one),
        policies={task: _about_policy(p) for task, p in policies.items()} if several else {},
        arguments=dict(request.arguments),
        seeds=[dict(row) for row in request.seeds],
        warnings=warnings,
        instructions=overlap,
    )
    categories = {task: part.task.category for task, part in found.items()}
    return new_manifest(settings, request.keys, about, categories, suite)


def _renders(policies: Mapping[str, ProbedPolicy]) -> bool:
    return any(p.spec.cameras for p in policies.values())


def _about_policy(policy: ProbedPolicy) -> ServerFacts:
    identity = policy.identity
    volatile = sorted(identity.volatile)
    return ServerFacts(
        policy.target,
        dict(policy.hello),
        ServerIdentity(identity.hash, identity.checkpoint, volatile),
        tuple(map(_about_policy, policy.replicas)),
    )


def ready_config(
    config: WorkerConfig, keys: Sequence[TrialKey], policies: Mapping[str, ProbedPolicy]
) -> WorkerConfig:
    """`config` with what its workers have to know of the `policies` that answered, by task."""
    servers = [p for policy in policies.values() for p in (policy, *policy.replicas)]
    return replace(
        config,
        samples=frozenset({key.task: key for key in reversed(list(keys))}.values()),
        expects={p.target: p.spec for p in servers if is_url(p.target)},
        identities={p.target: p.identity for p in servers if is_url(p.target)},
    )


def evaluate(request: Request) -> None:
    """Run every listed trial of `request` that has no result yet.

    Raises what the policy's connection raises, RunError, WorldBroken and RunAborted; on
    KeyboardInterrupt the run stays resumable. FilmsInterrupted is one after the last trial.
    """
    folder = request.config.folder
    check_folder(folder, request.resume)
    look = request.look and not request.resume
    policies = probe_policies(request.config, request.keys, request.wait, look)
    if request.config.salt:
        check_blind(policies.values())
    check_clock(request.config.clock, [policy.spec for policy in policies.values()])
    if not request.config.run_seed:
        seed = str(read_manifest(folder).settings.run_seed) if request.resume else new_run_seed()
        request = replace(request, config=replace(request.config, run_seed=seed))
    manifest = make_manifest(request, policies)
    config = ready_config(request.config, request.keys, policies)
    with ExitStack() as stack:
        executor = None
        if request.compute.executor == "ray":
            executor = RayExecutor(config, request.compute, _renders(policies))
            stack.callback(executor.close)
        lock = stack.enter_context(run_lock(folder))
        recover_folder(folder)
        known = read_records(folder)
        results = {key.task for key, record in known.items() if finished(record)}
        open_run(folder, manifest, request.resume, results)
        if request.settings is not None:
            replace_file(folder / FILE, to_toml(request.settings).encode())
        missing = [key for key in manifest.keys if not finished(known.get(key))]
        total = len(manifest.keys)
        with Progress(total, total - len(missing)) as progress:
            lost = [
                f"{text}; copy them back before this run is replayed"
                for text in lost_actions(folder, known)
            ]
            for text in [*manifest.about.warnings, *lost, *loopback_warnings(executor, config)]:
                progress.note(f"warning: {text}")
            attempts = request.options.attempts
            retries = earlier_retries(known)
            if spent := {k for k in missing if attempts_spent(retries.get(k, ())) >= attempts}:
                missing = [key for key in missing if key not in spent]
                progress.note(
                    f"warning: {len(spent)} trials have had all {attempts} attempts and stay "
                    "missing; more --attempts allow more"
                )
            log = "none" if request.settings is None else request.settings.recording.log
            kept = to_builtins(manifest.settings)
            tracker = CarefulTracker(log, folder, kept, progress.note)
            runner = Runner(config, missing, request.options, on_note=progress.note)
            runner.known = known
            runner.executor = executor
            films = films_of(config, known, request.options.workers if executor is None else 0)
            stack.callback(films.close)

            def add(record: TrialRecord) -> None:
                progress.add(record)
                tracker.add(record)
                films.add([record] if record.video else [])

            def show(status: Status) -> None:
                lock.check(folder)
                films.poll()
                progress.update(replace(status, films=films.pending))

            runner.on_record, runner.on_status = add, show
            runner.on_processor = partial(add_processor, folder)
            try:
                runner.run()
                tracker.finish(folder)
            finally:
                tracker.close()
        for text in summary(runner.times.overall_shares(), runner.status(time.monotonic())):
            progress.note(text)
        films.poll()
        if request.after_trials() and films.pending:
            with progress:
                about_films = finish_films(films, progress)
        else:
            about_films = film_lines(films)
        for text in about_films:
            progress.note(text)
        remove_partial_files(folder)
