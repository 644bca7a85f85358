"""`run.json` read back: the list of trials, and what the rest says of policy, code and machine."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from msgspec import Struct

from robospa.schema import Count, Name, Number, SettingName, parse_json, read
from robospa.trial import TrialKey

MANIFEST = "run.json"
FORMAT = 1
"""Version of a run's folder. A newer one is refused."""
MAX_MANIFEST_BYTES = 2**26


Map = dict[str, Any]


class TrialGroup(Struct, frozen=True):
    """The seeds of a variant."""

    task: Name
    level: Count
    embodiment: SettingName
    mode: SettingName
    split: Name
    seeds: list[Count]


class _Spec(Struct, frozen=True):
    name: str = ""


class _Policy(Struct, frozen=True):
    spec: _Spec = _Spec()


class _Clock(Struct, frozen=True):
    latency: str
    switching: str = "wait"
    latency_ms: Number | None = None
    action_steps: Count = 0
    seconds: Number | None = None


class _Settings(Struct, frozen=True):
    policy: _Policy = _Policy()
    policies: Map = {}
    world: Map = {}
    step_scale: Number = 1.0
    privileged: bool = False
    needs_trial_key: bool = False
    shuffled_instructions: bool = False
    salt_sha256: str = ""
    clock: _Clock | None = None


class _About(Struct, frozen=True):
    policy: Map = {}
    policies: Map = {}
    versions: Map = {}
    machine: Map = {}
    world: Map = {}
    git: Map = {}
    arguments: Map = {}
    code: str = ""
    warnings: list[Any] = []


class _Manifest(Struct, frozen=True):
    """What is relied on in a manifest; whatever else it holds, and what it lacks, is free."""

    settings: _Settings = _Settings()
    about: _About = _About()
    categories: dict[str, str] = {}
    suite: str = ""
    seed_hash: str = ""


class RunError(Exception):
    """A run's folder cannot be read; the message names file and line."""


@dataclass(frozen=True)
class RunInfo:
    """What a manifest says of a run, with a default for whatever an older version left out.

    `policy` is the name that the policy gave itself, `spec` its whole specification; `seeded` is
    None where that does not say whether the policy honours the trial's seed. `needs_trial_key`: it
    was sent what names the scenes. `shuffled_instructions`: every trial had the sentence of another
    scene. `salt_sha256` is of hidden scenes, else empty. `step_scale`
    multiplied the official step limits. `clock` is of a run in real time: its latency, and how
    chunks follow each other; empty under the paused clock. `settings` decide the results;
    `versions`, `code` (a hash), `git`, `machine` and `world` say what made them.
    """

    policy: str = ""
    seeded: bool | None = None
    privileged: bool = False
    needs_trial_key: bool = False
    shuffled_instructions: bool = False
    salt_sha256: str = ""
    step_scale: float = 1.0
    clock: str = ""
    latency_ms: float | None = None
    """Of a run in real time with a constant latency."""
    suite: str = ""
    seed_hash: str = ""
    categories: Mapping[str, str] = field(default_factory=dict)
    spec: Mapping[str, Any] = field(default_factory=dict)
    settings: Mapping[str, Any] = field(default_factory=dict)
    versions: Mapping[str, Any] = field(default_factory=dict)
    code: str = ""
    git: Mapping[str, Any] = field(default_factory=dict)
    machine: Mapping[str, Any] = field(default_factory=dict)
    world: Mapping[str, Any] = field(default_factory=dict)
    servers: Mapping[str, str] = field(default_factory=dict)
    """The checkpoint that each policy server named, by address; empty for one that named none."""


def run_info(manifest: Mapping[str, Any]) -> RunInfo:
    """What `manifest`, checked by `read_manifest`, says."""
    settings, about = manifest.get("settings", {}), manifest.get("about", {})
    spec = settings.get("policy", {}).get("spec", {})
    seeded = spec.get("seeded")
    return RunInfo(
        policy=str(spec.get("name", "")),
        seeded=None if seeded is None else bool(seeded),
        privileged=bool(settings.get("privileged")),
        needs_trial_key=bool(settings.get("needs_trial_key")),
        shuffled_instructions=bool(settings.get("shuffled_instructions")),
        salt_sha256=str(settings.get("salt_sha256", "")),
        step_scale=float(settings.get("step_scale", 1.0)),
        clock=_clock(settings.get("clock")),
        latency_ms=(settings.get("clock") or {}).get("latency_ms"),
        suite=str(manifest.get("suite", "")),
        seed_hash=str(manifest.get("seed_hash", "")),
        categories=manifest.get("categories", {}),
        spec=spec,
        settings=settings,
        versions=about.get("versions", {}),
        code=str(about.get("code", "")),
        git=about.get("git", {}),
        machine=about.get("machine", {}),
        world=about.get("world", {}),
        servers=_servers(about),
    )


def _clock(declared: Mapping[str, Any] | None) -> str:
    """A real clock in a few words; empty for the paused one."""
    if not declared:
        return ""
    switching, seconds = declared.get("switching", "wait"), declared.get("seconds")
    limit = f" within {seconds:g} s" if seconds is not None else ""
    return f"real:{declared['latency']}{'' if switching == 'wait' else f' {switching}'}{limit}"


def _servers(about: Mapping[str, Any]) -> dict[str, str]:
    """The checkpoint of every server in `about`; older versions kept none."""
    found: dict[str, str] = {}
    for policy in (about.get("policy", {}), *about.get("policies", {}).values()):
        equals = policy.get("equals", ()) if isinstance(policy, dict) else ()
        for server in (policy, *equals):
            identity = server.get("identity") if isinstance(server, dict) else None
            target = str(server.get("target", "")) if identity else ""
            if isinstance(identity, dict) and "://" in target:
                found[target] = str(identity.get("checkpoint", ""))
    return found


def read_manifest(folder: Path) -> dict[str, Any]:
    """The run's `run.json`; raises RunError if there is none or it is broken."""
    path = folder / MANIFEST
    if not path.exists():
        raise RunError(f"{folder} is not a run: it has no {MANIFEST}")
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
    read(_Manifest, data, f"the run manifest {path}", RunError)
    return data


def read_bytes(path: Path, most: int) -> bytes:
    """All of `path`; raises RunError if it cannot be read or has more than `most` bytes."""
    try:
        if path.stat().st_size > most:
            raise RunError(f"cannot read {path}: it has more than {most} bytes")
        return path.read_bytes()
    except OSError as error:
        raise RunError(f"cannot read {path}: {error.strerror}") from error


def manifest_keys(manifest: Mapping[str, Any]) -> tuple[TrialKey, ...]:
    """The trials that a manifest lists; raises RunError if one of them is malformed."""
    what = "the manifest's list of trials"
    return trial_keys(read(list[TrialGroup], manifest.get("trials"), what, RunError))


def trial_keys(groups: Iterable[TrialGroup]) -> tuple[TrialKey, ...]:
    """The trials of `groups`, in their order."""
    return tuple(
        TrialKey(group.task, group.level, seed, group.embodiment, group.mode, group.split)
        for group in groups
        for seed in group.seeds
    )
