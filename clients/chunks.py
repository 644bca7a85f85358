"""Action chunks out of whatever a server calls one."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ActionSpace
from robospa.protocol.errors import PolicyAnswerError, printable
from robospa.protocol.policy import MAX_HORIZON

NAMED = 160
"""Characters of foreign names in an error."""
PLAIN = re.compile(r"[<>|=]?(b1|i[1248]|u[1248]|f[248])|bool|u?int(8|16|32|64)|float(16|32|64)")


def plain_dtype(name: object) -> np.dtype[Any] | None:
    """The dtype of plain numbers that a message names, None for anything else.

    numpy itself evaluates parts of such a name, so it sees only those that are known.
    """
    if isinstance(name, bytes):
        name = name.decode("ascii", "replace")
    if not isinstance(name, str) or PLAIN.fullmatch(name) is None:
        return None
    return np.dtype(name)


def as_chunk(value: object) -> object:
    """`value` as float32 (T, D) wherever it is an array or lists of numbers.

    Anything else is returned as it is, and refused by the check that follows every answer.
    """
    try:
        array = np.asarray(value)
    except (TypeError, ValueError, OverflowError):
        return value
    if array.dtype.kind not in "iuf":  # texts, truth values, objects: numpy would make numbers
        return value
    with np.errstate(over="ignore"):
        return array.astype(np.float32)


def refuse_unread(answer: Mapping[str, object], known: Collection[str]) -> None:
    """Raises PolicyAnswerError for a member of an answer that is not `known` and holds numbers.

    Actions under a name that nobody reads would be lost in silence; texts, truth values and single
    numbers are remarks, whatever their name.
    """
    unread = [name for name, value in answer.items() if name not in known and _has_rows(value)]
    if unread:
        names = printable(", ".join(sorted(map(repr, unread))), NAMED)
        raise PolicyAnswerError(
            f"the policy answered numbers as {names}, which nobody reads (read are "
            f"{', '.join(sorted(known))}): are they part of its actions?"
        )


def _has_rows(value: object, depth: int = 8) -> bool:
    """Whether `value` is an array, or lists or maps with a number somewhere inside."""
    if isinstance(value, np.ndarray):
        return value.ndim > 0
    if depth == 0:  # no remark is nested so deep
        return True
    inside = value.values() if isinstance(value, Mapping) else value
    if isinstance(inside, str | bytes) or not isinstance(inside, Iterable):
        return False
    return any(
        isinstance(one, int | float | np.generic) or _has_rows(one, depth - 1) for one in inside
    )


def invert_grippers(chunk: object, space: ActionSpace) -> Any:
    """`chunk` with 1 - g for every gripper number: closed becomes open."""
    if not isinstance(chunk, np.ndarray) or chunk.ndim != 2 or chunk.shape[1] != space.width:
        return chunk  # refused by the check that follows
    actions: NDArray[np.float32] = chunk.copy()
    actions[:, space.grippers] = 1 - actions[:, space.grippers]
    return actions


HORIZON = "actions in a chunk, at most; none for as many as come"
"""Help of the option `horizon`, which every dialect has."""


def check_horizon(horizon: int | None, execute: int | None) -> None:
    """ValueError unless 1 <= execute <= horizon <= MAX_HORIZON; None for no limit."""
    most = MAX_HORIZON if horizon is None else horizon
    if not 1 <= (most if execute is None else execute) <= most <= MAX_HORIZON:
        raise ValueError(
            f"options horizon and execute: 1 <= execute <= horizon <= {MAX_HORIZON} is needed"
        )
