"""The settings of an evaluation: one definition for the command line, a file and the driver.

Every field is a flag of `robospa eval`, a key of a settings file, a keyword of `robospa.evaluate`,
and an entry of what a run keeps. Its name is unique among all groups, so flags and keywords need no
group. Secrets are no settings: a server's token is passed beside them and written nowhere.

A file is TOML or JSON, one table a group; what it does not name has its default. Paths in it are
relative to the folder in which the command runs, as on the command line.
"""

import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, TypeVar

from msgspec import Meta

from robospa.harness.clock.policy_clock import Timing
from robospa.harness.world import ROBOT_ASSETS
from robospa.observation import CAMERAS
from robospa.protocol.options import check_ranges, option, plain_options, read_options
from robospa.registry import did_you_mean
from robospa.results.records.manifest import RUN_SEED
from robospa.trial import REFERENCE

CONTROLS = ("rest_to_rest", "fixed_rate")
EXECUTORS = ("local", "ray")
SPLITS = ("heldout", "train", "indirect")
VIDEO = ("none", "failures", "first", "all")
POLICY_ERRORS = ("stop", "count")
TRACKERS = ("none", "wandb")
"""What else a run may be logged to."""
MOST_ATTEMPTS = 10
"""A trial with more would say more of its luck than of its policy."""
MOST_HELD = 8
"""Trials of one worker at once: each has a simulator's scene of its own."""
LEAST_STUCK_SECONDS = 3.0
"""A worker tells once a second that it gets on; fewer of these seconds would be no evidence."""
WEEK = 7 * 24 * 3600
"""[s] The longest that anything may take."""
Seconds = Annotated[float, Meta(gt=0, le=WEEK)]
Pause = Annotated[float, Meta(ge=0, le=WEEK)]
"""Seconds that may be none."""
Trials = Annotated[int, Meta(ge=1, le=1_000_000)]
Attempts = Annotated[int, Meta(ge=1, le=MOST_ATTEMPTS)]
Workers = Annotated[int, Meta(ge=0, le=100_000)]
Scale = Annotated[float, Meta(gt=0, le=100)]
Share = Annotated[float, Meta(gt=0, le=1024)]

Value = bool | int | float | str | list[str] | None
"""A setting in JSON."""
G = TypeVar("G")


LISTS = ("tasks", "levels", "seeds", "embodiment", "mode", "split", "cameras", "profile")
"""Texts that may also be given as lists: ["GAC", "RPF"] is "GAC,RPF"."""


class SettingsError(ValueError):
    """A setting that is unknown or impossible; the message names it."""


@dataclass(frozen=True)
class Selection:
    """The trials of a run."""

    tasks: str = option(
        "all",
        "task names, categories (GAC), spatial, procedural, basic, or all (without basic)",
    )
    levels: str = option("1-5", "such as 1,3-5")
    trials: Trials = option(100, "trials per variant")
    seeds: str | None = option(
        None, "100000-100099, JSON file or folder; default: the lists of accepted seeds"
    )
    split: str = option(
        "heldout", "instructions: some of heldout, train and indirect, comma separated", SPLITS
    )
    embodiment: str = option(REFERENCE, "robots: names, comma separated, or all")
    mode: str = option(
        "clean", "scene modes: clean, randomized, or parts of it: randomized:light,clutter"
    )
    profile: str | None = option(
        None,
        "what each axis costs, beside clean scenes of the same seeds: all, words, eyes, hands, "
        "scene, or axes such as blur,noise=30",
    )
    budget: Trials | None = option(
        None, "with profile: at most so many trials, divided evenly over axes and variants"
    )
    instructions: Path | None = option(
        None,
        "folder of a RoboSPA checkout whose sentences replace ours: those to test with for "
        "heldout, those to train with for train",
    )

    def __post_init__(self) -> None:
        check_values(self)
        _check(
            self.instructions is None or "indirect" not in self.split.split(","),
            "split indirect has no official sentences: leave it or instructions out",
        )
        _check(
            self.profile is None or self.mode == "clean",
            "a profile has scene modes of its own: leave mode out",
        )


@dataclass(frozen=True)
class Simulation:
    """Execution of a trial; part of what decides its result."""

    control: str = option("rest_to_rest", "rest_to_rest or fixed_rate", CONTROLS)
    run_seed: str | None = option(
        None, "what trials' ids and policy seeds follow from; default: a secret of the run's own"
    )
    step_scale: Scale = option(1.0, "multiplies the official step limits; 1 is the benchmark")
    world: str = option(
        "sapien",
        "where trials run: sapien, or official, with official objects and quirks of scenes",
    )
    assets: Path | None = option(
        None, "for the official world: folder of the official archive; else ROBOSPA_ASSETS"
    )
    robot_assets: str = option(
        "builtin",
        "with world official, what robots look like: builtin, official (vendors' meshes, thinned) "
        "or official-full (all their triangles)",
        ROBOT_ASSETS,
    )
    parts: str | None = option(None, "for tests: module:function of a trial's scene and goal")

    def __post_init__(self) -> None:
        check_values(self)
        _check(
            self.run_seed is None or re.fullmatch(RUN_SEED, self.run_seed) is not None,
            f"run_seed {self.run_seed!r} is not 1 to 64 letters and digits",
        )


@dataclass(frozen=True)
class Connection:
    """Connection to policy servers; times in seconds."""

    timeout: Seconds = option(120.0, "seconds for one answer")
    first_timeout: Seconds = option(600.0, "seconds for the first answer")
    wait: Pause = option(0.0, "seconds to wait at the start for the server to listen")
    patience: Pause = option(60.0, "seconds that a worker waits for a server that went away")
    client: Path | None = option(
        None, "TOML or JSON file with options of its dialect; those in the URL win"
    )
    trials_per_worker: Annotated[int, Meta(ge=0, le=MOST_HELD)] = option(
        0,
        "trials that a worker holds at once, each on a connection of its own: one computes while "
        "others wait for answers; 0 for 3 where that is possible, and 1 with --workers 1",
    )

    def __post_init__(self) -> None:
        check_values(self)


@dataclass(frozen=True)
class Retries:
    """Limits of an attempt at a trial, how often it is repeated, and what stops a run."""

    trial_timeout: Seconds = option(1800.0, "seconds for one trial before its worker is killed")
    stuck_timeout: Annotated[float, Meta(ge=LEAST_STUCK_SECONDS, le=WEEK)] = option(
        300.0, "seconds without progress, other than waiting for the policy, before that"
    )
    attempts: Attempts = option(3, "times a trial is tried if it cannot be run, over all --resume")
    backoff: Annotated[float, Meta(ge=0, le=3600)] = option(2.0, "seconds before the first retry")
    policy_errors: str = option(
        "stop",
        "what many trials with the same policy error do: stop the run, or only count as failures",
        POLICY_ERRORS,
    )

    def __post_init__(self) -> None:
        check_values(self)


@dataclass(frozen=True)
class Compute:
    """Processes and machines that trials run on."""

    workers: Workers = option(0, "worker processes; 0 for as many as keep the cores busy")
    executor: str = option(
        "local", "where the workers are: local (here) or ray (a Ray cluster)", EXECUTORS
    )
    address: str | None = option(
        None, "Ray cluster: auto, local (one for this run), HOST:PORT, ray://HOST:PORT"
    )
    cpus_per_worker: Share = option(1.0, "with ray: CPUs of its node that a worker takes")
    gpus_per_worker: Annotated[float, Meta(ge=0, le=64)] = option(
        0.0, "with ray: GPUs, only taken by runs that render; such as 0.1"
    )

    def __post_init__(self) -> None:
        check_values(self)
        _check(self.executor == "ray" or self.address is None, "address goes with executor ray")


@dataclass(frozen=True)
class Recording:
    """Files that a run keeps beside its records."""

    video: str = option(
        "none",
        "trials to film: none, failures (three of each task and type), first (of each task), all",
        VIDEO,
    )
    video_cameras: str = option(
        "third,head", f"what films show, the first large, of {', '.join(CAMERAS)}"
    )
    log: str = option("none", "also log the run to: wandb, or wandb:PROJECT")

    @property
    def cameras(self) -> tuple[str, ...]:
        return tuple(self.video_cameras.split(","))

    def __post_init__(self) -> None:
        check_values(self)
        unknown = [name for name in self.cameras if name not in CAMERAS]
        _check(not unknown, f"video_cameras {unknown} are none of {', '.join(CAMERAS)}")
        name, _, project = self.log.partition(":")
        known = name in TRACKERS and not (name == "none" and project)
        _check(known, f"log {self.log!r} is not one of {', '.join(TRACKERS)}, wandb:PROJECT")


@dataclass(frozen=True)
class EvaluationSettings:
    """All settings of an evaluation, in the groups of a settings file (docs/runs.md lists them).

        settings = EvaluationSettings(policy=("ws://gpu:8000",), out=Path("runs/mine"))
        run = robospa.evaluate(config=settings, tasks="spatial")

    Raises:
        SettingsError: A value is impossible.
    """

    policy: tuple[str, ...] = option((), "URLs of a policy's servers, or one name or module:Class")
    policy_map: Path | None = option(
        None, "JSON file with a URL for every base task, or a list of them"
    )
    out: Path | None = option(None, "folder of the run")
    selection: Selection = field(default_factory=Selection)
    simulation: Simulation = field(default_factory=Simulation)
    timing: Timing = field(default_factory=Timing)
    connection: Connection = field(default_factory=Connection)
    retries: Retries = field(default_factory=Retries)
    compute: Compute = field(default_factory=Compute)
    recording: Recording = field(default_factory=Recording)


GROUPS: dict[str, type] = {
    f.name: f.type for f in fields(EvaluationSettings) if isinstance(f.type, type)
}
"""The groups of EvaluationSettings: tables of a settings file."""


def group_of() -> dict[str, str]:
    """The group of every setting, in their order; empty for those that stand in none."""
    top = {f.name: "" for f in fields(EvaluationSettings) if f.name not in GROUPS}
    return top | {f.name: group for group, kind in GROUPS.items() for f in fields(kind)}


def updated(settings: EvaluationSettings, given: Mapping[str, object]) -> EvaluationSettings:
    """`settings` with the values in `given`, by name without a group.

    Raises SettingsError for a name that is none (with near matches), a value of another type, and
    what is impossible.
    """
    groups = group_of()
    if unknown := next((name for name in given if name not in groups), None):
        near = did_you_mean(unknown, groups)
        raise SettingsError(f"there is no setting {unknown!r}; {near}known are {', '.join(groups)}")
    changes: dict[str, object] = {}
    for group in GROUPS:
        inside = {name: value for name, value in given.items() if groups[name] == group}
        if inside:
            changes[group] = changed(getattr(settings, group), inside)
    top = {name: value for name, value in given.items() if not groups[name]}
    return replace(changed(settings, top), **changes)  # type: ignore[arg-type]


def changed(old: G, given: Mapping[str, object]) -> G:
    """`old` with the values in `given`, each read as its field's type."""
    texts = {name: _text(name, value) for name, value in given.items()}
    # Each entry of a list is one of the choices, not all of it: the group itself checks that.
    lists = {name: text for name, text in texts.items() if name in LISTS and isinstance(text, str)}
    try:
        read = read_options(type(old), {n: value for n, value in texts.items() if n not in lists})
    except SettingsError:
        raise
    except ValueError as error:
        raise SettingsError(str(error)) from error
    values = {name: lists.get(name, getattr(read, name)) for name in given}
    return replace(old, **values)  # type: ignore[type-var]


def _text(name: str, value: object) -> object:
    """`value`, but one text for a list of names or numbers, or a number, where LISTS allow that."""
    if name not in LISTS or value is None or isinstance(value, str):
        return value
    return ",".join(map(str, value)) if isinstance(value, Sequence) else str(value)


def plain(settings: EvaluationSettings) -> dict[str, dict[str, Value]]:
    """All settings as JSON values by group and name; those in no group under ""."""
    top = plain_options(settings)
    own = {name: top[name] for name, group in group_of().items() if not group}
    return {"": own} | {group: plain_options(getattr(settings, group)) for group in GROUPS}


def flat(settings: EvaluationSettings) -> dict[str, Value]:
    """All settings as JSON values by name, without groups."""
    return {name: value for group in plain(settings).values() for name, value in group.items()}


def _check(holds: bool, sentence: str) -> None:
    if not holds:
        raise SettingsError(sentence)


def check_values(group: object) -> None:
    """Raises SettingsError if a setting is out of its range, or none of its choices."""
    try:
        check_ranges(group)
    except ValueError as error:
        raise SettingsError(str(error)) from error
    for item in fields(group):  # type: ignore[arg-type]
        choices = item.metadata.get("choices", ())
        value = getattr(group, item.name)
        words = value.split(",") if choices and item.name in LISTS else [value]
        if choices and (wrong := [word for word in words if word not in choices]):
            raise SettingsError(f"{item.name} {wrong[0]!r} is not one of {', '.join(choices)}")


FILE = "settings.toml"
"""In a run's folder: its settings, to be given to `robospa eval --config`."""
MOST_BYTES = 2**20
SECRETS = ("token",)


def read_settings(path: Path) -> EvaluationSettings:
    """The settings in the file at `path`: JSON if it is called so, else TOML.

    Raises SettingsError, naming the file, if it cannot be read, has an unknown key or a value that
    is impossible.
    """
    try:
        return updated(EvaluationSettings(), _values(_parse(path)))
    except SettingsError as error:
        raise SettingsError(f"{path}: {error}") from error


def to_toml(settings: EvaluationSettings) -> str:
    """All settings, the defaults too, as TOML that `read_settings` reads."""
    lines: list[str] = []
    for group, values in plain(settings).items():
        if group:
            lines += ["", f"[{group}]"]
        lines += [f"{name} = {_toml(v)}" for name, v in values.items() if v is not None]
    return "\n".join(lines) + "\n"


def _toml(value: Value) -> str:
    """A value of TOML: as in JSON, but for infinite numbers and one character."""
    if isinstance(value, float):
        return repr(value)
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _parse(path: Path) -> Mapping[str, object]:
    try:
        if path.stat().st_size > MOST_BYTES:
            raise SettingsError(f"it has more than {MOST_BYTES} bytes")
        text = path.read_text()
        found = json.loads(text) if path.suffix == ".json" else tomllib.loads(text)
    except OSError as error:
        raise SettingsError(f"it cannot be read ({error.strerror})") from error
    except (ValueError, RecursionError) as error:
        kind = "JSON" if path.suffix == ".json" else "TOML"
        raise SettingsError(f"it is no {kind} ({str(error)[:200]})") from error
    if not isinstance(found, dict):
        raise SettingsError("it is no map of settings")
    return found


def _values(data: Mapping[str, object]) -> dict[str, object]:
    """The settings in a file's `data`, by name without their groups."""
    values: dict[str, object] = {}
    for name, value in data.items():
        if name not in GROUPS:
            values |= _known("", {name: value})
        elif isinstance(value, dict):
            values |= _known(name, value)
        else:
            raise SettingsError(f"{name} is a group of settings: write a table [{name}]")
    return values


def _known(group: str, values: Mapping[str, object]) -> Mapping[str, object]:
    """`values` if all of them are settings of `group`; raises SettingsError with near matches."""
    groups = group_of()
    for name in values:
        if name in SECRETS:
            raise SettingsError(
                f"a {name} does not belong in a file: use --{name} or ROBOSPA_{name.upper()}"
            )
        if groups.get(name) != group:
            near = get_close_matches(name, [*groups, *GROUPS], n=1)
            hint = f"did you mean {_place(near[0])}? " if near else ""
            where = f"[{group}]" if group else "the top level"
            known = [n for n, g in groups.items() if g == group] + ([] if group else list(GROUPS))
            raise SettingsError(
                f"{where} has no setting {name!r}; {hint}known there are {', '.join(known)}"
            )
    return values


def _place(name: str) -> str:
    """The place of a setting in a file, for messages."""
    group = group_of().get(name)
    return f"{name} of [{group}]" if group else f"[{name}]" if name in GROUPS else name
