"""The clock of a run: whether simulated time stands still while the policy thinks.

    paused                          it stands still, as in the benchmark: an answer comes at once
    real:0                          it goes on, and an answer takes no time
    real:200ms                      the same for every query
    real:p5=80ms,p50=120ms,p99=1s   percentiles
    real:latency.json               {"latency_ms": {"p5": 80, "p50": 120}}, or a list of samples

A latency is declared, not measured: results must not depend on how busy a machine is. It is a table
of percentiles, linear between two of them and constant beyond the outermost. What a query takes is
drawn from it by a random stream of the trial's own, one number a query, so that equal trials wait
equally long whatever the worker, the order and the policy. A real clock counts in periods, the time
that one action takes.
"""

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from msgspec import Meta

from robospa.harness.sim.motion import RATE
from robospa.protocol.options import check_ranges, option
from robospa.schema import parse_json

LONGEST = 60_000.0
"""[ms] that an answer may take: a minute is no real time."""
MOST_POINTS = 101
"""Percentiles that a table may have; a longer list of samples becomes so many."""
MOST_SAMPLES = 1_000_000
MOST_BYTES = 2**25
STREAM = 0x6C6174
"""Tells the stream of latencies from whatever else is seeded by a trial's policy seed."""
TIME = re.compile(r"(\d+(?:\.\d+)?)(ms|s)")
POINT = re.compile(r"p(\d+(?:\.\d+)?)=(.+)")


class ClockError(ValueError):
    """A clock, rate, latency or rule that cannot be; the message says why and what can."""


@dataclass(frozen=True)
class Latency:
    """A distribution of latencies. `points`: (percentile from 0 to 100, latency [ms]), both
    growing; a single point is a constant."""

    points: tuple[tuple[float, float], ...] = ((50.0, 0.0),)

    def __post_init__(self) -> None:
        if not 1 <= len(self.points) <= MOST_POINTS:
            raise ClockError(
                f"a latency has 1 to {MOST_POINTS} percentiles, not {len(self.points)}"
            )
        percentiles, values = zip(*self.points, strict=True)
        if not all(0.0 <= p <= 100.0 for p in percentiles) or any(
            b <= a for a, b in pairwise(percentiles)
        ):
            raise ClockError("percentiles go from 0 to 100 and grow")
        if not all(0.0 <= v <= LONGEST for v in values) or list(values) != sorted(values):
            raise ClockError(
                f"latencies go from 0 to {LONGEST:g} ms and do not fall with the percentile"
            )

    @property
    def constant(self) -> float | None:
        """The latency [ms] if it is the same for every query."""
        first, last = self.points[0][1], self.points[-1][1]
        return first if first == last else None

    def at(self, share: float) -> float:
        """The latency [ms] that the `share` (0 to 1) of queries does not exceed."""
        percentiles, values = zip(*self.points, strict=True)
        return float(np.interp(100.0 * share, percentiles, values))

    def draws(self, policy_seed: int) -> Iterator[float]:
        """The latencies [ms] of a trial's queries, one after the other; they follow from the
        trial's policy seed."""
        stream = np.random.default_rng(np.random.SeedSequence([policy_seed, STREAM]))
        while True:
            yield self.at(stream.random())

    def __str__(self) -> str:
        """As `parse_latency` reads it."""
        if self.constant is not None:
            return _time(self.constant)
        return ",".join(f"{_percentile(p)}={_time(v)}" for p, v in self.points)


def _time(milliseconds: float) -> str:
    """Every digit of it: what is read again is equal."""
    digits = f"{milliseconds:.6f}".rstrip("0").rstrip(".")
    return f"{digits}ms" if digits != "0" else "0"


def _percentile(number: float) -> str:
    return f"p{number:.9g}"  # 100 with six decimals, which is what is read


def parse_latency(text: str) -> Latency:
    """The latency that `text` declares; a file is read now. Raises ClockError."""
    text = text.strip()
    if text == "0" or TIME.fullmatch(text):
        return Latency(((50.0, _milliseconds(text)),))
    if text.startswith("p") and "=" in text:
        points = []
        for part in text.split(","):
            found = POINT.fullmatch(part.strip())
            if found is None:
                raise ClockError(f"{part.strip()!r} is no percentile, such as p50=120ms")
            points.append((round(float(found[1]), 6), _milliseconds(found[2])))
        return Latency(tuple(points))
    return read_latency(Path(text))


def _milliseconds(text: str) -> float:
    if text == "0":
        return 0.0
    found = TIME.fullmatch(text)
    if found is None:
        raise ClockError(f"{text!r} is no time: write 200ms, or 0.2s")
    return round(float(found[1]) * (1000.0 if found[2] == "s" else 1.0), 6)


def read_latency(path: Path) -> Latency:
    """The latency in a JSON file: `latency_ms` is a map from p0 ... p100 to milliseconds, or a
    list of measured ones. Raises ClockError."""
    try:
        if path.stat().st_size > MOST_BYTES:
            raise ClockError(f"{path} has more than {MOST_BYTES} bytes")
        data = parse_json(path.read_text())
    except OSError as error:
        raise ClockError(
            f"{str(path)!r} is no latency: write 200ms, percentiles such as p50=120ms,p99=300ms, "
            f"or a file, but as a file it cannot be read ({error.strerror})"
        ) from error
    except ClockError:
        raise
    except ValueError as error:
        raise ClockError(f"{path} is no JSON: {error}") from error
    found = data.get("latency_ms") if isinstance(data, Mapping) else None
    try:
        if isinstance(found, Mapping):
            points = [(str(name).removeprefix("p"), v) for name, v in found.items()]
            return Latency(
                tuple(sorted((round(float(p), 6), round(float(v), 6)) for p, v in points))
            )
        if isinstance(found, Sequence) and not isinstance(found, str):
            return of_samples([float(v) for v in found])
    except ClockError as error:
        raise ClockError(f"{path}: {error}") from error
    except (TypeError, ValueError, OverflowError) as error:
        raise ClockError(f"{path}: 'latency_ms' has something that is no number") from error
    raise ClockError(
        f"{path} has no 'latency_ms', a map of percentiles or a list of measured latencies"
    )


def of_samples(samples: Sequence[float]) -> Latency:
    """The distribution of measured latencies [ms], to the microsecond; ClockError for none, too
    many, or one that is no time."""
    if not 1 <= len(samples) <= MOST_SAMPLES or not all(map(math.isfinite, samples)):
        raise ClockError(f"a list of latencies has 1 to {MOST_SAMPLES} finite numbers")
    percentiles = np.linspace(0.0, 100.0, min(MOST_POINTS, len(samples)))
    if len(samples) == 1:
        percentiles = np.array([50.0])
    values = np.percentile(np.asarray(samples, float), percentiles)
    pairs = zip(percentiles.tolist(), values.tolist(), strict=True)
    return Latency(tuple((round(p, 6), round(v, 3)) for p, v in pairs))


def latency_json(latency: Latency) -> dict[str, Any]:
    """As a file has it."""
    return {"latency_ms": {_percentile(p): v for p, v in latency.points}}


RULE = re.compile(r"(wait|arrival|after|ensemble|rtc)(?::([1-9][0-9]{0,4}))?")


@dataclass(frozen=True)
class Switching:
    """What happens to the actions that are left of a chunk: when the next one is asked for, and how
    it takes over.

        wait           ask when all is executed, and hold meanwhile
        arrival        ask again as soon as an answer is there; a chunk replaces the one before
        after:K        ask when K actions of the chunk were executed, go on, replace on arrival
        ensemble[:K]   the same, but an action is the weighted mean of all chunks that have one
        rtc[:K]        as after:K; the request carries what real-time chunking needs
        rtc, ensemble  K is 1, as for arrival: an action is executed before the next query

    `after`: actions of a chunk that are executed before the next is asked for, None where all are.
    """

    kind: str = "wait"
    after: int | None = None

    def __str__(self) -> str:
        """As `parse_switching` reads it."""
        plain = self.after is None or self.kind == "arrival"
        return self.kind if plain else f"{self.kind}:{self.after}"


def parse_switching(text: str) -> Switching:
    """The rule that `text` names; raises ClockError."""
    found = RULE.fullmatch(text)
    kind, count = (found[1], found[2]) if found else ("", None)
    if not kind or (kind == "after" and not count) or (kind in ("wait", "arrival") and count):
        raise ClockError(
            f"no way to switch between chunks is called {text!r}; there are wait, arrival, "
            "after:K, ensemble, ensemble:K, rtc and rtc:K, K actions"
        )
    return Switching(kind, None if kind == "wait" else int(count or 1))


PAUSED = "paused"
REAL = "real"
RATE_TOLERANCE = 0.01
"""A rate may be written with so much of it rounded away: 16.67 is 250 / 15."""


@dataclass(frozen=True)
class PolicyClock:
    """A real clock.

    `period` is how long an action takes, in physics steps. `seconds`: simulated time that a trial
    may take, None for as long as its step limit takes at this rate.
    """

    latency: Latency = field(default_factory=Latency)
    switching: Switching = field(default_factory=Switching)
    period: int = 15
    seconds: float | None = None

    @property
    def period_ms(self) -> float:
        """How long an action takes [ms]."""
        return 1000.0 * self.period / RATE

    def delay(self, latency: float) -> int:
        """Whole periods until an answer that takes `latency` [ms] has an effect."""
        return math.ceil(latency / self.period_ms - 1e-9)

    def periods(self, step_limit: int) -> int:
        """Periods that a trial with this limit of actions may take."""
        if self.seconds is None:
            return step_limit
        return max(1, math.floor(self.seconds * RATE / self.period + 1e-9))

    def to_json(self) -> dict[str, Any]:
        """For the manifest: what a trial's result depends on, percentiles and all."""
        return {
            "latency": str(self.latency),
            "latency_ms": self.latency.constant,
            "switching": str(self.switching),
            "action_steps": self.period,
            "seconds": self.seconds,
        }


def declared_latency(text: str) -> Latency | None:
    """The latency that the clock `text` declares, None for the paused one. Raises ClockError."""
    if text == PAUSED:
        return None
    kind, mark, latency = text.partition(":")
    if kind != REAL or not mark or not latency:
        raise ClockError(
            f"there is no clock {text!r}: paused, or real with a declared latency, such as "
            "real:200ms, real:p50=120ms,p99=300ms or real:FILE"
        )
    return parse_latency(latency)


def action_steps(rate: float) -> int:
    """Physics steps of an action at `rate` actions a second; raises ClockError for a rate whose
    actions take no whole number of them."""
    steps = max(1, round(RATE / rate))
    if abs(RATE / steps - rate) > RATE_TOLERANCE * rate:
        fewer = max(1, math.floor(RATE / rate))
        rates = f"{rate_of(fewer + 1):.4g} and {rate_of(fewer):.4g}"
        raise ClockError(
            f"{rate:g} actions a second are no whole number of physics steps each: the nearest "
            f"rates are {rates}"
        )
    return steps


def rate_of(steps: int) -> float:
    """Actions a second if each takes so many physics steps."""
    return RATE / steps


def timed_suite(suite: str, steps: int | None) -> str:
    """The name of `suite` where every action takes so many physics steps; None is the rule of the
    benchmark, from rest to rest. Results of different names are never ranked or averaged."""
    return suite if steps is None else f"{suite}-{rate_of(steps):.4g}hz"


def timing_warning(suite: str, steps: int, clock: PolicyClock | None) -> str:
    """What to know before a run in which every action takes so many physics steps."""
    time = "" if clock is None else f", in real time with latency {clock.latency}"
    return (
        f"every action takes {1000.0 * steps / RATE:g} ms{time}: the results are of the suite "
        f"{suite}, and never stand beside those of the benchmark's rule"
    )


FIXED_RATE = "fixed_rate"
FIXED_STEPS = 10
"""Physics steps of an action with control fixed_rate and no declared rate: 25 a second."""


@dataclass(frozen=True)
class Timing:
    """Time in a trial; part of what decides its result."""

    action_rate: Annotated[float, Meta(ge=1, le=250)] | None = option(
        None,
        "actions a second, each of the same duration, such as 16.67 or 50: a suite of its own; "
        "none is the benchmark's rule, from rest to rest",
    )
    clock: str = option(
        PAUSED,
        "paused (the benchmark), or real with a declared latency: real:200ms, "
        "real:p50=120ms,p99=300ms, real:FILE; the robot goes on while the policy thinks",
    )
    switch: str = option(
        "wait",
        "with a real clock, how a chunk follows another: wait, arrival, after:K, ensemble:K, rtc:K",
    )
    time_limit: Annotated[float, Meta(gt=0, le=86400)] | None = option(
        None, "with a real clock, simulated seconds of a trial; none: what its step limit takes"
    )

    def __post_init__(self) -> None:
        check_ranges(self)
        declared_latency(self.clock)
        parse_switching(self.switch)
        if self.action_rate is not None:
            action_steps(self.action_rate)


def steps_of(timing: Timing, control: str) -> int | None:
    """Physics steps that every action takes; None where they go from rest to rest."""
    if timing.action_rate is not None:
        return action_steps(timing.action_rate)
    return FIXED_STEPS if control == FIXED_RATE else None


def real_clock(timing: Timing, control: str) -> PolicyClock | None:
    """The real clock, with the latencies that its file holds now; None for the paused one.

    Raises ClockError for settings that do not go together.
    """
    latency, switching = declared_latency(timing.clock), parse_switching(timing.switch)
    steps = steps_of(timing, control)
    if latency is None:
        if switching != Switching() or timing.time_limit is not None:
            raise ClockError(
                "switch and time_limit go with a real clock, such as --clock real:200ms"
            )
        return None
    if steps is None:
        raise ClockError(
            "a real clock needs actions of a declared duration: add the rate that the policy was "
            "trained at, such as --action-rate 16.67"
        )
    return PolicyClock(latency, switching, steps, timing.time_limit)


def frozen_timing(timing: Timing) -> Timing:
    """`timing` without a file: with the percentiles that it holds now."""
    latency = declared_latency(timing.clock)
    return timing if latency is None else replace(timing, clock=f"{REAL}:{latency}")
