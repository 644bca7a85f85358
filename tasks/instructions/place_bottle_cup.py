"""Templates of Place_Bottle_Cup: {bottles} into {bin} {side}, then {cup} onto {coaster}.

Up to level 3 there are only bottles, and the templates are those of Put_Bottles_Dustbin.
"""

from __future__ import annotations

from robospa.tasks.instructions import put_bottles_dustbin
from robospa.tasks.instructions.chains import chained
from robospa.tasks.instructions.grammar import Templates

_STEPS = (
    ("put {bottles} into {bin} {side}", "place {cup} on {coaster}"),
    ("throw {bottles} away in {bin} {side}", "set {cup} onto {coaster}"),
    ("drop {bottles} into {bin} {side}", "put {cup} on {coaster}"),
    ("carry {bottles} to {bin} {side} and let go", "move {cup} onto {coaster}"),
    ("clear {bottles} from {table} into {bin} {side}", "stand {cup} on {coaster}"),
)
_RESULTS = ("{bottles} put into {bin} {side}", "{cup} set on {coaster}")
_EVENTS = ("{bottles} going into {bin} {side}", "{cup} going onto {coaster}")


def templates(level: int) -> Templates:
    """Bottles alone up to level 3, cups too from level 4 on."""
    if level < 4:
        return put_bottles_dustbin.templates(level)
    return chained(_STEPS, _RESULTS, _EVENTS)
