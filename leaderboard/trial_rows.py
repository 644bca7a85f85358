"""The rows of a bundle, one a trial: how they are chained, and what a trial's record can say.

Each row has the hash of the row before and of its actions. The chain starts at the hash of the
run's inputs, so whoever changes or moves a row changes every row after it and the bundle's hash. A
record that breaks a rule is of no trial that our harness ran; whether a possible one is true is for
replay to say.
"""

import hashlib
import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from robospa.harness.sim.motion import RATE
from robospa.harness.trial import policy_seed
from robospa.leaderboard.bundle import BundleError, check_text, is_sha256, parse_row, sha256
from robospa.leaderboard.rules import Reference, spec_of
from robospa.leaderboard.traces import Trace, split_trace
from robospa.results.records.manifest import PolicySpecification, RunSettings
from robospa.results.records.runs import FIELDS, KEY_FIELDS, finished, from_data
from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.repeats import repeats
from robospa.tasks.events import KINDS, Event, outcome

ROW_FIELDS = {"previous", "trace", "record"}
EVENT_FIELDS = frozenset(("time", "kind", "object", "index", "note", "step"))
LATENCY = {"p50", "p95", "p99", "max"}
SERVER_LATENCY = {"queue", "infer", "batch"}
"""Entries of the latency that are only there if the policy's server sent them."""
MOST_TIMES, MOST_DIAGNOSTICS = 32, 600
"""More entries of `timing`, and values in `diagnostics` with all that they hold, than any trial
has: what is read stays in memory, where an empty list takes 30 times the place of its text."""


TrialRow = tuple[TrialRecord, str]
"""A trial's record and the hash of its stored actions."""


def trace_hash(trace: NDArray[np.float32]) -> str:
    """Hash of stored actions, as little-endian float32."""
    return hashlib.sha256(np.ascontiguousarray(trace, "<f4").data).hexdigest()


def write_rows(rows: Iterable[TrialRow], first: str) -> Iterator[bytes]:
    """The chained lines of `rows`, without newlines, starting from the hash `first`."""
    previous = first
    for record, trace in rows:
        data = {"previous": previous, "trace": trace, "record": asdict(record)}
        line = json.dumps(data, separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode()
        previous = sha256(line)
        yield line


def read_rows(
    lines: Iterable[bytes], first: str, what: str
) -> Iterator[tuple[TrialRecord, str, str]]:
    """Every record, the hash of its actions and that up to its row; BundleError at the first row
    that is not what it should be."""
    previous = first
    for number, line in enumerate(lines, 1):
        where = f"{what}, row {number}"
        data = parse_row(line, where)
        trace = data.get("trace")
        if data.keys() != ROW_FIELDS or not is_sha256(trace):
            raise BundleError(f"{where} is not a row of previous, trace and record")
        if data["previous"] != previous:
            raise BundleError(
                f"{where} does not follow the row before it: rows were changed, moved or left out"
            )
        previous = sha256(line)
        yield _record(data["record"], where), trace, previous


def _items(value: object) -> int:
    """How many values `value` holds, at any depth; where it is too deep to tell, too many."""
    stack, count = [value], 0
    while stack and count <= MOST_DIAGNOSTICS:
        inner = stack.pop()
        found = list(inner.values()) if isinstance(inner, dict) else inner
        if isinstance(found, list):
            count += len(found)
            stack += found
    return count


def _record(data: object, where: str) -> TrialRecord:
    """The record in `data`, which has every field and no other."""
    try:
        record = from_data(data)
    except ValueError as error:
        raise BundleError(f"{where}: {error}") from None
    assert isinstance(data, dict)
    if missing := [*(FIELDS - data.keys()), *(KEY_FIELDS - data["key"].keys())]:
        raise BundleError(f"{where}: the trial record lacks the field {min(missing)!r}")
    if record.latency and record.latency.keys() - SERVER_LATENCY != LATENCY:
        raise BundleError(f"{where}: latency is not p50, p95, p99 and max")
    if any(event.keys() != EVENT_FIELDS for event in data["events"]):
        raise BundleError(f"{where} has an event with fields that no event has")
    if len(record.timing) > MOST_TIMES or _items(record.diagnostics) > MOST_DIAGNOSTICS:
        raise BundleError(f"{where} has more times or diagnostics than any trial")
    check_text(record.diagnostics, where)
    return record


DECIDING = {"success": "success", "failed": "goal_lost"}
"""Events that end a trial, and how it then ends."""
SUBTASK = frozenset(("subtask_done", "subtask_undone"))
MOST_REPEATS = 10
"""More attempts that may have reached the policy than any of our runs makes for one trial."""
MOST_ATTEMPTS = 1000
"""The same with those that found no server."""
CLOCK = 1e-6
"""What two readings of one clock [s] may differ by."""


def check_record(record: TrialRecord, reference: Reference, settings: RunSettings) -> None:
    """BundleError if `record` contradicts its task, its own events, or is no result at all."""
    slug = record.key.slug
    if not finished(record):
        raise BundleError(f"{slug} is incomplete: the trial was lost and has no result")
    task = reference.task(*record.key.variant)
    level = task.levels[record.key.level]
    for name, found, right in (
        ("category", record.category, task.category),
        ("candidates", record.candidates, level.candidates),
        ("total", record.total, level.subtasks),
        ("policy_seed", record.policy_seed, policy_seed(record.key, settings.run_seed)),
    ):
        if found != right:
            raise BundleError(f"{slug}: {name} is {ascii(found)[:40]}, not {right!r}")
    trouble = (
        _counts(record, level.steps, spec_of(settings, record.key.task))
        or _attempts(record, level.steps)
        or _events(record)
        or _end(record)
        or _times(record)
    )
    if trouble:
        raise BundleError(f"{slug} {trouble}")


def _counts(record: TrialRecord, limit: int, spec: PolicySpecification) -> str:
    """What is impossible about actions, queries and physics steps; "" if nothing is."""
    steps, calls, refused = record.steps, record.policy_calls, record.end == "policy_error"
    if steps > limit:
        return f"has {steps} actions; the limit is {limit}"
    if record.end == "step_limit" and steps < limit:
        return f"ends at its limit of {limit} actions after {steps}"
    if not refused and not (steps and calls and record.physics_steps):
        return (
            f"ends in {record.end} with {steps} actions, {calls} queries and "
            f"{record.physics_steps} physics steps: nothing happens without any"
        )
    if calls > steps + refused:
        return f"has {calls} queries for {steps} actions: every answer has an action"
    most = spec.execute or spec.horizon
    if most is not None and calls * most < steps:
        return f"has {steps} actions from {calls} queries; an answer has at most {most}"
    if record.physics_steps < steps - refused:
        return f"has fewer physics steps than actions ({record.physics_steps} and {steps})"
    unreachable = record.diagnostics.get("unreachable_actions", 0)
    if not isinstance(unreachable, int) or not 0 <= unreachable <= steps:
        return f"has {str(unreachable)[:20]!a} unreachable ones among its {steps} actions"
    return ""


def _attempts(record: TrialRecord, limit: int) -> str:
    """What is impossible about the attempts; "" if nothing is."""
    if not 1 <= record.attempts <= MOST_ATTEMPTS or repeats(record) > MOST_REPEATS:
        return (
            f"says that it was tried {record.attempts} times; the policy may get a trial "
            f"{MOST_REPEATS + 1} times at most"
        )
    if record.attempts != len(record.retries) + 1:
        return (
            f"was tried {record.attempts} times and gives the causes of {len(record.retries)}: "
            "run it with this version"
        )
    if any((row.steps or 0) > limit for row in record.retries):
        return f"has an attempt of more than {limit} actions"
    return ""


def _events(record: TrialRecord) -> str:
    """What is impossible about the list of events; "" if nothing is."""
    last = record.physics_steps / RATE + CLOCK
    for event in record.events:
        if event["kind"] not in KINDS:
            return f"has an event of the unknown kind {event['kind'][:40]!a}"
        if event["kind"] in SUBTASK and not 0 <= event["index"] < record.total:
            return f"has an event of subtask {event['index']}; there are {record.total}"
        if not 0 <= event["time"] <= last or not 0 <= event["step"] <= record.steps:
            return f"has an event ({event['kind']}) outside the trial's time"
    for one, two in pairwise(record.events):
        if two["time"] < one["time"] or two["step"] < one["step"]:
            return f"has events that go back in time ({one['kind']}, {two['kind']})"
    return ""


def _end(record: TrialRecord) -> str:
    """How end, outcome and events contradict each other; "" if they do not."""
    counts = {*SUBTASK, *DECIDING}
    counted = [Event(0.0, e["kind"], "", e["index"]) for e in record.events if e["kind"] in counts]
    reached = outcome(counted, record.total)
    claimed = (record.success, record.done, record.best)
    if claimed != (reached.success, reached.done, reached.best):
        return (
            f"claims success {record.success}, {record.done} done, {record.best} at "
            f"best; its events say {reached.success}, {reached.done}, {reached.best}"
        )
    if record.success != (record.end == "success"):
        return f"ends in {record.end} and claims success {record.success}"
    deciding = [e for e in record.events if e["kind"] in DECIDING]
    ends = {DECIDING[e["kind"]] for e in deciding}
    if ends != ({record.end} & set(DECIDING.values())) or len(deciding) > 1:
        return f"ends in {record.end}, which its events do not say once"
    ended = record.physics_steps / RATE
    for event in deciding:
        if abs(event["time"] - ended) > CLOCK or event["step"] != record.steps:
            return f"goes on after its {event['kind']}"
    return ""


def _times(record: TrialRecord) -> str:
    """What is impossible about wall time and latency; "" if nothing is."""
    if record.wall_time < 0 or any(seconds < 0 for seconds in record.timing.values()):
        return "has a time below zero"
    latency = record.latency
    if bool(latency) != bool(record.policy_calls):
        return f"has {record.policy_calls} queries and {len(latency)} times of answers"
    if not latency:
        return ""
    order = [latency[name] for name in ("p50", "p95", "p99", "max")]
    if min(latency.values()) < 0 or order != sorted(order):
        return "has times of answers that are no percentiles"
    if latency["max"] / 1000 > record.wall_time + CLOCK:
        return "waited longer for one answer than it took as a whole"
    return ""


def check_trace(
    record: TrialRecord, trace: Trace, digest: str, reference: Reference, space: str
) -> None:
    """BundleError unless a trial's stored actions `trace` with this `digest` are what it executed,
    in the time that they take.

    The action for which a policy error was declared was refused, so it may not be stored.
    """
    slug, actions = record.key.slug, len(trace)
    refused = record.end == "policy_error" and actions == record.steps - 1
    if actions != record.steps and not refused:
        raise BundleError(f"{slug} has {record.steps} actions in its record and {actions} stored")
    sent, joints = split_trace(trace, record.key.embodiment, space)
    if joints is not trace:
        digest = trace_hash(sent)
    if not refused and digest != record.actions_digest:
        raise BundleError(f"{slug}: the stored actions are not those of its record")
    if reference.durations is None or not actions:
        return
    steps = reference.durations(record.key.embodiment, joints)
    least = most = int(steps.sum())
    if record.end in DECIDING.values():  # the last action ends when the goal is met or lost
        least += 1 - int(steps[-1])
    if not least <= record.physics_steps <= most:
        raise BundleError(
            f"{slug} has {record.physics_steps} physics steps; its actions take {least} to {most}"
        )
