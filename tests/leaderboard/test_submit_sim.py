"""The real simulator: a run is packed, filmed by playing it again, and replayed to the bit."""

import json
from copy import deepcopy
from pathlib import Path

import pytest
from bundle_fakes import CARD_DATA

from robospa.leaderboard.card import to_card
from robospa.leaderboard.packing import pack
from robospa.leaderboard.replay import replay
from robospa.leaderboard.rules import shipped
from robospa.leaderboard.verify import verify
from robospa.trial import TrialKey

pytestmark = pytest.mark.sim


def test_a_real_run_replays_to_the_bit(tmp_path: Path) -> None:
    from robospa.harness.running.evaluate import evaluate
    from robospa.harness.running.request import make_request
    from robospa.harness.settings import EvaluationSettings, updated
    from robospa.tasks.seeds import accepted

    seeds = accepted("Pick_Blocks_Size", 1)[:2]
    keys = [TrialKey("Pick_Blocks_Size", 1, seed) for seed in seeds]
    asked = {"policy": "hold", "out": tmp_path / "run", "workers": 1}
    evaluate(make_request(updated(EvaluationSettings(), asked), keys=keys))
    card = deepcopy(CARD_DATA)
    spec = json.loads((tmp_path / "run" / "run.json").read_text())
    card["actions"]["chunk"] = spec["settings"]["policy"]["spec"]["horizon"]
    card["actions"]["space"] = spec["settings"]["policy"]["spec"]["action"]
    reference = shipped()
    pack([tmp_path / "run"], to_card(card), tmp_path / "b.zip", reference, practice=True)
    valid = verify(tmp_path / "b.zip", reference, practice=True)
    assert [name for name in valid.manifest.files if name.startswith("videos/")]
    made = replay(valid, "a value nobody knew", 2, reference, workers=2)
    assert made.evidence.exact, made.sentences()
