"""What all dialects share: action chunks out of whatever a server calls one, and their options.

Options: the robot, how many actions a chunk has, and how many tokens of text a model reads.
"""

import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Annotated, Any, TypeVar

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from robospa.action_space import ActionSpace
from robospa.observation import Observation
from robospa.protocol.errors import PolicyAnswerError, printable
from robospa.protocol.options import check_ranges, option
from robospa.protocol.policy import MAX_HORIZON, PolicySpec
from robospa.trial import REFERENCE

T = TypeVar("T", bound=np.generic)
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
    if not isinstance(chunk, np.ndarray) or chunk.shape[-1:] != (space.width,):
        return chunk  # refused by the check that follows
    actions = chunk.copy()
    actions[..., space.grippers] = 1 - actions[..., space.grippers]
    return actions


def executed_before(observation: Observation) -> int:
    """Actions of the trial that were executed; in real time a robot that holds executes none."""
    return int(observation.get("executed", observation["step"]))


def last_executed(chunk: NDArray[T] | None, done: int) -> NDArray[T] | None:
    """The action (D,) of a chunk (T, D) after which `done` actions were executed; None of none."""
    return None if chunk is None or done <= 0 else chunk[min(done, len(chunk)) - 1]


class Targets:
    """The targets that answered changes of joints lead to, over one trial.

    `of`: what an action is a change of: `last`, the target before it, which goes on from chunk to
    chunk and begins at the joints of the trial's start; `start`, those joints; `none`: it is none.
    """

    def __init__(self, of: str) -> None:
        self._of = of
        self.begin()

    def begin(self) -> None:
        """A trial begins: the targets of the one before are forgotten."""
        self._start: NDArray[np.float64] | None = None
        self._last: NDArray[np.float64] | None = None
        self._asked_at = 0

    def of(self, chunk: object, observation: Observation) -> object:
        """The targets, float32 (T, D), of a chunk (T, D); what is none is returned, to be refused
        by the check that follows."""
        if self._of == "none" or not isinstance(chunk, np.ndarray) or chunk.ndim != 2:
            return chunk
        step = executed_before(observation)
        if self._start is None:
            self._start = np.asarray(observation["state"], np.float64)
        if chunk.shape[1] != len(self._start):
            return chunk
        last = last_executed(self._last, step - self._asked_at)
        changes = np.cumsum(chunk, axis=0, dtype=np.float64) if self._of == "last" else chunk
        base = last if self._of == "last" and last is not None else self._start
        self._last, self._asked_at = base + changes, step
        return as_chunk(self._last)


VIEWS = ("head", "left_wrist", "right_wrist")


def camera_names(option: str, least: int = 0) -> tuple[str, ...]:
    """The cameras that the option `cameras` names, in its order; a ValueError says which may be."""
    names = tuple(filter(None, option.split(",")))
    if not set(names) <= set(VIEWS) or len(set(names)) != len(names) or len(names) < least:
        raise ValueError(f"option cameras={option!r}: {least} to 3 of {', '.join(VIEWS)}")
    return names


PIECES = re.compile(r"[^\W\d_]+|\d+|(?:[^\w\s]|_)+")
END_TOKENS = 2
"""Those that mark the beginning and the end of a text."""
STATE_TOKENS = 50
"""What pi0.5's prompt has beside the instruction: fourteen numbers and the words around them."""


def least_tokens(text: str) -> int:
    """The fewest tokens that `text` can have, with those at its two ends.

    No tokenizer is at hand here: those of these models never join two words, or a word and a comma,
    into one token. What is over a budget by this count is cut off for certain.
    """
    return len(PIECES.findall(text)) + END_TOKENS


def budget_warning(budget: int | None, instructions: dict[str, str]) -> str | None:
    """One sentence if any of `instructions` (by the name of their task) is over `budget`."""
    counts = {name: least_tokens(text) for name, text in instructions.items()}
    over = [name for name, count in counts.items() if budget is not None and count > budget]
    if not over:
        return None
    worst = max(over, key=lambda name: counts[name])
    return (
        f"the model reads {budget} tokens of an instruction, and those of {len(over)} of "
        f"{len(counts)} tasks are longer ({worst}: at least {counts[worst]}): their end never "
        "reaches it"
    )


Count = Annotated[int, Meta(ge=1)]
Frequency = Annotated[float, Meta(gt=0, le=10_000)]
"""[Hz]"""


@dataclass(frozen=True)
class RobotOption:
    """The option that every dialect and every server of a learned model has. Numbers are within the
    bounds of their annotations, or a ValueError says what is allowed."""

    embodiment: str = option(
        REFERENCE, "robot that the model was trained with: evaluations of another are refused"
    )

    def __post_init__(self) -> None:
        check_ranges(self)

    def columns(self, kind: str) -> int | None:
        """Columns of an action of this `kind`; None if only the trial says it, whose robot may have
        other joints."""
        known = kind != "joint" or self.embodiment == REFERENCE
        return ActionSpace(kind).width if known else None


@dataclass(frozen=True)
class ChunkOptions(RobotOption):
    """How many actions a chunk has, and how many of them are executed."""

    horizon: Annotated[int, Meta(ge=1, le=MAX_HORIZON)] | None = option(
        None, "the most actions in a chunk; none for any number"
    )
    execute: Count | None = option(None, "actions executed before the next query; none for all")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.horizon and self.execute and self.execute > self.horizon:
            raise ValueError(f"option execute={self.execute}: at most the horizon {self.horizon}")

    def spec_of(self, name: str, **more: Any) -> PolicySpec:
        """The spec of a server that says nothing of itself; `more` are other fields of it."""
        return PolicySpec(
            name,
            horizon=self.horizon,
            execute=self.execute,
            embodiments=(self.embodiment,),
            **{"action_dim": ActionSpace().width, **more},
        )


@dataclass(frozen=True)
class AnyModelOptions(ChunkOptions):
    """Those of a server that may run any model, and does not say what that answers and reads."""

    space: str = option("joint", "what the model answers", ("joint", "ee"))
    state: str = option("commanded", "which joints to send", ("commanded", "measured"))
    text_budget: Count | None = option(
        None,
        "tokens of an instruction that the model reads, as X-VLA's 50 or pi0's 48; none for all",
    )

    def spec_of(self, name: str, **more: Any) -> PolicySpec:
        known = {"action": self.space, "state": self.state, "text_budget": self.text_budget}
        return super().spec_of(name, action_dim=self.columns(self.space), **known, **more)
