"""What a submission's badges rest on: `evidence.json`, as `robospa submit` writes it."""

from __future__ import annotations

import re
from typing import Annotated

from msgspec import Struct

from robospa.leaderboard.agreement import LEAST_POWER, LIE
from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.bundle_in_repository import FILE
from robospa.leaderboard.card import LINK
from robospa.leaderboard.sampling import check_challenge, least_sample
from robospa.schema import Count, Number, pattern, read

BADGES = ("valid", "replayed", "reproduced")


class Validity(Struct, frozen=True):
    """Level 1: the bundle's hash, how much it holds, and the warnings of our lint."""

    bundle: str
    trials: Count
    variants: Count
    practice: bool = False
    made_with: str = ""
    tables_compared: bool = True
    warnings: tuple[str, ...] = ()


class ReplayEvidence(Struct, frozen=True):
    """Level 2: how many of the sampled trials came again identically, alike, or differently."""

    sampled: Count
    trials: Count
    identical: Count
    agrees: Count
    different: Count
    challenge: str
    bundle: str


class OverallTest(Struct, frozen=True):
    """The test over all hidden trials: `fresh` successes where `expected` agree with the claim."""

    p: Number
    fresh: Count
    expected: Number


class CategoryTest(Struct, frozen=True):
    """The test of a category; its p-value is corrected after Holm."""

    p_holm: Number


class Reproduction(Struct, frozen=True):
    """Level 3: how `trials` on hidden scenes agree with the claims of the bundle with this hash,
    tested at the level `alpha`. `power` is the chance to notice rates that are lower everywhere, by
    how much; `repeated` trials count as failures."""

    bundle: str
    alpha: Number
    overall: OverallTest
    categories: dict[str, CategoryTest]
    trials: Count
    power: dict[str, Number]
    repeated: Count = 0
    commitment: str = ""

    @property
    def notices(self) -> float:
        """The chance to notice a lie of five points."""
        return self.power.get(f"{LIE:g}", 0.0)


class Evidence(Struct, frozen=True):
    """All of it, and the bundle's address where it is known; FILE if it lies in the folder."""

    valid: Validity
    replayed: ReplayEvidence | None = None
    reproduced: Reproduction | None = None
    address: Annotated[
        str, pattern(rf"({LINK.pattern}|{re.escape(FILE)})?", f"a https address or {FILE}")
    ] = ""

    @property
    def badges(self) -> tuple[str, ...]:
        """The badges that the evidence carries, weakest first."""
        made = ["valid"]
        if self.replayed:
            exact = self.replayed.identical == self.replayed.sampled
            made.append("replayed" if exact else "outcomes")
        if self.reproduced:
            made.append("reproduced")
        return tuple(made)


def read_evidence(data: object, bundle: str, where: str) -> Evidence:
    """`data` as evidence; BundleError unless it is of the bundle with the hash `bundle` and
    contradicts nothing in it."""
    evidence = read(Evidence, data, f"{where}: the evidence", BundleError)
    if evidence.valid.bundle != bundle:
        raise BundleError(f"{where} has no evidence that this very bundle is valid")
    again, fresh = evidence.replayed, evidence.reproduced
    for part, name in ((again, "replay"), (fresh, "reproduction")):
        if part and part.bundle != bundle:
            raise BundleError(f"{where}: the {name} is of another bundle")
    if again:
        _check_replay(again, evidence.valid.trials, where)
    if evidence.address == FILE and (not again or again.sampled < again.trials):
        raise BundleError(
            f"{where}: not all trials were replayed, as those of a bundle in the repository are: "
            "robospa submit verify --challenge VALUE --fraction 1"
        )
    if fresh:
        _check_power(fresh, where)
        least = min([fresh.overall.p, *(test.p_holm for test in fresh.categories.values())])
        if least < fresh.alpha:
            raise BundleError(f"{where}: hidden seeds contradict what the bundle claims")
    return evidence


def _check_power(fresh: Reproduction, where: str) -> None:
    """BundleError unless the reproduction would have noticed a lie."""
    if fresh.trials < 1 or fresh.notices < LEAST_POWER:
        raise BundleError(
            f"{where}: {fresh.trials} trials on hidden scenes notice a lie of {100 * LIE:g} points "
            f"with {100 * fresh.notices:.0f} %; a badge needs {100 * LEAST_POWER:g} %"
        )


def _check_replay(again: ReplayEvidence, trials: int, where: str) -> None:
    """BundleError unless a large enough sample of the bundle's `trials` came again."""
    if again.different:
        raise BundleError(f"{where}: the replay found other outcomes than the bundle has")
    if again.trials != trials or again.identical + again.agrees != again.sampled:
        raise BundleError(f"{where}: the replay's counts are not those of the bundle")
    if again.sampled < (least := least_sample(trials)):
        raise BundleError(
            f"{where}: {again.sampled} of {trials} trials were replayed; {least} is the least"
        )
    check_challenge(again.challenge)
