"""What a submission bundle is: a zip file of known names, sizes and hashes, and nothing else.

    manifest.json            versions, size and hash of every other file, the bundle's own hash
    model.json               the model card
    run.json                 resolved settings, list of trials, versions, machine
    seeds.json               the seeds of every variant
    records.jsonl            one hash-chained row a trial, by task, level and seed
    actions/TASK-L1.bin      the actions of a variant's trials
    videos/TRIAL.mp4         the announced sample, one trial a base task
    report/scores.json       all scores, as `robospa report` has them
    report/outcomes.json     success and progress of every trial, a character each

Names are matched against this list, sizes are bounded before a byte is read, and nothing in a
bundle is ever extracted, imported or run.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeGuard

from msgspec import Struct, to_builtins

from robospa.results.records.manifest import RunManifest
from robospa.schema import Sha256
from robospa.trial import TrialKey

IN_REPOSITORY = "bundle.zip"
"""Name of a bundle in its submission's folder, and its address in `bundle.txt`."""
FORMAT = 2
"""Version of this layout. A newer one is refused, an older one is read as long as it is known."""
MANIFEST = "manifest.json"
CARD = "model.json"
RUN = "run.json"
SEEDS = "seeds.json"
RECORDS = "records.jsonl"
SCORES = "report/scores.json"
OUTCOMES = "report/outcomes.json"

MEGA = 1024 * 1024
_TASK = r"[A-Za-z0-9_]{1,64}"
_SETTING = r"[A-Za-z0-9_.-]{1,250}"
KINDS: tuple[tuple[re.Pattern[str], int], ...] = (
    (re.compile(r"manifest\.json|model\.json"), MEGA),
    (re.compile(r"run\.json|seeds\.json"), 2 * MEGA),
    (re.compile(r"report/(scores|outcomes)\.json"), 2 * MEGA),
    (re.compile(r"records\.jsonl"), 192 * MEGA),
    (re.compile(rf"actions/{_TASK}-L[1-5]\.bin"), 32 * MEGA),
    (
        re.compile(rf"videos/{_TASK}-L[1-5]-[0-9]{{1,20}}-{_SETTING}\.mp4"),
        16 * MEGA,
    ),
)
"""Every name that a bundle may hold, and the most bytes that such a file may have: several times
what the whole benchmark needs. JSON takes up to 24 times its bytes in memory."""


@dataclass(frozen=True)
class BundleLimits:
    """What a bundle as a whole may have: bytes of the zip file, entries, bytes when unpacked, rows
    and bytes of one row."""

    packed: int = 1024 * MEGA
    entries: int = 2000
    unpacked: int = 3 * 1024 * MEGA
    rows: int = 60_000
    row: int = 128 * 1024


class FileEntry(Struct, frozen=True, forbid_unknown_fields=True):
    """Size [bytes] and hash of a file."""

    size: int
    sha256: Sha256


class RowChain(Struct, frozen=True, forbid_unknown_fields=True):
    """How many rows there are, and the hash of the last one."""

    rows: int
    last: Sha256


class BundleManifest(Struct, frozen=True, forbid_unknown_fields=True):
    """`manifest.json`. `robospa` is the version that packed it, `inputs` the hash of what was fixed
    before the first trial, `seeds` that of the seed lists, `bundle` that of all the rest."""

    format: int
    suite: str
    robospa: str
    practice: bool
    inputs: Sha256
    seeds: Sha256
    chain: RowChain
    files: dict[str, FileEntry]
    bundle: str = ""


class BundleError(Exception):
    """A bundle, or a run that was to become one, is refused; the message is one sentence."""


def most_bytes(name: str) -> int | None:
    """The most bytes that the file `name` may have; None if a bundle holds no such file."""
    return next((most for pattern, most in KINDS if pattern.fullmatch(name)), None)


def actions_name(task: str, level: int) -> str:
    """Where the actions of a variant lie."""
    return f"actions/{task}-L{level}.bin"


def video_name(key: TrialKey) -> str:
    """Where the film of a trial lies."""
    return f"videos/{key.slug}.mp4"


def canonical(value: object) -> bytes:
    """The one way to write a JSON value or a Struct down, for hashes; ValueError for NaN and
    infinities."""
    text = json.dumps(
        value,
        sort_keys=True,
        separators=(",", ":"),
        allow_nan=False,
        default=to_builtins,
    )
    return text.encode()


def sha256(data: bytes) -> str:
    """Hexadecimal hash of `data`."""
    return hashlib.sha256(data).hexdigest()


def is_sha256(value: object) -> TypeGuard[str]:
    """Whether `value` is a sha256 in lower-case hexadecimal."""
    return isinstance(value, str) and re.fullmatch(r"[0-9a-f]{64}", value) is not None


def bundle_hash(manifest: Mapping[str, object]) -> str:
    """The hash that names a bundle: of its manifest, which has the hash of every other file."""
    return sha256(canonical({k: v for k, v in manifest.items() if k != "bundle"}))


def inputs_hash(run: RunManifest, lists: Mapping[str, object]) -> str:
    """Hash of what is fixed before the first trial: the chain of rows starts from it."""
    names = ("embodiment", "mode", "split", "run_seed", "step_scale", "policy", "policies")
    fixed = {name: getattr(run.settings, name) for name in names}
    fixed["policies"] = fixed["policies"] or None
    return sha256(canonical({"suite": run.suite, "seeds": lists, "settings": fixed}))
