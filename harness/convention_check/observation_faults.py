"""Mistakes in what a policy is shown, each as something to undo: the policy is then asked again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypedDict

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Array
from robospa.observation import Observation, View

Image = NDArray[np.uint8]


class FrameFacts(TypedDict, total=False):
    """Further data of a frame: `measured` joints [rad] and grippers (D,)."""

    measured: Array | None


Undo = Callable[[Observation, FrameFacts], Observation | None]


@dataclass(frozen=True)
class ObservationFault:
    """One mistake in what a policy is shown. `undo` gives the observation that it may have been
    trained on, or None where that cannot be told. `touches` is what it changes: a policy that is
    not shown that need not be asked again."""

    name: str
    phrase: str
    touches: str
    undo: Undo


def _each(seen: Observation, change: Callable[[View], View]) -> Observation:
    """`seen` with its own view and those of history changed."""
    turned: Observation = {**seen, **change(seen)}
    if "history" in seen:
        turned["history"] = {o: {**v, **change(v)} for o, v in seen["history"].items()}
    return turned


def _images(change: Callable[[Image], Image]) -> Undo:
    """Changes every image, those of history as well."""

    def changed(view: View) -> View:
        return {"images": {name: change(image) for name, image in view["images"].items()}}

    return lambda seen, known: _each(seen, changed)


def _wrists(seen: Observation, known: FrameFacts) -> Observation | None:
    other = {"left_wrist": "right_wrist", "right_wrist": "left_wrist"}
    if not set(other) <= set(seen["images"]):
        return None
    return _each(
        seen,
        lambda view: {"images": {n: view["images"][other.get(n, n)] for n in view["images"]}},
    )


def _state(change: Callable[[Array], Array], poses: Callable[[Array], Array] | None = None) -> Undo:
    """Changes the joints shown, rows (2, J + 1) of the arms, and the `poses` (2, 8)."""

    def changed(view: View) -> View:
        new: View = {}
        if "state" in view:
            rows = np.asarray(view["state"], float).reshape(2, -1)
            new["state"] = change(rows).reshape(-1).astype(np.float32)
        if poses is not None and "ee" in view:
            new["ee"] = poses(np.asarray(view["ee"], float)).astype(np.float32)
        return new

    def undo(seen: Observation, known: FrameFacts) -> Observation | None:
        if "state" in seen and len(seen["state"]) % 2:  # arms of different joint counts
            return None
        return _each(seen, changed)

    return undo


def _hands(rows: Array) -> Array:
    return np.hstack([rows[:, :-1], 1 - rows[:, -1:]])


def _shown_measured(seen: Observation, known: FrameFacts) -> Observation | None:
    measured = known.get("measured")
    if "state" not in seen or measured is None:
        return None
    return {**seen, "state": np.asarray(measured, np.float32)}


VIEWS: tuple[ObservationFault, ...] = (
    ObservationFault(
        "wrist images swapped", "left and right wrist images are swapped", "images", _wrists
    ),
    ObservationFault(
        "blue for red",
        "it was trained on images with red and blue swapped",
        "images",
        _images(lambda image: np.ascontiguousarray(image[..., ::-1])),
    ),
    ObservationFault(
        "images upside down",
        "it was trained on images turned by 180 degrees",
        "images",
        _images(lambda image: np.ascontiguousarray(image[::-1, ::-1])),
    ),
    ObservationFault(
        "arms of the state swapped",
        "it expects the right arm first in the state",
        "robot",
        _state(lambda rows: rows[::-1], lambda rows: rows[::-1]),
    ),
    ObservationFault(
        "grippers of the state inverted",
        "1 is a closed gripper in the state that it expects",
        "robot",
        _state(_hands, _hands),
    ),
    ObservationFault(
        "state in degrees",
        "it expects the state in degrees",
        "state",
        _state(lambda rows: np.hstack([np.degrees(rows[:, :-1]), rows[:, -1:]])),
    ),
    ObservationFault(
        "quaternions of the state x y z w",
        "it expects quaternions x y z w in the state",
        "poses",
        _state(lambda rows: rows, lambda rows: rows[:, [0, 1, 2, 4, 5, 6, 3, 7]]),
    ),
    ObservationFault(
        "measured state",
        "it expects the measured joints, not the commanded ones",
        "state",
        _shown_measured,
    ),
)
