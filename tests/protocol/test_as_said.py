"""What a server says of itself, as JSON values of a bounded size."""

from __future__ import annotations

import numpy as np

from robospa.protocol.validate import as_said


def test_arrays_and_numbers_that_json_lacks_can_be_kept() -> None:
    said = {"mean": np.array([1.5, np.nan]), b"x": {1: (np.inf, None)}, "odd": object}
    kept = as_said(said)
    assert kept["mean"] == [1.5, "nan"]
    assert kept["b'x'"] == {"1": ["inf", None]}
    assert as_said({"weights": np.zeros(10**5)}).startswith("left out: ")
