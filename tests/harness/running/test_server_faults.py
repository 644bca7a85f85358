"""A run against fifty faulty servers at once: every fault ends as it should.

Two runs with real worker processes and real sockets, one server and three trials for every fault;
then what stops a run, each by itself.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import pytest
from fault_cases import CASES, CLIPPED, POLICY, REPEATED, STOPS, UNHARMED, WAITED, Case
from fault_server import ALWAYS, ONCE, SOUND, FaultyServer
from run_fakes import SPEC, FakePolicy, FakeWorld, parts

from robospa.harness.running.executor import RunAborted
from robospa.harness.running.policy_probe import probe
from robospa.harness.running.runner import Runner, RunOptions
from robospa.harness.running.worker import WorkerConfig
from robospa.harness.trial import run_trial
from robospa.protocol.errors import WireError
from robospa.protocol.transport import Timeouts
from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.scores import score
from robospa.trial import TrialKey

RUN = [case for case in CASES.values() if case.end != STOPS]
STOPPING = [case for case in CASES.values() if case.end == STOPS]


@dataclass
class Seen:
    """What came of a run over several faulty servers."""

    records: dict[TrialKey, TrialRecord] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    urls: dict[str, str] = field(default_factory=dict)
    stopped: str = ""

    def of(self, case: Case, seed: int) -> TrialRecord:
        return self.records[TrialKey(case.name, 1, seed)]

    def told(self, case: Case) -> list[str]:
        """What the user was told of the trials of `case`."""
        return [note for note in self.notes if note.startswith(f"{case.name}-L1-")]


def run(cases: Iterable[Case], folder: Path, hasty: bool = False, workers: int = 2) -> Seen:
    """One run over the servers of all `cases`; a stall of this machine costs only an attempt."""
    limit, attempts = (0.4, 10) if hasty else (60.0, 3)
    deadlines = Timeouts(30, limit, limit, limit, limit, limit, limit, 0.2)
    seen = Seen()
    with ExitStack() as stack:
        for case in cases:
            seen.urls[case.name] = stack.enter_context(FaultyServer(case.point, case.fault))
        config = WorkerConfig(
            folder,
            "",
            {"timeouts": deadlines},
            world="run_fakes:FakeWorld",
            parts="run_fakes:parts",
            policies=seen.urls,
        )
        keys = [TrialKey(case.name, 1, seed) for case in cases for seed in case.seeds]
        options = RunOptions(workers, attempts, backoff=0.01, give_up=len(keys))
        try:
            Runner(
                config,
                keys,
                options,
                lambda record: seen.records.update({record.key: record}),
                seen.notes.append,
            ).run()
        except RunAborted as error:
            seen.stopped = str(error)
    return seen


@pytest.fixture(scope="module")
def seen(tmp_path_factory: pytest.TempPathFactory) -> Seen:
    """The two runs as one."""
    patient = run([c for c in RUN if not c.hasty], tmp_path_factory.mktemp("patient"))
    hasty = run([c for c in RUN if c.hasty], tmp_path_factory.mktemp("hasty"), True)
    assert not patient.stopped and not hasty.stopped
    both = patient.records | hasty.records
    return Seen(both, patient.notes + hasty.notes, patient.urls | hasty.urls)


@pytest.mark.parametrize("case", RUN, ids=lambda case: case.name)
def test_a_fault_ends_as_it_should(case: Case, seen: Seen) -> None:
    told, struck = seen.told(case), seen.of(case, ONCE)
    if case.end == POLICY:
        assert (struck.end, struck.success, struck.attempts) == ("policy_error", False, 1)
        assert case.words in struck.message
        assert seen.of(case, ALWAYS).message == struck.message
        assert told == []
    elif case.end == CLIPPED:
        assert struck.end == "success"
        assert struck.diagnostics["clipped_joints"] == struck.diagnostics["clipped_grippers"] > 0
        assert case.words in str(struck.diagnostics["first_clipped_joint"])
        assert told == []
    elif case.end == UNHARMED:
        assert struck.end == "success"
    elif case.end == WAITED:
        assert struck.end == "success"
        assert any(case.words in n and seen.urls[case.name] in n for n in seen.notes)
    else:
        assert case.end == REPEATED
        assert struck.end == "success"
        assert any(case.words in text and "trying again in 0.01 s" in text for text in told)
        if ALWAYS in case.seeds:
            lost = seen.of(case, ALWAYS)
            assert (lost.end, lost.attempts, lost.success) == ("infrastructure", 3, False)
            assert case.words in lost.message


@pytest.mark.parametrize("case", RUN, ids=lambda case: case.name)
def test_no_other_trial_is_harmed(case: Case, seen: Seen) -> None:
    """Repeated or beside a fault: the same record as in a run without faults."""
    for seed in case.seeds:
        record = seen.of(case, seed)
        if seed == SOUND or (record.success and case.end != CLIPPED):
            policy, key = FakePolicy(SPEC), TrialKey(case.name, 1, seed)
            alone = run_trial(FakeWorld(), policy, key, policy_seed=0, parts=parts)
            assert record.success
            assert (record.digest, record.actions_digest) == (alone.digest, alone.actions_digest)


@pytest.mark.parametrize("case", RUN, ids=lambda case: case.name)
def test_what_was_not_run_is_not_scored(case: Case, seen: Seen) -> None:
    keys = [TrialKey(case.name, 1, seed) for seed in case.seeds]
    cell = score(keys, seen.records).cells[case.name, 1]
    lost = sum(seen.records[key].end == "infrastructure" for key in keys)
    failed = sum(seen.records[key].end == "policy_error" for key in keys)
    assert (cell.missing, cell.trials) == (lost, len(keys) - lost)
    assert cell.successes == len(keys) - lost - failed
    ends = (cell.successes / len(keys), (cell.successes + lost) / len(keys))
    assert cell.bounds("sr") == ends


def test_every_sentence_is_one_line_of_printable_text(seen: Seen) -> None:
    said = [*seen.notes, *(record.message for record in seen.records.values())]
    assert all(text.isprintable() and len(text) < 600 for text in said)


@pytest.mark.parametrize("case", STOPPING, ids=lambda case: case.name)
def test_a_server_that_comes_back_as_another_stops_the_run(case: Case, tmp_path: Path) -> None:
    seen = run([case], tmp_path, workers=1)
    assert case.words in seen.stopped
    assert all(record.end == "success" for record in seen.records.values())


@pytest.mark.parametrize(
    "case", [c for c in RUN if c.point == "hello" and not c.hasty], ids=lambda case: case.name
)
def test_at_the_start_a_run_is_refused(case: Case) -> None:
    with (
        FaultyServer(case.point, case.fault) as url,
        pytest.raises(WireError, match=re.escape(case.words)),
    ):
        probe(url, {})
