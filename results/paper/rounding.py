"""Arithmetic and rounding of the paper: percent, means over categories, rounding, drops.

Printed digits depend on the arithmetic, so it is fixed here and used for published models and for
runs alike. Values are percent in double precision. A category is the mean of its tasks, a dimension
or the overall value the mean of its categories, all from unrounded values; one decimal, half away
from zero; a drop is the difference of two values as printed. A mean of something that is not there
is not there either: None, never the mean of the rest.
"""

import math
from collections.abc import Iterable, Mapping, Sequence

from robospa.trial import DIMENSIONS

OVERALL = "overall"


def rounded(value: float, digits: int = 1) -> float:
    """`value` as it is printed: half away from zero, never minus zero.

    The scaled double decides what is half, so -1.25 that is -1.2499... in binary becomes -1.2: as
    in the paper, which this reproduces where exact arithmetic and rounding of decimals do not.
    """
    scale = 10.0**digits
    return math.copysign(math.floor(abs(value) * scale + 0.5) / scale, value) + 0.0


def shown(value: float) -> float:
    """`value`, which may be a mean of fractions, as it is printed: not noise in its last bits, but
    its decimals decide what is half."""
    return rounded(round(value, 9))


def is_tie(value: float) -> bool:
    """Whether `value` lies halfway between two printed decimals, but for binary noise."""
    scaled = abs(value) * 10.0
    return abs(scaled - math.floor(scaled) - 0.5) < 1e-9


def text(value: float, digits: int = 1) -> str:
    """`value` rounded as printed, with all its digits."""
    return f"{rounded(value, digits):.{digits}f}"


def mean(values: Iterable[float | None]) -> float | None:
    """The plain mean; None if any value is None or there are none."""
    known: list[float] = []
    for value in values:
        if value is None:
            return None
        known.append(value)
    return math.fsum(known) / len(known) if known else None


def exact_progress(printed: float, subtasks: int, trials: int = 100) -> float:
    """The mean of c/T percent over `trials` that was rounded to `printed`, or `printed` itself.

    Such a mean is a whole number of subtasks out of trials * T.
    """
    whole = round(printed * trials * subtasks / 100)
    near = [100 * n / (trials * subtasks) for n in (whole, whole - 1, whole + 1)]
    return next((value for value in near if rounded(value) == printed), printed)


def drop(first: float | None, last: float | None) -> float | None:
    """The loss from `first` to `last`, both as printed."""
    if first is None or last is None:
        return None
    return rounded(rounded(first) - rounded(last))


def summary(
    tasks: Mapping[str, float | None], members: Mapping[str, Sequence[str]]
) -> dict[str, float | None]:
    """Mean by category, dimension and overall of values by task.

    `members` lists the tasks of every category; a task without a value leaves open all above it.
    """
    means: dict[str, float | None] = {
        category: mean(tasks.get(task) for task in names) for category, names in members.items()
    }
    for dimension, categories in DIMENSIONS.items():
        if parts := [means[c] for c in members if c in categories]:
            means[dimension] = mean(parts)
    means[OVERALL] = mean(means[c] for c in members)
    return means
