"""The setting of an evaluation, and the refusal to average or compare different settings."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from robospa.results.records.manifest import RunManifest
from robospa.trial import TrialKey

TABLE = ("embodiment", "mode", "suite", "split")
COMPARISON = (*TABLE, "step_scale")
"""Parts of a setting that runs have to share in one table, and in one comparison."""
BESIDE_PAPER = ("embodiment", "mode")
"""Parts that a run has to share with published models, which are a suite of their own."""
OFFICIAL = "official-"
"""How the names of suites begin whose runs are held against the paper: those of the official world,
and of the official checkout. They never stand in one table with this benchmark's own suites."""
RAN_WITH = {
    "embodiment": "the embodiments {} and {}",
    "mode": "the scene modes {} and {}",
    "split": "the instruction splits {} and {}",
    "suite": "the suites {} and {}",
    "step_scale": "{:g} and {:g} times the official step limits",
    "clock": "the clocks {} and {}",
}
"""Words of messages for two different values of each part."""


class IncomparableError(ValueError):
    """Results that cannot stand in one table or comparison; the message says why and what to do."""


@dataclass(frozen=True)
class Setting:
    """The distinct values of every part over all trials; empty where a part is not known.

    `step_scale` multiplied the official step limits. `clock` is "paused", or a real one with its
    latency.
    """

    embodiment: tuple[str, ...] = ()
    mode: tuple[str, ...] = ()
    split: tuple[str, ...] = ()
    suite: tuple[str, ...] = ()
    step_scale: tuple[float, ...] = ()
    clock: tuple[str, ...] = ()

    def mixed(self) -> list[tuple[str, tuple[str, ...]]]:
        """The parts that have several values, with these."""
        parts = (("embodiment", self.embodiment), ("mode", self.mode), ("split", self.split))
        return [(name, values) for name, values in parts if len(values) > 1]


PAUSED = "paused"
"""The clock of the benchmark: the simulation waits for the policy."""


def setting_of(keys: Sequence[TrialKey], manifest: RunManifest) -> Setting:
    """The setting of the trials `keys` of a run."""
    return Setting(
        tuple(sorted({key.embodiment for key in keys})),
        tuple(sorted({key.mode for key in keys})),
        tuple(sorted({key.split for key in keys})),
        (manifest.suite,) if manifest.suite else (),
        (manifest.settings.step_scale,),
        (manifest.clock or PAUSED,),
    )


def check_same(settings: Iterable[tuple[str, Setting]], parts: Sequence[str]) -> None:
    """IncomparableError if one of the named settings mixes values, or two differ in `parts`.

    What one of several does not state equals nothing.
    """
    known = list(settings)
    for name, setting in known:
        for part, values in setting.mixed():
            raise IncomparableError(
                f"{name} mixes {RAN_WITH[part].format(', '.join(values[:-1]), values[-1])}, whose "
                "mean means nothing: evaluate one at a time"
            )
    for part in parts:
        found: dict[str | float, str] = {}
        for name, setting in known:
            if len(known) > 1 and not getattr(setting, part):
                raise IncomparableError(
                    f"{name} does not state its {part}, so it stands beside no other run: "
                    "evaluate it again"
                )
            for value in getattr(setting, part):
                found.setdefault(value, name)
        if len(found) > 1:
            (one, first), (other, second), *_ = found.items()
            raise IncomparableError(
                f"{first} and {second} cannot be compared: they ran with "
                f"{RAN_WITH[part].format(one, other)}"
            )
