"""Level 3 in the real simulator: an honest claim is reproduced, an inflated one is caught.

Expert-checked hidden seeds, real bundles, policies behind real servers.
"""

from __future__ import annotations

from copy import deepcopy
from pathlib import Path

import pytest
from bundle_fakes import CARD_DATA
from shadow import HORIZON, Shadow

from robospa.harness.running.evaluate import Request, evaluate
from robospa.harness.running.request import make_request
from robospa.harness.settings import EvaluationSettings, updated
from robospa.leaderboard.card import to_card
from robospa.leaderboard.hidden_seeds import draw_block, read_block, write_block
from robospa.leaderboard.packing import pack
from robospa.leaderboard.reference import shipped
from robospa.leaderboard.reproduce import check_policy, compare, hidden_keys
from robospa.protocol.server import ServerThread
from robospa.results.records.run_io import Run, read_run
from robospa.tasks.seeds import accepted
from robospa.trial import TrialKey

pytestmark = pytest.mark.sim
TASK, LEVEL, TRIALS = "Pick_Blocks_Size", 1, 5
LIMITS = {"timeout": 60.0, "first_timeout": 60.0, "patience": 5.0}


def request(url: str, keys: list[TrialKey], out: Path) -> Request:
    settings = updated(EvaluationSettings(), {"policy": url, "out": out, "workers": 1, **LIMITS})
    return make_request(settings, keys=keys)


def run(folder: Path, keys: list[TrialKey], clumsy: bool) -> Run:
    """The run of the shadow, served over the wire."""
    with ServerThread(policy_factory=lambda: Shadow(clumsy)) as server:
        evaluate(request(server.url, keys, folder))
    return read_run(folder)


def test_a_claim_is_reproduced_and_an_inflated_one_is_caught(tmp_path: Path) -> None:
    reference, card = shipped(), deepcopy(CARD_DATA)
    card["actions"]["chunk"] = HORIZON
    claimed = [TrialKey(TASK, LEVEL, seed) for seed in accepted(TASK, LEVEL)[:TRIALS]]
    assert sum(r.success for r in run(tmp_path / "run", claimed, False).records.values()) == TRIALS
    valid = pack(
        [tmp_path / "run"],
        to_card(card),
        tmp_path / "b.zip",
        reference,
        practice=True,
        videos=False,
    ).valid

    drawn = draw_block([(TASK, LEVEL)], TRIALS)
    write_block(drawn, tmp_path / "block.json")
    block = read_block(tmp_path / "block.json", drawn.commitment)
    keys = hidden_keys(valid, block, reference)

    with ServerThread(policy_factory=Shadow) as server:
        check_policy(valid, request(server.url, keys, tmp_path / "x"))
    honest = compare(valid, run(tmp_path / "honest", keys, False), keys, block)
    assert honest.holds
    assert honest.overall.fresh == TRIALS

    inflated = compare(valid, run(tmp_path / "inflated", keys, True), keys, block)
    assert not inflated.holds
    assert inflated.overall.fresh == 0
    assert inflated.overall.p == pytest.approx(2 / 252)
