"""Starting a run, and going on with it: its manifest is written once and compared on resume."""

import json
import os
import platform
import subprocess
import sys
from collections.abc import Collection, Mapping
from fnmatch import fnmatch
from importlib import metadata
from pathlib import Path
from typing import TypeVar

from msgspec import structs, to_builtins

from robospa.harness.running.atomic_file import PARTIAL, replace_file
from robospa.harness.running.code_hash import code_hash
from robospa.protocol.client import Identity, identity_of
from robospa.results.records.manifest import (
    MANIFEST,
    GitState,
    Processor,
    RunAbout,
    RunError,
    RunManifest,
    RunSettings,
    ServerFacts,
    manifest_text,
    read_manifest,
)
from robospa.results.records.runs import LOCK

Part = TypeVar("Part", RunSettings, RunAbout)


def _version(package: str) -> str:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return "not installed"


def package_versions() -> dict[str, str]:
    """Versions that decide a record: of Python, of ours, and of what computes."""
    found = {name: _version(name) for name in ("robospa", "numpy", "sapien")}
    return {**found, "python": sys.version.split()[0]}


def git_state(folder: Path) -> GitState | None:
    """The checkout that this package's `folder` is part of, if any."""

    def git(*words: str) -> str:
        done = subprocess.run(
            ["git", "-C", str(folder), *words], capture_output=True, text=True, timeout=10
        )
        return done.stdout.strip() if done.returncode == 0 else ""

    try:
        tracked = git("ls-files", "--error-unmatch", str(folder / "manifest.py"))
        commit = git("rev-parse", "HEAD")
        if not commit or not tracked:  # installed inside a checkout of something else
            return None
        return GitState(commit, bool(git("status", "--porcelain")))
    except (OSError, subprocess.TimeoutExpired):
        return None


def this_processor() -> Processor:
    try:
        rows = Path("/proc/cpuinfo").read_text().partition("\n\n")[0].splitlines()
    except OSError:
        rows = []
    facts = {name.strip(): value.strip() for name, _, value in (r.partition(":") for r in rows)}
    family, model = (facts.get(name, "") for name in ("cpu family", "model"))
    return Processor(
        facts.get("vendor_id", platform.machine())[:100],
        int(family) if family.isdecimal() else 0,
        int(model) if model.isdecimal() else 0,
        facts.get("model name", "")[:100],
    )


def about_machine(world: Mapping[str, object]) -> RunAbout:
    """Versions, checkout and machine, with what the `world` says about itself."""
    return RunAbout(
        versions=package_versions(),
        git=git_state(Path(__file__).resolve().parent),
        code=code_hash(),
        machine={
            "system": platform.platform(),
            "processor": platform.machine(),
            "cores": os.cpu_count(),
        },
        processors=(this_processor(),),
        world=dict(world),
    )


def _flatten(value: object, path: str = "") -> dict[str, object]:
    if isinstance(value, Mapping) and (value or not path):
        parts: dict[str, object] = {}
        for name, inner in value.items():
            parts.update(_flatten(inner, f"{path}.{name}" if path else str(name)))
        return parts
    return {path: value}


def changed_settings(old: object, new: object) -> list[str]:
    """One phrase per setting that differs: `name: old -> new`; of maps or structs."""
    first, second = _flatten(_plain(old)), _flatten(_plain(new))
    names = sorted(set(first) | set(second))
    return [
        f"{name}: {first.get(name, 'unset')!r} -> {second.get(name, 'unset')!r}"
        for name in names
        if first.get(name) != second.get(name)
    ]


def _plain(value: object) -> object:
    return json.loads(json.dumps(to_builtins(value), default=str))


def changed_policies(old: RunAbout, new: RunAbout) -> list[str]:
    """One phrase per policy that is another one in `new`: which, and how it greets otherwise. A
    server at a new address must be who the first one was."""
    pairs = [(old.policy, new.policy)]
    pairs += [(old.policies.get(task), policy) for task, policy in new.policies.items()]
    found: dict[str, None] = {}
    for first, second in pairs:
        known = {server.target: server for server in first.servers} if first else {}
        for server in second.servers if second else ():
            was = known.get(server.target) or next(iter(known.values()), server)
            if changes := _identity(was).changes(_identity(server)):
                found[f"the policy at {server.target}: {'; '.join(changes)}"] = None
    return list(found)


def _identity(server: ServerFacts) -> Identity:
    return identity_of(server.hello, server.identity.volatile if server.identity else ())


def write_manifest(folder: Path, manifest: RunManifest) -> None:
    replace_file(folder / MANIFEST, manifest_text(manifest).encode())


def add_processor(folder: Path, processor: Processor) -> None:
    """Note in the manifest that trials run on this kind of processor as well."""
    kept = read_manifest(folder)
    if processor not in kept.about.processors:
        about = structs.replace(kept.about, processors=(*kept.about.processors, processor))
        write_manifest(folder, structs.replace(kept, about=about))


def check_folder(folder: Path, resume: bool) -> None:
    """Raises RunError if a run cannot be started in `folder`, or if there is none to resume."""
    try:
        there = (folder / MANIFEST).exists()
    except OSError as error:
        raise RunError(f"{str(folder)[:80]}... cannot be a folder: {error.strerror}") from error
    if there and not resume:
        raise RunError(
            f"{folder} already holds a run; add --resume to go on with it or choose another --out"
        )
    if resume and not there:
        raise RunError(f"there is no run in {folder} to resume; leave --resume out to start one")
    if folder.exists() and not folder.is_dir():
        raise RunError(f"{folder} is a file; choose another --out")
    # What a driver killed at its start leaves behind does not count.
    names = {path.name for path in folder.iterdir()} - {LOCK} if folder.exists() else ()
    if not there and not all(fnmatch(name, PARTIAL) for name in names):
        raise RunError(f"{folder} is neither empty nor a run; choose another --out")


def _allowed_changes(old: Part, new: Part, tasks: Collection[str]) -> Part:
    """`old` settings, or what is known about policies, with what may be `new`: the policies of
    tasks that have no result yet, unlike `tasks`."""
    before, now = old.policies, new.policies
    if not tasks:
        changed = structs.replace(old, policy=new.policy, policies=now or before)
        if isinstance(new, RunSettings):
            changed = structs.replace(changed, privileged=new.privileged)
        return changed
    if not (before and now):
        return old
    free = {task: policy for task, policy in now.items() if task in before and task not in tasks}
    # The first task's policy stands for the others where one is enough to describe the run.
    return structs.replace(old, policy=new.policy, policies={**before, **free})


def open_run(folder: Path, manifest: RunManifest, resume: bool, tasks: Collection[str]) -> None:
    """Start the run in `folder` or go on with it; `tasks` are those with a result.

    A policy of a task without a result may change: a wrong option that stopped the run is mended
    so. Raises RunError as `check_folder` does, or if the run was started with other settings or
    trials (naming them).
    """
    check_folder(folder, resume)
    if not resume:
        write_manifest(folder, manifest)
        return
    old = read_manifest(folder)
    settings = _allowed_changes(old.settings, manifest.settings, tasks)
    changes = changed_settings(settings, manifest.settings)
    gone, new = set(old.keys) - set(manifest.keys), set(manifest.keys) - set(old.keys)
    if gone or new:
        changes.append(f"trials: {len(new)} new and {len(gone)} gone")
    for part in ("versions", "code"):
        before, now = getattr(old.about, part), getattr(manifest.about, part)
        changes += changed_settings({part: before}, {part: now})
    if changes:
        raise RunError(
            f"the run in {folder} was started with other settings ({'; '.join(changes)}); "
            "use the same ones to resume it or choose another --out"
        )
    about = _allowed_changes(old.about, manifest.about, tasks)
    if others := changed_policies(about, manifest.about):
        raise RunError(
            f"the run in {folder} was started with another policy ({', '.join(others)}); start the "
            "first one again to resume it or choose another --out"
        )
    mended = changed_policies(old.about, manifest.about)
    kept = manifest if mended or changed_settings(old.settings, settings) else old
    processors = (*old.about.processors, *manifest.about.processors)
    about = structs.replace(
        kept.about, processors=tuple(dict.fromkeys(processors)), drivers=old.about.drivers + 1
    )
    write_manifest(folder, structs.replace(kept, about=about))
