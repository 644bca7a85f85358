"""The bundles of this repository are valid by the rules of this commit."""

from collections.abc import Mapping
from itertools import islice
from pathlib import Path

import pytest

from robospa.leaderboard import rules, verify
from robospa.leaderboard.submission import read_submission
from robospa.results.records.trial_record import TrialRecord
from robospa.trial import TrialKey

HOME = Path(__file__).parents[2] / "leaderboard" / "submissions"


@pytest.mark.parametrize("path", sorted(HOME.glob("*/bundle.zip")), ids=lambda p: p.parent.name)
def test_a_shipped_bundle_is_valid(path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All of it but for its scenes, of which every hundredth is made again: those of the others
    follow from the same code, and `robospa submit verify` makes them all."""

    check = rules.check_scenes

    def some(records: Mapping[TrialKey, TrialRecord], parts: str, *more: object) -> None:
        check(dict(islice(records.items(), 0, None, 100)), parts)

    monkeypatch.setattr(rules, "check_scenes", some)
    valid = verify.verify(path, rules.shipped())
    kept = read_submission(path.parent)
    assert kept.bundle == valid.manifest.bundle
    assert kept.evidence.replayed and kept.evidence.replayed.identical == len(valid.keys)
