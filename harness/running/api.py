"""`robospa.evaluate`: an evaluation as one call, with every setting as a keyword."""

import os
import secrets
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Literal, cast

from robospa.harness.running.evaluate import Request
from robospa.harness.running.evaluate import evaluate as run_request
from robospa.harness.running.request import goes_on, make_request, run_folder
from robospa.harness.settings import EvaluationSettings, SettingsError, read_settings, updated
from robospa.harness.worlds import SAPIEN_NAME
from robospa.protocol.policy import Policy
from robospa.protocol.server import ServerThread
from robospa.results.run import LoadedRun, load_run

PolicyFactory = Callable[[], Policy]


@contextmanager
def _folders_as_before() -> Iterator[None]:
    """A world may name folders of assets and textures in the environment, for its workers; they are
    not those of the next evaluation of this process."""
    from robospa.harness import textures
    from robospa.harness.packs import archive
    from robospa.tasks.packs import pack

    before = {name: os.environ.get(name) for name in (archive.VARIABLE, textures.VARIABLE)}
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value
        pack.cache_clear()


@_folders_as_before()
def evaluate(
    policy: str | Sequence[str] | Policy | PolicyFactory | None = None,
    *,
    tasks: str | Sequence[str] | None = None,
    levels: str | int | Sequence[int] | None = None,
    trials: int | None = None,
    workers: int | None = None,
    out: str | Path | None = None,
    resume: bool | Literal["auto"] = False,
    token: str | None = None,
    config: EvaluationSettings | str | Path | None = None,
    **settings: object,
) -> LoadedRun:
    """Evaluate a policy on a fixed list of seeded trials, and return the run.

        run = robospa.evaluate("ws://gpu:8000", tasks="spatial", levels=[1, 3], trials=20)
        successes = sum(record.success for record in run.records.values())

    Args:
        policy: One of
            the URL of a policy server, or a list of URLs of equal servers;
            the name of an installed policy or "module:Class": every worker makes its own;
            a class or function without arguments that makes policies, one for every worker;
            a policy object.
            The last two stay in this process, which serves them to its workers over loopback, so
            nothing is pickled and a model is loaded once. An object has the state of one trial, so
            it gets one worker unless it has `infer_batch`.
        tasks: Names of tasks, categories or dimensions; "all" by default.
        levels: From 1 to 5; all by default.
        trials: Trials per variant; 100 by default.
        workers: Worker processes; by default, or 0, as many as keep the cores busy.
        out: Folder of the run; by default a new one under `runs`.
        resume: Continue the run in `out`; "auto": if there is one, else start it.
        token: Bearer token of the policy's servers; kept nowhere.
        config: Settings, or a file of them, that the other arguments win over.
        settings: Any other setting of `robospa eval`, such as video="failures" or timeout=30.

    Returns:
        What `robospa.load_run(out)` returns. Trials that could not be run are in `missing`.

    Raises:
        SettingsError: A setting is unknown or impossible; nothing was written.
        RunError: `out` holds another run, or what it holds cannot be read.
        RunAborted: The run stopped; what is finished is kept, and `resume` continues it.
        WireError: No policy server answers at the URL, or not as the protocol requires.
    """
    named = {"tasks": tasks, "levels": levels, "trials": trials, "workers": workers, "out": out}
    given = {name: value for name, value in named.items() if value is not None}
    asked = updated(_base(config), {**given, **settings})
    going = goes_on(resume, asked.out)
    mapped = settings.get("policy_map")
    if policy is None or isinstance(policy, str | Sequence):
        if policy is not None:
            asked = updated(asked, {"policy": policy, "policy_map": mapped})
        elif mapped is not None:
            asked = replace(asked, policy=())
        request = make_request(asked, token=token, resume=going)
        run_request(_returning(request))
        return load_run(request.config.folder)
    if token is not None:
        raise SettingsError("token goes with policy servers, and this policy is in this process")
    if mapped is not None:
        raise SettingsError("give the policy or policy_map, not both")
    instance, factory = _object_or_factory(policy)
    asked = _for_one_process(policy, instance, asked, going)
    secret = secrets.token_urlsafe()
    with ServerThread(instance, policy_factory=factory, token=secret) as server:
        request = make_request(replace(asked, policy=(server.url,)), token=secret, resume=going)
        # The address ends with this call: whoever uses these settings again names a policy.
        run_request(_returning(replace(request, settings=asked, in_process=True)))
    return load_run(request.config.folder)


def _returning(request: Request) -> Request:
    """`request` without the wait for films that can be made later as well."""
    return replace(request, after_trials=lambda: request.config.world != SAPIEN_NAME)


def _base(config: EvaluationSettings | str | Path | None) -> EvaluationSettings:
    if config is None:
        return EvaluationSettings()
    return config if isinstance(config, EvaluationSettings) else read_settings(Path(config))


def _object_or_factory(
    policy: Policy | PolicyFactory,
) -> tuple[Policy | None, PolicyFactory | None]:
    """`policy` as an object or as what makes one; raises SettingsError if it is neither.

    A class has the methods of its objects, so they do not tell them apart.
    """
    if not isinstance(policy, type) and hasattr(policy, "infer"):
        return cast(Policy, policy), None
    if callable(policy):
        return None, policy
    raise SettingsError(
        f"a {type(policy).__name__} is no policy: give a URL, a name, a class, a function that "
        "makes a policy, or an object with spec, reset and infer"
    )


def _for_one_process(
    policy: Policy | PolicyFactory,
    instance: Policy | None,
    settings: EvaluationSettings,
    resume: bool,
) -> EvaluationSettings:
    """`settings` for a policy of this process; raises SettingsError if they do not fit one."""
    compute = settings.compute
    if compute.executor != "local":
        raise SettingsError("a policy in this process has its workers here: executor must be local")
    if instance is not None and not hasattr(instance, "infer_batch"):
        if compute.workers > 1:
            raise SettingsError(
                f"workers is {compute.workers}, but a policy object has the state of one trial: "
                "give its class, give it infer_batch, or leave workers out"
            )
        compute = replace(compute, workers=1)
    name = getattr(policy, "__name__", type(policy).__name__)
    folder = run_folder(replace(settings, policy=(name,)), resume)
    return replace(settings, policy=(), policy_map=None, out=folder, compute=compute)
