"""Which trials are replayed, what such a sample shows, and what a submission's badges rest on.

Trials are chosen by hashes: those of the videos follow from the suite alone, so that all models are
filmed on the same scenes, and those that are replayed from a value that nobody can know before the
bundle is handed in. `evidence.json` is what `robospa submit` writes of both.
"""

import math
import re
from collections.abc import Iterable, Sequence
from functools import cached_property
from typing import Annotated

from msgspec import Meta, Struct

from robospa.leaderboard.agreement import (
    CELL_LIE,
    LEAST_POWER,
    LIE,
    Agreement,
    Counts,
    agreement,
    cells,
    contradictions,
)
from robospa.leaderboard.bundle import IN_REPOSITORY, BundleError, sha256
from robospa.leaderboard.card import LINK
from robospa.results.records.manifest import Processor
from robospa.schema import Count, Number, one_of, pattern, read
from robospa.text import some
from robospa.trial import TrialKey

CHALLENGE = 8
"""A challenge has at least this many characters: fewer can be guessed."""
FORGED = 0.05
"""The share of invented outcomes that no sample may miss more often than MISSED."""
MISSED = 0.001
INVENTED = (0.05, 0.02, 0.01)
"""The shares of invented outcomes for which the chance is stated."""
APART = 20.0
"""The most that half of the replayed trials may lie apart [mm]. A start moved by 1e-7 m moves the
end of half the trials by 0.001 mm, but that of a bottle that is dropped by 320 mm."""


def announced(suite: str, keys: Iterable[TrialKey]) -> list[TrialKey]:
    """The trials that are filmed: one of every base task, by the hash of suite and scene."""
    first: dict[str, tuple[str, TrialKey]] = {}
    for key in keys:
        rank = (sha256(f"{suite}/{key.task}/{key.level}/{key.seed}".encode()), key)
        first[key.task] = min(first.get(key.task, rank), rank)
    return [key for _, key in sorted(first.values(), key=lambda pair: pair[1])]


def check_challenge(challenge: str) -> None:
    """BundleError for a challenge that is too short."""
    if len(challenge.strip()) < CHALLENGE:
        raise BundleError(
            f"the challenge has fewer than {CHALLENGE} characters: use a value that could not be "
            "known before the bundle was handed in, such as the merge commit's hash"
        )


def drawn(challenge: str, bundle: str, keys: Sequence[TrialKey], count: int) -> list[TrialKey]:
    """`count` of `keys` without repeats, every set equally likely over all challenges.

    The bundle's own hash is mixed in: two bundles get two samples.
    """
    seed = f"{challenge.strip()}/{bundle}"
    return sorted(keys, key=lambda key: sha256(f"{seed}/{key.slug}".encode()))[:count]


def least_sample(trials: int) -> int:
    """The smallest sample of `trials` that misses FORGED of them (one at least) at most once in a
    thousand.

    It is 135 of 28,000 trials, 131 of 2,000, and all of fewer than 20.
    """
    forged, missed = max(1, math.floor(FORGED * trials)), 1.0
    for count in range(trials):
        if missed <= MISSED:
            return count
        missed *= 1 - forged / (trials - count)
    return trials


def sample_size(fraction: float, trials: int) -> int:
    """How many of `trials` are replayed: this `fraction`, rounded up, or `least_sample` if that is
    more. BundleError for a fraction that is none."""
    if not 0 < fraction <= 1:
        raise BundleError(f"the fraction {fraction:g} is not above 0 and at most 1")
    return max(least_sample(trials), min(trials, math.ceil(fraction * trials - 1e-9)))


def catch_probability(trials: int, forged: int, sampled: int) -> float:
    """Probability that at least one of `forged` among `trials` is in a sample of `sampled`."""
    honest = trials - forged
    if sampled > honest:
        return 1.0
    missed = sum(math.log1p(-forged / (trials - i)) for i in range(sampled))
    return -math.expm1(missed)


def what_it_catches(trials: int, sampled: int) -> str:
    """The chance that a sample holds an invented outcome, as a sentence."""
    words = []
    for share in INVENTED:
        chance = catch_probability(trials, max(1, math.floor(share * trials)), sampled)
        words.append(f"{100 * chance:.1f} % for {100 * share:g} %")
    return (
        "The chance that such a sample holds one of the outcomes, if some were invented: "
        f"{', '.join(words)}."
    )


BADGES = ("valid", "replayed", "reproduced")


class Validity(Struct, frozen=True):
    """Level 1: the bundle's hash, how much it holds, how often the run was started or gone on with
    and how many of its trials were started more than once, and the warnings of our lint."""

    bundle: str
    trials: Count
    variants: Count
    practice: bool = False
    drivers: Count = 0
    repeated: Count = 0
    warnings: tuple[str, ...] = ()

    @property
    def attempts(self) -> str:
        """How often trials were tried, as a sentence: what may hide the best of several."""
        drivers = self.drivers or "an unknown number of"
        return (
            f"The run had {drivers} driver{'s' * (drivers != 1)}, and {self.repeated} of its "
            "trials were started more than once."
        )


class ReplayEvidence(Struct, frozen=True, kw_only=True):
    """Level 2: how many of the sampled trials came again identically, alike, or differently, and
    versions that are others than the run's. Of the `placed` trials,
    whose records say where objects came to lie, the `median` and the `most` of how far one lay
    apart [mm]."""

    bundle: str
    challenge: str
    sampled: Count
    trials: Count
    identical: Count
    agrees: Count
    different: Count
    changed_versions: tuple[str, ...] = ()
    different_trials: tuple[str, ...] = ()
    ran_on: tuple[Processor, ...] = ()
    played_on: Processor = Processor()
    placed: Count = 0
    median: Number = 0.0
    most: Number = 0.0

    @property
    def holds(self) -> bool:
        """Whether every outcome came again, and most objects where they lay."""
        return self.different == 0 and self.median <= APART

    @property
    def exact(self) -> bool:
        """Whether every final state came again to the bit."""
        return self.identical == self.sampled

    @property
    def same_kind(self) -> bool:
        """Whether run and replay say that they were on one kind of processor."""
        return {one.kind for one in self.ran_on} == {self.played_on.kind}

    @property
    def sentence(self) -> str:
        """What came again, and how exactly, for people."""
        ran = ", ".join(map(str, dict.fromkeys(self.ran_on))) or "not stated"
        played = str(self.played_on) if self.played_on.vendor else "not stated"
        said = (
            f"{self.sampled} of {self.trials} trials were played again: "
            f"{self.sampled - self.different} with the same outcome, {self.identical} of them with "
            "the same final state to the bit, as one kind of processor gives (the run's: "
            f"{ran}; the replay's: {played})."
        )
        if not self.placed:
            return f"{said} The records do not say where objects came to lie."
        return (
            f"{said} Objects of {self.placed} trials lay at most {self.most:.2f} mm apart, half of "
            f"the trials within {self.median:.2f} mm."
        )


Chance = Annotated[float, Meta(ge=0, le=1)]
Four = tuple[Count, Count, Count, Count]
"""Claimed successes and trials of a variant, and fresh ones."""
RANKED = "sr1"
"""The metric whose power is stated: models are ranked by it, and by what follows from it."""
TESTED = ("sr", RANKED)
MOST_ALPHA = 0.1
"""A test at a higher level is none."""


class Reproduction(Struct, frozen=True, kw_only=True, dict=True):
    """Level 3: how `trials` on hidden scenes agree with the claims of the bundle with this hash,
    tested at the level `alpha`. `repeated` ones count as failures. `counts` are by metric and
    variant; `power` is the chance to notice rates that are lower everywhere, by how much, and
    `cells` that of CELL_LIE in a cell alone."""

    bundle: str
    commitment: str = ""
    trials: Count
    repeated: Count = 0
    alpha: Annotated[float, Meta(gt=0, le=MOST_ALPHA)]
    categories: dict[str, str]
    counts: dict[Annotated[str, one_of(TESTED)], dict[str, Four]]
    power: dict[Annotated[str, pattern(r"0\.[0-9]{1,6}", "a number below 1")], Chance]
    cells: dict[str, Chance]

    def __post_init__(self) -> None:
        found = [self.counts.get(metric, {}) for metric in TESTED]
        fours = [four for counts in found for four in counts.values()]
        if (
            any(good > of or again > fresh or not of for good, of, again, fresh in fours)
            or any(sum(four[3] for four in counts.values()) != self.trials for counts in found)
            or any(name.rpartition("/")[0] not in self.categories for name in found[0] | found[1])
            or not set(self.cells) <= set(cells(found[0], self.categories))
        ):
            raise ValueError("its counts, trials, categories and cells do not fit each other")

    @property
    def notices(self) -> float:
        """The chance to notice a lie of five points."""
        return self.power.get(f"{LIE:g}", 0.0)

    @property
    def enough(self) -> bool:
        """Whether a lie of five points would have been noticed."""
        return self.trials > 0 and self.notices >= LEAST_POWER

    @property
    def ranks(self) -> list[str]:
        """The cells in which a lie of CELL_LIE would have been noticed."""
        return [name for name, chance in self.cells.items() if chance >= LEAST_POWER]

    @property
    def holds(self) -> bool:
        return not self.contradictions

    @cached_property
    def contradictions(self) -> dict[str, float]:
        metrics = {m: {v: Counts(*four) for v, four in c.items()} for m, c in self.counts.items()}
        return contradictions(metrics, self.categories, self.alpha)

    @cached_property
    def overall(self) -> Agreement:
        """The test of everything, in the metric that ranks."""
        return agreement(Counts(*four) for four in self.counts[RANKED].values())

    def sentences(self) -> list[str]:
        """What this shows and what it does not, for people."""
        counts = self.counts[RANKED].values()
        claimed = sum(good / trials * fresh for good, trials, _, fresh in counts)
        said = [
            f"{self.overall.fresh} of {self.trials} fresh trials succeeded at the first choice "
            f"where the claim leads one to expect {claimed:.1f} (exact test over {len(counts)} "
            f"variants, two-sided p = {self.overall.p:.3g})."
        ]
        if found := self.contradictions:
            named = [f"{name} (p = {p:.3g})" for name, p in found.items()]
            said.append(f"The claim is contradicted by {some(named)}.")
        power = {float(drop): 100 * chance for drop, chance in self.power.items()}
        chances = ", ".join(f"{100 * drop:g} points {p:.0f} %" for drop, p in power.items())
        said.append(f"Chance to notice rates that are lower everywhere by: {chances}.")
        said.append(
            f"In {len(self.ranks)} of {len(self.cells)} cells, {some(self.ranks)}, a lie of "
            f"{100 * CELL_LIE:g} points in that cell alone would show with "
            f"{100 * LEAST_POWER:g} %: these are ranked."
        )
        if self.repeated:
            said.append(f"{self.repeated} trials were repeated and count as failures.")
        if not self.enough:
            said.append(f"A badge needs {100 * LEAST_POWER:g} % for {100 * LIE:g} points.")
        return said


class BadgeEvidence(Struct, frozen=True):
    """All of it, and the bundle's address where it is known."""

    valid: Validity
    replayed: ReplayEvidence | None = None
    reproduced: Reproduction | None = None
    address: Annotated[
        str,
        pattern(
            rf"({LINK.pattern}|{re.escape(IN_REPOSITORY)})?", f"a https address or {IN_REPOSITORY}"
        ),
    ] = ""

    @property
    def badges(self) -> tuple[str, ...]:
        """The badges that the evidence carries, weakest first."""
        made = ["valid"]
        if self.replayed:
            made.append("replayed" if self.replayed.exact else "outcomes")
        if self.reproduced:
            made.append("reproduced")
        return tuple(made)


def read_evidence(data: object, bundle: str, where: str) -> BadgeEvidence:
    """`data` as evidence; BundleError unless it is of the bundle with the hash `bundle` and
    contradicts nothing in it."""
    evidence = read(BadgeEvidence, data, f"{where}: the evidence", BundleError)
    if evidence.valid.bundle != bundle:
        raise BundleError(f"{where} has no evidence that this very bundle is valid")
    again, fresh = evidence.replayed, evidence.reproduced
    for part, name in ((again, "replay"), (fresh, "reproduction")):
        if part and part.bundle != bundle:
            raise BundleError(f"{where}: the {name} is of another bundle")
    if again:
        _check_replay(again, evidence.valid.trials, where)
    if evidence.address == IN_REPOSITORY and (not again or again.sampled < again.trials):
        raise BundleError(
            f"{where}: not all trials were replayed, as those of a bundle in the repository are: "
            "robospa submit verify --challenge VALUE --fraction 1"
        )
    if fresh and not fresh.enough:
        raise BundleError(
            f"{where}: {fresh.trials} trials on hidden scenes notice a lie of {100 * LIE:g} points "
            f"with {100 * fresh.notices:.0f} %; a badge needs {100 * LEAST_POWER:g} %"
        )
    if fresh and not fresh.holds:
        raise BundleError(
            f"{where}: hidden seeds contradict what the bundle claims: "
            f"{some([*fresh.contradictions])}"
        )
    return evidence


def _check_replay(again: ReplayEvidence, trials: int, where: str) -> None:
    """BundleError unless a large enough sample of the bundle's `trials` came again."""
    if not again.holds:
        raise BundleError(
            f"{where}: the replay found other outcomes, or objects elsewhere, than the bundle has"
        )
    came = again.identical + again.agrees
    if again.trials != trials or came != again.sampled or came > trials:
        raise BundleError(f"{where}: the replay's counts are not those of the bundle")
    if again.sampled < (least := least_sample(trials)):
        raise BundleError(
            f"{where}: {again.sampled} of {trials} trials were replayed; {least} is the least"
        )
    check_challenge(again.challenge)
