"""What a bundle's run may be: the settings that count, seeds that are listed, scenes and sentences.

The same rules are applied when a run is packed and when a bundle is read. They are held against a
`Reference`: `shipped()` is the benchmark as installed; a test or a benchmark of the verifier brings
its own.
"""

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache, partial
from itertools import groupby

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import KINDS
from robospa.harness.factory import load_function
from robospa.harness.pool import JobProcess, Pool
from robospa.harness.running.worker import task_finder
from robospa.harness.trial import new_run_seed
from robospa.harness.worlds import SAPIEN_NAME, TASK_PARTS
from robospa.leaderboard.bundle import BundleError, canonical
from robospa.leaderboard.card import Card
from robospa.leaderboard.traces import Trace
from robospa.results.records.manifest import (
    PolicySpecification,
    RunManifest,
    RunSettings,
    departures,
)
from robospa.results.records.trial_record import TrialRecord
from robospa.schema import read
from robospa.tasks.instructions import SPLITS
from robospa.tasks.scene import SUITE
from robospa.tasks.task import Task
from robospa.trial import REFERENCE, TrialKey

LEVELS = (1, 2, 3, 4, 5)
Durations = Callable[[str, Trace], NDArray[np.int64]]
"""(robot, joint actions) -> the physics steps of each."""


@dataclass(frozen=True)
class Reference:
    """`seeds` of a task, level, robot and scene mode, and the `task` of a name and level, raise
    LookupError if there are none. `members` are the tasks of a category. `world` and `parts` are
    `module:function` paths: the only world whose runs count, and what finds a trial's scene and
    goal. `durations` finds the physics steps of a trial's joint actions; None if
    nothing is known of the world."""

    seeds: Callable[[str, int, str, str], Sequence[int]]
    task: Callable[[str, int], Task]
    members: Callable[[str], Collection[str]]
    world: str = SAPIEN_NAME
    parts: str = TASK_PARTS
    robots: Sequence[str] = (REFERENCE,)
    modes: Sequence[str] = ("clean",)
    durations: Durations | None = None


def shipped(world: str | None = None, parts: str | None = None) -> Reference:
    """The installed benchmark; `world` and `parts` replace where trials run and what they ask."""
    from robospa.harness.robots import embodiments
    from robospa.leaderboard.traces import durations
    from robospa.tasks.catalog import tasks
    from robospa.tasks.modes import modes
    from robospa.tasks.seeds import accepted

    def members(category: str) -> list[str]:
        return [t.name for t in tasks().values() if t.category == category]

    return Reference(
        accepted,
        tasks_of(parts or TASK_PARTS),
        members,
        world or SAPIEN_NAME,
        parts or TASK_PARTS,
        robots=embodiments(),
        modes=modes(),
        durations=None if world else durations,
    )


def tasks_of(parts: str) -> Callable[[str, int], Task]:
    """A function (task, level) -> its task, from what `parts` (`module:function`) finds."""
    find = task_finder(parts)

    @cache
    def task(name: str, level: int) -> Task:
        found = find(TrialKey(name, level, 0))
        if found.name != name or level not in found.levels:
            raise LookupError(f"there is no task {name!r} of level {level}")
        return found

    return task


SPACES = tuple(dict.fromkeys((*KINDS, "skill")))
"""What a policy may answer in: points move nothing, so that nothing could be replayed."""
CONTROLS = ("rest_to_rest",)
"""Ways of executing an action that the benchmark's numbers are made with."""
ONE = ("embodiment", "mode", "split")
VERSIONS = {
    "robospa": r"[0-9]+\.[0-9][^ ]{0,40}",
    "python": r"3\.[1-9][0-9]\.[^ ]{1,20}",
    "numpy": r"[12]\.[0-9][^ ]{0,20}",
    "sapien": r"3\.0\.[^ ]{1,20}",
}
"""What a run has to say of its software, as far as ours runs with it."""
MOST_SAID = 20_000
"""Bytes of what a run says of software, machine, world and warnings, or of a policy."""


def manifest_of(data: object, what: str = "the run") -> RunManifest:
    """`data` (a decoded run.json) as a manifest, or BundleError."""
    return read(RunManifest, data, what, BundleError)


def spec_of(settings: RunSettings, task: str) -> PolicySpecification:
    """The specification of the policy that did `task`; BundleError if the settings hold none."""
    policy = settings.policies.get(task) if settings.policies else settings.policy
    if policy is None:
        raise BundleError(f"the run's settings hold no policy spec for {task}")
    return policy.stated


def check_settings(run: RunManifest, reference: Reference) -> RunSettings:
    """The settings of `run`; BundleError if it is one that cannot enter."""
    settings = run.settings
    for name in ONE:
        if len(getattr(settings, name)) != 1:
            raise BundleError(f"the run mixes {name}s or names none; a bundle has one")
    _check_about(run)
    if settings.world.arguments.get("control", CONTROLS[0]) not in CONTROLS:
        raise BundleError(
            "the run executes actions at a fixed rate; the benchmark moves from rest to rest"
        )
    if run.suite != SUITE:
        raise BundleError(
            f"the run is of the suite {run.suite[:40]!a}; this robospa has "
            f"{SUITE!r}: verify it with the version that it was made with"
        )
    for name, known in (
        ("embodiment", reference.robots),
        ("mode", reference.modes),
        ("split", SPLITS),
    ):
        if (value := getattr(settings, name)[0]) not in known:
            raise BundleError(
                f"the run's {name} is {value[:60]!a}, which is not known here: there is "
                f"{', '.join(known)}"
            )
    if extra := sorted(set(settings.policies) - set(run.categories)):
        raise BundleError(f"the run has a policy for {extra[0][:60]!a}, but no trials of it")
    if len(run.tracks) > 1:
        raise BundleError(f"the run mixes the tracks {' and '.join(run.tracks)}; a bundle has one")
    for stated in settings.stated:
        if stated.space not in KINDS:
            raise BundleError(
                f"the run's policy spec: 'action' must be one of {', '.join(SPACES)}, not "
                f"{stated.action[:40]!a}"
            )
    if found := departures(run):
        raise BundleError(f"the run departs from the benchmark, {found[0]}")
    if settings.run_seed != 0 and len(str(settings.run_seed)) != len(new_run_seed()):
        raise BundleError(
            f"the run's seed, {settings.run_seed}, was given; in a submission it is the run's own, "
            "which nobody could choose for its luck or guess"
        )
    if settings.world.name != reference.world:
        raise BundleError("the run was made in another world than the benchmark's simulator")
    return settings


def _check_about(run: RunManifest) -> None:
    """BundleError for software, machine or warnings that no run of ours has."""
    about = run.about
    for name, known in VERSIONS.items():
        if not re.fullmatch(known, about.versions.get(name, "")):
            said = ascii(about.versions.get(name, "nothing"))[:40]
            raise BundleError(f"the run says {said} of its version of {name}, which cannot be")
    cores = about.machine.get("cores", 1)
    if not re.fullmatch("[0-9a-f]{16}", about.code) or type(cores) is not int or cores < 1:
        raise BundleError("the run has a hash of its code, or cores of its machine, that cannot be")
    told = (about, run.settings.policy, *run.settings.policies.values())
    if (size := max(len(canonical(one)) for one in told)) > MOST_SAID:
        raise BundleError(f"the run says {size} bytes of itself; {MOST_SAID} are the most")


def check_card_fits(card: Card, settings: RunSettings, task: str) -> None:
    """BundleError if card and policy spec disagree about the actions of `task`."""
    spec = spec_of(settings, task)
    for name, stated, used in (
        ("space", card.actions.space, spec.action),
        ("chunk", card.actions.chunk, spec.horizon),
    ):
        if used not in (None, stated):  # a length that no server declared cannot be compared
            raise BundleError(
                f"the model card says {name} = {stated!r}, but the policy that did {task} has "
                f"{str(used)[:40]!a}"
            )


def check_seeds(keys: Sequence[TrialKey], reference: Reference, practice: bool) -> None:
    """BundleError unless `keys` are the listed seeds of whole categories, once each: of all their
    tasks and levels that have a list for this robot and these scenes.

    For practice the first few seeds of any variants are enough.
    """
    if not keys:
        raise BundleError("there is not a single trial")
    robot, mode = keys[0].embodiment, keys[0].mode
    seeds: dict[tuple[str, int], list[int]] = {}
    for key in keys:
        seeds.setdefault(key.variant, []).append(key.seed)
    for (task, level), found in seeds.items():
        where = f"{task} L{level}"
        try:
            category = reference.task(task, level).category
            listed = list(reference.seeds(task, level, robot, mode))
        except LookupError:
            raise BundleError(
                f"{where[:80]!a} is no variant with a list of seeds for {robot} in {mode} scenes"
            ) from None
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
                    if (other, step) not in seeds and _listed(reference, other, step, robot, mode):
                        raise BundleError(
                            f"the run is incomplete: it has {where} but not {other} L{step}; "
                            "every task and level of a category belongs to it"
                        )


def _listed(reference: Reference, task: str, level: int, robot: str, mode: str) -> bool:
    try:
        return bool(reference.seeds(task, level, robot, mode))
    except LookupError:
        return False


FEW = 500
"""So many trials are made here: other processes would take longer to start."""
Claim = tuple[TrialKey, str, str]
"""A trial, the digest of its scene and its sentence, as a record has them."""
Done = Callable[[int, int], None]
"""Called with how many of how many trials were looked at."""


def check_scenes(
    records: Mapping[TrialKey, TrialRecord],
    parts: str,
    workers: int = 1,
    done: Done = lambda count, trials: None,
) -> None:
    """BundleError for the first of `records` whose scene or sentence is not the one that `parts`
    (`module:function`) makes of its key."""
    claims = [(key, r.scene_digest, r.instruction) for key, r in records.items()]
    variants = [list(group) for _, group in groupby(claims, lambda claim: claim[0].variant)]
    wrong: Iterable[str] = (first_wrong(parts, found) for found in variants)
    with ExitStack() as stack:
        if workers > 1 and len(claims) > FEW:
            start = partial(JobProcess, _checker, parts, name="scenes")
            pool = stack.enter_context(Pool[Sequence[Claim], str](start, workers))
            futures = [pool.submit(found) for found in variants]
            wrong = (future.result() for future in futures)
        count = 0
        for text, found in zip(wrong, variants, strict=True):
            if text:
                raise BundleError(text)
            count += len(found)
            done(count, len(claims))


def _checker(parts: str) -> Callable[[Sequence[Claim]], str]:
    return partial(first_wrong, parts)


def first_wrong(parts: str, claims: Sequence[Claim]) -> str:
    """What is wrong with the first of `claims` that is; "" if none is."""
    find = load_function(parts)
    for key, digest, sentence in claims:
        try:
            found = find(key)
        except (LookupError, ValueError) as error:
            return f"{key.slug} is no trial of this suite: {' '.join(str(error).split())[:120]}"
        for what, claimed, right in (
            ("scene", digest, found.scene.digest),
            ("sentence", sentence, found.instruction),
        ):
            if claimed != right:
                return f"{key.slug} has another {what} ({claimed[:60]!a}, not {right[:60]!a})"
    return ""
