"""Level 3 in the real simulator: an honest claim is reproduced, an inflated one is caught.

Expert-checked hidden seeds, real bundles, policies behind real servers.
"""

from collections.abc import Callable
from copy import deepcopy
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from bundle_fakes import CARD_DATA
from shadow import HORIZON, TOLD_SEED, Shadow, Shy, Thief, ids

from robospa.baselines.oracle import Oracle
from robospa.baselines.random import Random
from robospa.harness.running.evaluate import Request, evaluate
from robospa.harness.running.record_store import read_trace
from robospa.harness.running.request import make_request
from robospa.harness.settings import EvaluationSettings, updated
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.leaderboard.audit import (
    expert_actions,
    expert_likeness,
    hidden_gap,
    rehearse,
    sentence_reaction,
)
from robospa.leaderboard.card import to_card
from robospa.leaderboard.packing import Packing, pack
from robospa.leaderboard.reproduce import (
    check_policy,
    compare,
    draw_block,
    hidden_keys,
    read_block,
    write_block,
)
from robospa.leaderboard.rules import shipped
from robospa.leaderboard.verify import Valid
from robospa.protocol.server import ServerThread
from robospa.results.records.runs import Run, action_path, read_run
from robospa.tasks.seeds import accepted
from robospa.trial import TrialKey

pytestmark = pytest.mark.sim
TASK, LEVEL, TRIALS = "Pick_Blocks_Size", 1, 5
LIMITS = {"timeout": 60.0, "first_timeout": 60.0, "patience": 5.0}


def request(url: str, keys: list[TrialKey], out: Path, salt: str = "") -> Request:
    given = {"policy": url, "out": out, "workers": 1, "run_seed": TOLD_SEED, **LIMITS}
    return make_request(updated(EvaluationSettings(), given), keys=keys, salt=salt)


def run(folder: Path, keys: list[TrialKey], policy: Callable[[], Shadow], salt: str = "") -> Run:
    """The run of `policy`, served over the wire."""
    with ServerThread(policy_factory=policy) as server:
        evaluate(request(server.url, keys, folder, salt))
    return read_run(folder)


@pytest.fixture(scope="module")
def claimed() -> list[TrialKey]:
    return [TrialKey(TASK, LEVEL, seed) for seed in accepted(TASK, LEVEL)[:TRIALS]]


@pytest.fixture(scope="module")
def stolen(tmp_path_factory: pytest.TempPathFactory, claimed: list[TrialKey]) -> Run:
    """On public seeds a cheat that was told the run's seed knows every scene: nothing stops it."""
    return run(tmp_path_factory.mktemp("stolen") / "run", claimed, Thief)


@pytest.fixture(scope="module")
def valid(tmp_path_factory: pytest.TempPathFactory, stolen: Run) -> Valid:
    card = deepcopy(CARD_DATA)
    card["actions"]["chunk"] = HORIZON
    assert sum(r.success for r in stolen.records.values()) == TRIALS
    out = tmp_path_factory.mktemp("bundle") / "b.zip"
    (made,) = pack(
        [stolen.folder], to_card(card), out, shipped(), Packing(practice=True, videos=False)
    )
    return made.valid


def test_a_claim_is_reproduced_and_a_cheat_is_caught(tmp_path: Path, valid: Valid) -> None:
    """On hidden scenes the cheat of public ones has nothing to go by, however shy it is there."""
    drawn = draw_block([(TASK, LEVEL)], TRIALS)
    write_block(drawn, tmp_path / "block.json")
    block = read_block(tmp_path / "block.json", drawn.commitment)
    keys, salt = hidden_keys(valid, block, shipped()), block.salt

    with ServerThread(policy_factory=Shadow) as server:
        check_policy(valid, request(server.url, keys, tmp_path / "x", salt))
    able = run(tmp_path / "able", keys, lambda: Shadow(ids(keys, salt)), salt)
    honest = compare(valid, able, keys, block)
    assert honest.holds and honest.overall.fresh == TRIALS

    caught = run(tmp_path / "caught", keys, Shy, salt)
    cheat = compare(valid, caught, keys, block)
    assert not cheat.holds
    assert cheat.overall.fresh == 0
    assert cheat.overall.p == pytest.approx(2 / 252)
    assert hidden_gap(valid.run, caught).suspicious and not hidden_gap(valid.run, able).suspicious


def test_the_audit_knows_the_expert_again(
    claimed: list[TrialKey], stolen: Run, tmp_path: Path
) -> None:
    """An honest baseline, which moves and fails, is not taken for one."""
    world, expert = SapienWorld(render=False), Oracle()
    rehearsed = {key: expert_actions(world, expert, key) for key in claimed[:1]}
    traces = {key: read_trace(action_path(stolen.folder, key)).actions for key in claimed[:1]}
    assert expert_likeness(traces, lambda key: rehearsed[key]).suspicious
    noise = np.random.default_rng(0)
    shaken = {k: t + noise.normal(0, 0.002, t.shape).astype(np.float32) for k, t in traces.items()}
    assert expert_likeness(shaken, lambda key: rehearsed[key]).suspicious
    shy = run(tmp_path / "shy", claimed[:1], Shy)
    assert all(record.success for record in shy.records.values())
    detour = {key: read_trace(action_path(shy.folder, key)).actions for key in claimed[:1]}
    assert not expert_likeness(detour, lambda key: rehearsed[key]).suspicious, "hidden scenes do"
    walk = {key: expert_actions(world, Random(), key) for key in claimed[:1]}
    assert not expert_likeness(walk, lambda key: rehearsed[key]).suspicious


def test_the_audit_sees_who_does_not_read(claimed: list[TrialKey]) -> None:
    play = partial(rehearse, SapienWorld(render=False), Thief(), TOLD_SEED)
    found = sentence_reaction(play, claimed[:2])
    assert found.suspicious
    assert found.sentence.startswith("2 of 2 trials succeed with their own sentence and 2 with")
