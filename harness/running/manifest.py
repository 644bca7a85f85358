"""`run.json`: what a run is made of, written once at its start and compared on resume.

`settings` decide the result and may not change; `about` describes the machine and is only kept.
The list of trials is fixed here, before the first one runs.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import subprocess
import sys
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field
from fnmatch import fnmatch
from importlib import metadata
from pathlib import Path
from typing import Any

from robospa.harness.running.atomic_file import PARTIAL, replace_file
from robospa.harness.running.code_hash import code_hash
from robospa.protocol.client import Identity, identity_of
from robospa.results.records.manifest import (
    FORMAT,
    MANIFEST,
    RunError,
    manifest_keys,
    read_manifest,
)
from robospa.results.records.run_state import LOCK
from robospa.tasks.scene import SUITE
from robospa.trial import TrialKey


@dataclass(frozen=True)
class Manifest:
    """A run's `settings`, its fixed `keys`, what is known `about` where it ran, and the category
    of each of its tasks."""

    settings: Mapping[str, Any]
    keys: tuple[TrialKey, ...]
    about: Mapping[str, Any]
    categories: Mapping[str, str] = field(default_factory=dict)
    suite: str = SUITE

    def to_json(self) -> dict[str, Any]:
        """Plain JSON values."""
        return {
            "format": FORMAT,
            "suite": self.suite,
            "settings": json.loads(json.dumps(self.settings)),
            "seed_hash": seed_hash(self.keys),
            "categories": dict(self.categories),
            "trials": group_keys(self.keys),
            "about": json.loads(json.dumps(self.about, default=str)),
        }


def group_keys(keys: Iterable[TrialKey]) -> list[dict[str, Any]]:
    """The trial list, one row a variant: `{"task", "level", ..., "seeds": [...]}`."""
    rows: dict[tuple[Any, ...], list[int]] = {}
    for key in keys:
        row = (key.task, key.level, key.embodiment, key.mode, key.split)
        rows.setdefault(row, []).append(key.seed)
    names = ("task", "level", "embodiment", "mode", "split")
    return [{**dict(zip(names, row, strict=True)), "seeds": s} for row, s in rows.items()]


def seed_hash(keys: Iterable[TrialKey]) -> str:
    """Hash of the set of trials: equal only if two runs list exactly the same ones."""
    text = "\n".join(sorted(key.slug for key in keys))
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"


def git_state(folder: Path) -> dict[str, Any]:
    """Commit and dirty flag of the checkout that this package's `folder` is part of, or empty."""

    def git(*words: str) -> str:
        done = subprocess.run(
            ["git", "-C", str(folder), *words], capture_output=True, text=True, timeout=10
        )
        return done.stdout.strip() if done.returncode == 0 else ""

    try:
        tracked = git("ls-files", "--error-unmatch", str(folder / "manifest.py"))
        commit = git("rev-parse", "HEAD")
        if not commit or not tracked:  # installed inside a checkout of something else
            return {}
        return {"commit": commit, "dirty": bool(git("status", "--porcelain"))}
    except (OSError, subprocess.TimeoutExpired):
        return {}


def about_machine(world: Mapping[str, Any]) -> dict[str, Any]:
    """Versions, checkout and machine, with what the `world` says about itself."""
    return {
        "versions": {
            "robospa": _version("robospa"),
            "python": sys.version.split()[0],
            "numpy": _version("numpy"),
            "sapien": _version("sapien"),
        },
        "git": git_state(Path(__file__).resolve().parent),
        "code": code_hash(),
        "machine": {
            "system": platform.platform(),
            "processor": platform.machine(),
            "cores": os.cpu_count(),
        },
        "world": dict(world),
    }


def _flatten(value: object, path: str = "") -> dict[str, object]:
    if isinstance(value, Mapping) and (value or not path):
        parts: dict[str, object] = {}
        for name, inner in value.items():
            parts.update(_flatten(inner, f"{path}.{name}" if path else str(name)))
        return parts
    return {path: value}


def changed_settings(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    """One phrase per setting that differs: `name: old -> new`."""
    first, second = _flatten(old), _flatten(new)
    names = sorted(set(first) | set(second))
    return [
        f"{name}: {first.get(name, 'unset')!r} -> {second.get(name, 'unset')!r}"
        for name in names
        if first.get(name) != second.get(name)
    ]


def _list_changes(old: Mapping[str, Any], new: Manifest) -> list[str]:
    """What differs between the lists of trials."""
    before, after = set(manifest_keys(old)), set(new.keys)
    if before == after:
        return []
    return [f"trials: {len(after - before)} new and {len(before - after)} gone"]


def changed_policies(old: Mapping[str, Any], new: Mapping[str, Any]) -> list[str]:
    """One phrase per policy in `about` of a manifest that is another one in `new`: which, and how
    it greets otherwise. A server at a new address must be who the first one was."""
    tasks = {"": (old.get("policy"), new.get("policy"))}
    before, now = old.get("policies", {}), new.get("policies", {})
    tasks |= {task: (before.get(task), now.get(task)) for task in now}
    found: dict[str, None] = {}
    for first, second in tasks.values():
        known = {server["target"]: server for server in _servers(first)}
        for server in _servers(second):
            was = known.get(server["target"]) or next(iter(known.values()), server)
            if changes := _identity(was).changes(_identity(server)):
                found[f"the policy at {server['target']}: {'; '.join(changes)}"] = None
    return list(found)


def _servers(about: Any) -> list[dict[str, Any]]:
    """A policy of a manifest and its replicas; none if an older version kept no identity."""
    servers = [about, *about.get("equals", [])] if isinstance(about, Mapping) else []
    return [s for s in servers if isinstance(s, dict) and "identity" in s and "target" in s]


def _identity(server: Mapping[str, Any]) -> Identity:
    return identity_of(server["hello"], server["identity"].get("volatile", ()))


def write_manifest(folder: Path, manifest: Manifest) -> None:
    """Write `run.json` at once or not at all."""
    text = json.dumps(manifest.to_json(), indent=1)
    replace_file(folder / MANIFEST, text.encode())


def check_folder(folder: Path, resume: bool) -> None:
    """Raises RunError if a run cannot be started in `folder`, or if there is none to resume."""
    there = (folder / MANIFEST).exists()
    if there and not resume:
        raise RunError(
            f"{folder} already holds a run; add --resume to go on with it or choose another --out"
        )
    if resume and not there:
        raise RunError(f"there is no run in {folder} to resume; leave --resume out to start one")
    if folder.exists() and not folder.is_dir():
        raise RunError(f"{folder} is a file; choose another --out")
    if not there and folder.exists() and not _is_empty(folder):
        raise RunError(f"{folder} is neither empty nor a run; choose another --out")


def _is_empty(folder: Path) -> bool:
    """Whether nothing lies in `folder` but what a driver killed at its start leaves behind."""
    names = {path.name for path in folder.iterdir()} - {LOCK}
    return all(fnmatch(name, PARTIAL) for name in names)


def _allowed_changes(
    old: Mapping[str, Any], new: Mapping[str, Any], tasks: Collection[str] | None
) -> dict[str, Any]:
    """`old` settings, or what is known about policies, with what may be `new`: the policies of
    tasks that have no result yet.

    `tasks` are those with a result; None if that is not known, so that nothing may be new.
    """
    if tasks is None:
        return dict(old)
    if not tasks:
        names = ("policy", "policies", "privileged")
        return {**old, **{name: new[name] for name in names if name in new}}
    before, now = old.get("policies"), new.get("policies")
    if before is None or now is None:
        return dict(old)
    free = {task: policy for task, policy in now.items() if task in before and task not in tasks}
    # The first task's policy stands for the others where one is enough to describe the run.
    return {**old, "policy": new["policy"], "policies": {**before, **free}}


def open_run(
    folder: Path, manifest: Manifest, resume: bool, tasks: Collection[str] | None = None
) -> None:
    """Start the run in `folder` or take it up again; `tasks` are those with a result.

    A policy of a task without a result may change: a wrong option that stopped the run is mended
    so. Raises RunError as `check_folder` does, or if the run was started with other settings or
    trials (naming them).
    """
    check_folder(folder, resume)
    if not resume:
        write_manifest(folder, manifest)
        return
    old = read_manifest(folder)
    new = manifest.to_json()
    settings = _allowed_changes(old.get("settings", {}), new["settings"], tasks)
    changes = changed_settings(settings, new["settings"])
    changes += _list_changes(old, manifest)
    for part in ("versions", "code"):
        before, now = old.get("about", {}).get(part), new["about"].get(part)
        changes += changed_settings({part: before}, {part: now})
    if changes:
        raise RunError(
            f"the run in {folder} was started with other settings ({'; '.join(changes)}); "
            "use the same ones to resume it or choose another --out"
        )
    about = _allowed_changes(old.get("about", {}), new["about"], tasks)
    if others := changed_policies(about, new["about"]):
        raise RunError(
            f"the run in {folder} was started with another policy ({', '.join(others)}); start the "
            "first one again to resume it or choose another --out"
        )
    mended = changed_policies(old.get("about", {}), new["about"])
    if mended or settings != old.get("settings", {}):
        write_manifest(folder, manifest)
