"""The replay check: is a policy nearer to a recorded demonstration if its conventions are changed?

A policy is shown frames of a demonstration and answers chunks; what the demonstrator commanded next
is known. A policy that has learned from such data comes close. If it does not, the usual mistakes
are undone one by one (`action_faults`, VIEWS), and one that brings it much closer,
at nearly every frame, is most likely the mistake. Success in a simulator cannot tell them apart.

A wrong convention is named only if undoing it takes away most of the error: noise and a mediocre
policy do not look like that. A policy that fits nothing gets no name, but is said not to fit.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ActionSpace
from robospa.geometry import Array
from robospa.harness.convention_check import action_faults
from robospa.harness.convention_check.action_faults import (
    GRIPPERS,
    ActionFault,
    AnswerSample,
    fitted,
    from_pose,
    score,
)
from robospa.harness.convention_check.episodes import Episode, EpisodeError
from robospa.observation import Observation, View
from robospa.protocol.policy import Policy, PolicySpec, TrialInfo
from robospa.trial import REFERENCE

Image = NDArray[np.uint8]


Undo = Callable[[Observation, Array | None], Observation | None]
"""(what was shown, joints [rad] and grippers (D,) as measured if known) -> what to show instead."""


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

    return lambda seen, measured: _each(seen, changed)


def _wrists(seen: Observation, measured: Array | None) -> Observation | None:
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

    def undo(seen: Observation, measured: Array | None) -> Observation | None:
        if "state" in seen and len(seen["state"]) % 2:  # arms of different joint counts
            return None
        return _each(seen, changed)

    return undo


def _hands(ends: tuple[float, float], rows: Array) -> Array:
    """The grippers of `rows` with the first of `ends` for closed and the second for open."""
    return np.hstack([rows[:, :-1], ends[0] + (ends[1] - ends[0]) * rows[:, -1:]])


def _shown_measured(seen: Observation, measured: Array | None) -> Observation | None:
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
    *(
        ObservationFault(
            f"grippers of the state {name}",
            f"{ends[0]:g} is a closed gripper and {ends[1]:g} an open one in the state it expects",
            "robot",
            _state(partial(_hands, ends), partial(_hands, ends)),
        )
        for name, ends in GRIPPERS.items()
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


POINTS = 8
"""Frames at which the policy is asked."""
GAIN = 0.65
"""A mistake is named only if undoing it takes away this share of the error."""
LEAST = 0.05
"""Nor if it takes away less than this much of it: then there is nothing to explain."""
AGREE = 0.75
"""Nor if it helps at a smaller share of the frames at which it makes a difference."""
FELT = 0.02
"""A difference of the error at one frame that is worth counting."""
EXPLAINED = 0.3
"""An error that leaves nothing to look for."""
FITS = 1.0
"""An error of this size or less is what a policy that has learned the data makes."""
BETTER = 0.8
"""To have learned anything, its error must be this much below that of holding still."""
LEARNED = 0.6
"""With its mistake undone, a policy must be this much below holding still to have learned much."""


@dataclass(frozen=True)
class Guess:
    """Mistakes that may have been made together, and what is left once they are undone.

    `errors` (G,): the mean over all frames of each group's error; `score` sums them up. `helped`:
    of the frames at which undoing the mistakes made a difference, the share at which it helped.
    `still` is what holding still would score against the same record.
    """

    parts: tuple[ActionFault, ...]
    view: ObservationFault | None
    errors: Array
    score: float
    helped: float
    still: float

    @property
    def names(self) -> tuple[str, ...]:
        shown = (self.view.name,) if self.view is not None else ()
        return (*shown, *(part.name for part in self.parts))

    @property
    def label(self) -> str:
        return " + ".join(self.names) or "as it is"

    @property
    def phrase(self) -> str:
        """The clause that follows "it looks as if"."""
        shown = (self.view.phrase,) if self.view is not None else ()
        return " and ".join((*shown, *(part.phrase for part in self.parts)))


@dataclass(frozen=True)
class Findings:
    """The outcome. `kind` is "fits", "mistaken" or "unclear"; `best` is the guess if "mistaken".

    `groups` names the errors; `base` is the policy as it is, `still` one that would not move,
    `guesses` all single mistakes, the best first. `untried` says what could not be looked at.
    """

    kind: str
    groups: tuple[str, ...]
    base: Guess
    still: Guess
    guesses: tuple[Guess, ...]
    best: Guess | None
    sentence: str
    frames: tuple[int, ...]
    untried: tuple[str, ...] = ()

    def describe(self, guess: Guess) -> list[str]:
        """The errors of `guess` with their units."""
        names = [name.split()[1] for name in self.groups]
        return [
            f"{e:.3f} {action_faults.UNITS[n]}".strip()
            for e, n in zip(guess.errors, names, strict=True)
        ]


def check_conventions(policy: Policy, episode: Episode, points: int = POINTS) -> Findings:
    """Ask `policy` at `points` frames of `episode` and look for the mistake that explains it best.

    Raises EpisodeError if the two do not go together, and whatever the policy raises.
    """
    spec = policy.spec
    if spec.sees_state:
        raise EpisodeError(
            f"the policy {spec.name!r} needs the exact state, which a demonstration does not hold"
        )
    frames = _frames(len(episode), spec, points)
    plain = [_case(policy, episode, t, None) for t in frames]
    cases = [case for case in plain if case is not None]
    shown: dict[str, list[AnswerSample]] = {}
    untried = [] if episode.measured is not None else ["measured joints: not in this file"]
    for view in (view for view in VIEWS if _shown(spec, view)):
        answers = [_case(policy, episode, t, view) for t in frames]
        known = [case for case in answers if case is not None]
        if len(known) == len(cases):
            shown[view.name] = known
    return judge(cases, shown, tuple(frames), tuple(untried))


def _frames(length: int, spec: PolicySpec, points: int) -> list[int]:
    """Frames spread over the episode, with half a second or more after the last."""
    if points < 1:
        raise EpisodeError("--points must be at least 1")
    enough = max(8, length // 5)
    last = max(0, length - 1 - min(spec.execute or spec.horizon or enough, enough))
    chosen = np.linspace(0, last, min(points, last + 1))
    return list(dict.fromkeys(round(float(t)) for t in chosen))


def _case(
    policy: Policy, episode: Episode, t: int, view: ObservationFault | None
) -> AnswerSample | None:
    """The answer at frame `t`, seen as `view` undoes it; None if there is nothing to undo."""
    spec = policy.spec
    seen = episode.observation(spec, t)
    if view is not None:
        changed = view.undo(seen, None if episode.measured is None else episode.measured[t])
        if changed is None:
            return None
        seen = changed
    task = str(episode.about.get("task", "")) or "Pick_Blocks_Size"
    robot = str(episode.about.get("embodiment", REFERENCE))
    policy.reset(TrialInfo(task=task, embodiment=robot, instruction=episode.instruction))
    chunk = np.asarray(policy.infer(seen), dtype=float)
    chunk = chunk[: spec.execute] if spec.execute else chunk
    joint = spec.action == "joint"
    space = episode.space if joint else ActionSpace("ee", episode.space.joints)
    track = episode.commanded if joint else episode.ee.reshape(len(episode), space.width)
    recorded = track[t + 1 : t + 1 + len(chunk)]
    given = chunk[: len(recorded)]
    if given.shape != recorded.shape:
        raise EpisodeError(
            f"the policy answers {chunk.shape[1]} numbers an action, and {episode.name} has "
            f"{track.shape[1]} of that kind"
        )
    if spec.action == "delta_ee":
        given = from_pose(given, track[t], space, each=True, turned=True, local=True)
    measured = episode.measured if joint else None
    return AnswerSample(space, given, recorded, track[t], track, t, measured)


def _shown(spec: PolicySpec, view: ObservationFault) -> bool:
    """True if the policy's spec asks for what `view` changes."""
    state, poses = spec.state != "none", spec.action != "joint"
    asked = {"images": bool(spec.cameras), "state": state, "poses": poses, "robot": state or poses}
    return asked[view.touches]


def judge(
    cases: Sequence[AnswerSample],
    shown: dict[str, list[AnswerSample]],
    frames: tuple[int, ...] = (),
    untried: tuple[str, ...] = (),
    gain: float = GAIN,
) -> Findings:
    """The faults that explain `cases`, the answers; `shown` has those to faulty views by name."""
    before = [score(case) for case in cases]
    base = _guess((), None, cases, before)
    still = _guess((), None, [_held(case) for case in cases], before)
    parts = [*action_faults.PARTS, *fitted(cases)]
    views = [view for view in VIEWS if view.name in shown]
    singles = list(_tried(cases, None, parts, before, 1))
    singles += [_guess((), view, shown[view.name], before) for view in views]
    guesses = sorted(singles, key=lambda guess: guess.score)
    more: list[Guess] = []
    if min(guess.score for guess in (base, *guesses)) > EXPLAINED:  # perhaps two at once
        more += _tried(cases, None, parts, before, 2)
        for view in views:
            more += _tried(
                shown[view.name], view, [*action_faults.PARTS, *fitted(shown[view.name])], before, 1
            )
    fits = base.score <= FITS and base.score <= BETTER * still.score
    best = _simplest([g for g in (*guesses, *more) if _convincing(g, base, gain)])
    kind = "mistaken" if best is not None else "fits" if fits else "unclear"
    sentence = _sentence(kind, base, still, best)
    names = tuple(action_faults.groups(cases[0].space))
    return Findings(kind, names, base, still, tuple(guesses), best, sentence, frames, untried)


def _tried(
    cases: Sequence[AnswerSample],
    view: ObservationFault | None,
    parts: Iterable[ActionFault],
    before: Sequence[float],
    size: int,
) -> Iterator[Guess]:
    """Every choice of `size` parts of different families, undone in the order of `parts`."""
    for chosen in combinations(parts, size):
        if len({part.family for part in chosen}) < size:
            continue
        undone: list[AnswerSample] = []
        for case in cases:
            now: AnswerSample | None = case
            for part in chosen:
                now = part.undo(now) if now is not None else None
            if now is not None:
                undone.append(now)
        if len(undone) == len(cases):
            yield _guess(chosen, view, undone, before)


def _guess(
    parts: tuple[ActionFault, ...],
    view: ObservationFault | None,
    cases: Sequence[AnswerSample],
    before: Sequence[float],
) -> Guess:
    each = np.array([action_faults.errors(case) for case in cases])
    after = [score(case) for case in cases]
    change = np.subtract(before, after)
    felt = change[np.abs(change) > FELT]
    helped = (felt > 0).mean() if len(felt) else 0.0
    held = float(np.mean([score(_held(case)) for case in cases]))
    return Guess(parts, view, each.mean(axis=0), float(np.mean(after)), float(helped), held)


def _held(case: AnswerSample) -> AnswerSample:
    """The same with a policy that does not move."""
    return replace(case, given=np.tile(case.now, (len(case.recorded), 1)))


def _simplest(guesses: Sequence[Guess]) -> Guess | None:
    """The best guess, or one almost as good with fewer mistakes."""
    if not guesses:
        return None
    least = min(guess.score for guess in guesses)
    good = [guess for guess in guesses if guess.score <= 1.15 * least + 0.02]
    return min(good, key=lambda guess: (len(guess.names), guess.score))


def _convincing(guess: Guess, base: Guess, gain: float) -> bool:
    if guess.still > FELT and guess.score > LEARNED * guess.still:
        return False
    won = base.score - guess.score
    return won >= max(gain * base.score, LEAST) and guess.helped >= AGREE


def _sentence(kind: str, base: Guess, still: Guess, best: Guess | None) -> str:
    if best is not None:
        return (
            f"It looks as if {best.phrase}: undoing that takes the error from {base.score:.2f} to "
            f"{best.score:.2f}."
        )
    if kind == "fits":
        return (
            f"It fits the demonstration: error {base.score:.2f}, where 1 is good and holding still "
            f"has {still.score:.2f}; no change of conventions does much better."
        )
    return (
        f"It does not fit the demonstration (error {base.score:.2f}, holding still "
        f"{still.score:.2f}), and no mistake known here explains that: it may not have learned "
        "this task, or not be told what it was trained to be told."
    )
