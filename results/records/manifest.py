"""`run.json`: what a run is made of. One type, written at a run's start and read by everything.

`settings` decide the result and may not change on resume; `about` describes software, machine and
servers and is only kept. A field without a value is left out of the file, and what the file holds
besides is ignored, so that a run of another version can be read as far as it says the same.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated

from msgspec import Meta, Struct, to_builtins

from robospa.schema import MAX_INTEGER, Count, Name, Number, SettingName, parse_json, pattern, read
from robospa.trial import TrialKey

MANIFEST = "run.json"
FORMAT = 1
"""Version of a run's folder. A newer one is refused."""
MAX_MANIFEST_BYTES = 2**26
REST_TO_REST = "rest_to_rest"
"""How the benchmark executes an action."""
OFFICIAL = "official-"
"""How the names of suites begin whose runs are held against the paper: those of the official world.
They never stand in one table with this benchmark's own suites."""
Facts = dict[str, object]
"""JSON values that are kept as they are: what a server, a world or a machine says of itself."""


JOINTS = "joints"
TRACKS = {"skill": "skills", "point": "points"}
"""Actions that make a run one of a track of its own; JOINTS is that of all others. Tracks share
scenes, sentences and goals; nothing is averaged, compared or ranked over two of them."""


class RunError(Exception):
    """A run's folder cannot be read; the message names file and line."""


RUN_SEED = "[0-9A-Za-z]{1,64}"
RunSeed = Annotated[str, pattern(RUN_SEED, "1 to 64 letters and digits")]


class TrialGroup(Struct, frozen=True):
    """The seeds of a variant."""

    task: Name
    level: Count
    embodiment: SettingName
    mode: SettingName
    split: Name
    seeds: list[Count]


class PolicySpecification(Struct, frozen=True):
    """What readers of a run ask of a policy's specification. `seeded` is None where it does not say
    whether the policy honours the trial's seed."""

    name: str = ""
    action: str = ""
    horizon: Annotated[int, Meta(ge=1)] | None = None
    execute: Annotated[int, Meta(ge=1)] | None = None
    cameras: list[Facts | str] = []
    seeded: bool | None = None
    privileged: bool = False
    environment_state: bool = False
    needs_trial_key: bool = False
    contract: tuple[str, ...] = ()

    @property
    def space(self) -> str:
        """The space of the recorded actions: skills are executed as joints."""
        return "joint" if TRACKS.get(self.action) == "skills" else self.action


class PolicySettings(Struct, frozen=True, dict=True):
    """What of a policy decides a result: all that it said of itself, and the client's options."""

    spec: Facts = {}
    dialect: str | None = None
    options: Facts = {}

    def __post_init__(self) -> None:
        _ = self.stated

    @cached_property
    def stated(self) -> PolicySpecification:
        """`spec`, typed."""
        return read(PolicySpecification, self.spec, "the policy's spec")


class WorldSettings(Struct, frozen=True):
    """The world by name, and the arguments that it was built with."""

    name: str = ""
    arguments: Facts = {}


class ClockSettings(Struct, frozen=True):
    """A real clock. `latency_ms` is that of a constant latency, `seconds` the most that a trial may
    take."""

    latency: str
    latency_ms: Number | None = None
    switching: str = "wait"
    action_steps: Count = 0
    seconds: Number | None = None

    @property
    def text(self) -> str:
        """The clock in a few words."""
        limit = f" within {self.seconds:g} s" if self.seconds is not None else ""
        switching = "" if self.switching == "wait" else f" {self.switching}"
        return f"real:{self.latency}{switching}{limit}"


class LayoutSettings(Struct, frozen=True):
    """The official parts of a scene: whose objects (with the archive's hash), which quirks."""

    assets: str = ""
    digest: str = ""
    switches: list[str] = []


class RunSettings(Struct, frozen=True):
    """What decides the results of a run.

    `policy` stands for all tasks where there are no `policies` by task. `privileged`: it sees the
    exact state. `needs_trial_key`: it is sent what names the scenes. `step_scale` multiplies the
    official step limits. `run_seed`: ids and policy seeds follow from it; a secret during the run,
    unless it was given.
    `salt_sha256` is of hidden scenes. `instructions`: hash of official sentences. `profile`: its
    trials measure what axes cost.
    """

    embodiment: tuple[SettingName, ...] = ()
    mode: tuple[SettingName, ...] = ()
    split: tuple[Name, ...] = ()
    policy: PolicySettings = PolicySettings()
    privileged: bool = False
    needs_trial_key: bool = False
    run_seed: RunSeed | Count = 0
    step_scale: Number = 1.0
    world: WorldSettings = WorldSettings()
    clock: ClockSettings | None = None
    salt_sha256: str = ""
    policies: dict[str, PolicySettings] = {}
    instructions: str = ""
    layout: LayoutSettings | None = None
    profile: bool = False

    @property
    def stated(self) -> list[PolicySpecification]:
        """What all policies said of themselves."""
        return [policy.stated for policy in (self.policy, *self.policies.values())]


class ServerIdentity(Struct, frozen=True):
    """The hash of a server's greeting without what is `volatile` in it, and its checkpoint."""

    hash: str = ""
    checkpoint: str = ""
    volatile: list[str] = []


class ServerFacts(Struct, frozen=True):
    """Where a policy was and how it greeted, with its replicas (`equals`)."""

    target: str = ""
    hello: Facts = {}
    identity: ServerIdentity | None = None
    equals: tuple[ServerFacts, ...] = ()

    @property
    def servers(self) -> tuple[ServerFacts, ...]:
        """Those that said who they are."""
        return tuple(one for one in (self, *self.equals) if one.identity is not None)


class GitState(Struct, frozen=True):
    """The commit that a run was made with, and whether the checkout had changes."""

    commit: str = ""
    dirty: bool = False


class Processor(Struct, frozen=True):
    """A kind of processor, as it calls itself. Equal actions end in equal bits on one kind alone;
    `name` is not always told."""

    vendor: Annotated[str, Meta(max_length=100)] = ""
    family: Count = 0
    model: Count = 0
    name: Annotated[str, Meta(max_length=100)] = ""

    @property
    def kind(self) -> tuple[str, int, int]:
        """What two have in common that make the same bits."""
        return self.vendor, self.family, self.model

    def __str__(self) -> str:
        return f"{self.vendor} family {self.family} model {self.model}"


class RunAbout(Struct, frozen=True):
    """What made a run: `code` is a hash. `processors`: of all kinds that ran its trials, none in a
    run of an older version. `drivers`: how often it was started or gone on with. `seeds`: where
    the lists of seeds come from."""

    versions: dict[str, str] = {}
    git: GitState | None = None
    code: str = ""
    machine: Facts = {}
    processors: tuple[Processor, ...] = ()
    drivers: Annotated[int, Meta(ge=1, le=MAX_INTEGER)] = 1
    world: Facts = {}
    policy: ServerFacts | None = None
    policies: dict[str, ServerFacts] = {}
    arguments: Facts = {}
    seeds: list[dict[str, str]] = []
    warnings: list[str] = []
    instructions: Facts = {}


class RunManifest(Struct, frozen=True, dict=True, kw_only=True):
    """A whole `run.json`, with the list of trials that was fixed before the first one ran."""

    format: Count = FORMAT
    suite: str = ""
    settings: RunSettings = RunSettings()
    seed_hash: str = ""
    categories: dict[str, str] = {}
    trials: list[TrialGroup] = []
    about: RunAbout = RunAbout()

    @cached_property
    def keys(self) -> tuple[TrialKey, ...]:
        """The listed trials."""
        return tuple(
            TrialKey(group.task, group.level, seed, group.embodiment, group.mode, group.split)
            for group in self.trials
            for seed in group.seeds
        )

    @property
    def policy(self) -> PolicySpecification:
        """What the (first) policy said of itself."""
        return self.settings.policy.stated

    @property
    def tracks(self) -> tuple[str, ...]:
        """The track of its policies; several of a run that means nothing as a whole."""
        acting = self.settings.policies.values() or (self.settings.policy,)
        return tuple(sorted({TRACKS.get(one.stated.action, JOINTS) for one in acting}))

    @property
    def clock(self) -> str:
        """A real clock in a few words; empty for the paused one."""
        return self.settings.clock.text if self.settings.clock else ""

    @property
    def latency_ms(self) -> float | None:
        """Of a run in real time with a constant latency."""
        return self.settings.clock.latency_ms if self.settings.clock else None

    @property
    def control(self) -> str:
        """How actions were executed."""
        return str(self.about.world.get("control", REST_TO_REST))

    @cached_property
    def servers(self) -> dict[str, str]:
        """The checkpoint that each policy server named, by address; empty for one that named
        none."""
        policies = (self.about.policy, *self.about.policies.values())
        return {
            server.target: server.identity.checkpoint
            for policy in policies
            if policy is not None
            for server in policy.servers
            if server.identity and "://" in server.target
        }

    def to_json(self) -> Facts:
        """Plain JSON values, without what has no value."""
        data: Facts = to_builtins(self)
        for part, names in (("settings", OPTIONAL_SETTINGS), ("about", OPTIONAL_ABOUT)):
            found = to_builtins(getattr(self, part))
            data[part] = {n: v for n, v in found.items() if v or n not in names}
        return data


@dataclass(frozen=True)
class Departure:
    """Where a run departs from the benchmark: a short `name`, and what that means in `words`. If it
    is not `ranked`, the run is shown beside others and never marked or ranked among them."""

    name: str
    words: str
    ranked: bool = False

    def __str__(self) -> str:
        return f"{self.name}: {self.words}"


LIMITS, REAL_TIME = "step limits", "real time"


def departures(manifest: RunManifest) -> tuple[Departure, ...]:
    """All departures of a run; none of one that a leaderboard could take."""
    settings, found = manifest.settings, []
    if settings.privileged or any(s.privileged or s.environment_state for s in settings.stated):
        found.append(Departure("privileged", "sees the exact state"))
    elif settings.needs_trial_key or any(stated.needs_trial_key for stated in settings.stated):
        words = "is sent every trial's seed, from which the scene can be rebuilt"
        found.append(Departure("knows seeds", words))
    if settings.profile:
        found.append(Departure("profile", "trials of what axes cost, beside clean ones"))
    if manifest.clock:
        found.append(Departure(REAL_TIME, f"{manifest.clock}, a suite of its own"))
    if parts := [mode for mode in settings.mode if ":" in mode]:
        found.append(Departure("scenes", f"{', '.join(parts)}, which nobody else has"))
    if settings.step_scale != 1:
        found.append(Departure(LIMITS, f"{settings.step_scale:g} times the official ones", True))
    if settings.salt_sha256:
        found.append(Departure("hidden scenes", f"salt with sha256 {settings.salt_sha256}", True))
    return tuple(found)


OPTIONAL_SETTINGS = ("profile", "clock", "salt_sha256", "policies", "instructions", "layout")
OPTIONAL_ABOUT = ("git", "policy", "policies", "arguments", "seeds", "instructions")


def manifest_text(manifest: RunManifest) -> str:
    """What `run.json` holds."""
    return json.dumps(manifest.to_json(), indent=1, default=str)


def no_run(folder: Path) -> RunError:
    """That `folder` is none, with the runs in it or one folder deeper, the newest first."""
    found = [*folder.glob(f"*/{MANIFEST}"), *folder.glob(f"*/*/{MANIFEST}")]
    inside = [str(path.parent) for path in sorted(found, key=lambda p: -p.stat().st_mtime)]
    shown = f"; runs in it are {', '.join(inside[:3])}{', ...' * (len(inside) > 3)}"
    return RunError(f"{folder} is not a run: it has no {MANIFEST}{shown if inside else ''}")


def read_manifest(folder: Path) -> RunManifest:
    """The run's `run.json`; raises RunError if there is none or it is broken."""
    path = folder / MANIFEST
    if not path.exists():
        raise no_run(folder)
    try:
        data = parse_json(read_bytes(path, MAX_MANIFEST_BYTES).decode())
    except ValueError as error:
        raise RunError(f"cannot read {path}: {error}") from error
    if not isinstance(data, dict) or not isinstance(data.get("trials"), list):
        raise RunError(f"{path} is no run manifest: it has no list of trials")
    version = data.get("format", FORMAT)
    if type(version) is not int or version > FORMAT:
        raise RunError(
            f"{path} has format {str(version)[:20]}, and this robospa reads up to {FORMAT}: "
            "use the version that wrote it or a newer one"
        )
    return read(RunManifest, data, f"the run manifest {path}", RunError)


def read_bytes(path: Path, most: int) -> bytes:
    """All of `path`; raises RunError if it cannot be read or has more than `most` bytes."""
    try:
        if path.stat().st_size > most:
            raise RunError(f"cannot read {path}: it has more than {most} bytes")
        return path.read_bytes()
    except OSError as error:
        raise RunError(f"cannot read {path}: {error.strerror}") from error


def trial_groups(keys: Iterable[TrialKey]) -> list[TrialGroup]:
    """The list of trials as a manifest has it, a row a variant."""
    rows: dict[tuple[str, int, str, str, str], list[int]] = {}
    for key in keys:
        row = (key.task, key.level, key.embodiment, key.mode, key.split)
        rows.setdefault(row, []).append(key.seed)
    return [TrialGroup(*row, seeds) for row, seeds in rows.items()]


def seed_hash(keys: Iterable[TrialKey]) -> str:
    """Hash of the set of trials: equal only if two runs list exactly the same ones."""
    text = "\n".join(sorted(key.slug for key in keys))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def make_manifest(
    settings: RunSettings,
    keys: Iterable[TrialKey],
    about: RunAbout | None = None,
    categories: Mapping[str, str] | None = None,
    suite: str = "",
) -> RunManifest:
    """The manifest of a run of the trials `keys`."""
    listed = tuple(keys)
    return RunManifest(
        suite=suite,
        settings=settings,
        seed_hash=seed_hash(listed),
        categories=dict(categories or {}),
        trials=trial_groups(listed),
        about=about or RunAbout(),
    )
