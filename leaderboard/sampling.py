"""Which trials are looked at: chosen by hashes, so that nobody can choose them.

The trials of the videos follow from what is fixed before the first trial. Those that are replayed
follow from a value that nobody can know before the bundle is handed in.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterable, Sequence

from robospa.leaderboard.bundle import BundleError
from robospa.trial import TrialKey

CHALLENGE = 8
"""A challenge has at least this many characters: fewer can be guessed."""


def announced(inputs: str, keys: Iterable[TrialKey]) -> list[TrialKey]:
    """The trials that are filmed: one of every base task, by the hash of the run's inputs."""
    first: dict[str, tuple[str, TrialKey]] = {}
    for key in keys:
        rank = (_rank(inputs, key), key)
        first[key.task] = min(first.get(key.task, rank), rank)
    return [key for _, key in sorted(first.values(), key=lambda pair: pair[1])]


def drawn(challenge: str, bundle: str, keys: Sequence[TrialKey], count: int) -> list[TrialKey]:
    """`count` of `keys` without repeats, every set equally likely over all challenges.

    The bundle's own hash is mixed in: two bundles get two samples. Raises BundleError for a
    challenge that is too short.
    """
    if len(challenge.strip()) < CHALLENGE:
        raise BundleError(
            f"the challenge has fewer than {CHALLENGE} characters: use a value that could not be "
            "known before the bundle was handed in, such as the merge commit's hash"
        )
    seed = f"{challenge.strip()}/{bundle}"
    return sorted(keys, key=lambda key: _rank(seed, key))[:count]


def sample_size(fraction: float, trials: int) -> int:
    """How many of `trials` a sample of this `fraction` has: at least one, rounded up."""
    if not 0 < fraction <= 1:
        raise BundleError(f"the fraction {fraction:g} is not above 0 and at most 1")
    return max(1, min(trials, math.ceil(fraction * trials - 1e-9)))


def catch_probability(trials: int, forged: int, sampled: int) -> float:
    """Probability that at least one of `forged` among `trials` is in a sample of `sampled`."""
    honest = trials - forged
    if sampled > honest:
        return 1.0
    missed = sum(math.log1p(-forged / (trials - i)) for i in range(sampled))
    return -math.expm1(missed)


def _rank(seed: str, key: TrialKey) -> str:
    return hashlib.sha256(f"{seed}/{key.slug}".encode()).hexdigest()
