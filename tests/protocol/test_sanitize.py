"""What a server says of itself, as JSON values of a bounded size."""

from __future__ import annotations

import numpy as np

from robospa.protocol.errors import json_values


def test_arrays_and_numbers_that_json_lacks_can_be_kept() -> None:
    said = {"mean": np.array([1.5, np.nan]), b"x": {1: (np.inf, None)}, "odd": object}
    kept = json_values(said)
    assert kept["mean"] == [1.5, "nan"]
    assert kept["b'x'"] == {"1": ["inf", None]}
    assert json_values({"weights": np.zeros(10**5)}).startswith("left out: ")
