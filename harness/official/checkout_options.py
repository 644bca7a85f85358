"""How a checkout is named as a world: `checkout:DIR`, with options as in a URL."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from msgspec import Meta

from robospa.harness.clock.clock import PAUSED
from robospa.harness.settings import EvaluationSettings, Selection, SettingsError
from robospa.harness.worlds import Parts, WorldKind
from robospa.protocol.options import option, plain_options, read_options, url_options
from robospa.trial import TrialKey

PREFIX = "checkout:"
PARTS = "robospa.harness.official.checkout_parts:checkout_parts"
SUITE = "official-checkout"
"""The suite of results in a checkout: its scenes, simulator, robots and rules."""
CONFIGS = {"clean": "demo_clean", "randomized": "demo_randomized"}
"""The official configuration of each of our scene modes that there is one for."""


@dataclass(frozen=True)
class CheckoutOptions:
    """Options of `checkout:DIR?name=value&...`."""

    python: str = option("python", "the Python of the checkout's environment")
    config: str = option("", "a file of task_config/, without .yml; default: by scene mode")
    patience: Annotated[float, Meta(gt=0, le=1000)] = option(
        1.0, "multiplies how long the checkout may take for an answer"
    )


def parse_checkout(world: str) -> tuple[Path, CheckoutOptions]:
    """The folder and the options that `world` names; raises SettingsError."""
    folder, _, query = world.removeprefix(PREFIX).partition("?")
    if not folder:
        raise SettingsError("--world checkout: lacks the folder: write checkout:DIR")
    try:
        return Path(folder).absolute(), read_options(CheckoutOptions, url_options(query))
    except ValueError as error:
        raise SettingsError(f"--world {world}: {error}") from error


Episodes = Mapping[tuple[str, int], Sequence[int]]
"""The seeds of every variant in their order: a seed's place is its official episode number, which
decides variants of objects and viewpoints."""


def episodes_of(keys: Sequence[TrialKey]) -> Episodes:
    """The seeds of every variant of `keys`, in their order, each once."""
    found: dict[tuple[str, int], dict[int, None]] = {}
    for key in keys:
        found.setdefault(key.variant, {})[key.seed] = None
    return {variant: tuple(seeds) for variant, seeds in found.items()}


class _CheckoutKind(WorldKind):
    alone = "a checkout has one simulator a process"
    workers = 1  # each takes a share of the GPU

    def selection(self, settings: EvaluationSettings) -> Selection:
        """With the official splits, because a checkout has sentences of its own."""
        super().selection(settings)
        return _selection(settings)

    def arguments(self, settings: EvaluationSettings) -> dict[str, object]:
        """The folder and the options that the world names."""
        folder, options = parse_checkout(settings.simulation.world)
        return {"folder": str(folder), **plain_options(options)}

    def parts(self, settings: EvaluationSettings, keys: Sequence[TrialKey]) -> Parts:
        """Scenes that only name what is made there."""
        return PARTS, {"episodes": episodes_of(keys)}


CHECKOUT = _CheckoutKind("checkout", "robospa.harness.official.checkout_world:CheckoutWorld")


def _selection(settings: EvaluationSettings) -> Selection:
    folder, options = parse_checkout(settings.simulation.world)
    selection, simulation = settings.selection, settings.simulation
    for wrong, sentence in (
        (selection.instructions, "a checkout has its own sentences: leave instructions out"),
        (
            selection.seeds is None,
            "a checkout's valid seeds are not ours: find some with `robospa official "
            "checkout DIR --find FILE` and name the file with seeds",
        ),
        (
            settings.recording.video != "none",
            "a checkout does not play a trial again, which is how films are made: leave video out",
        ),
        (
            simulation.control != "rest_to_rest",
            "a checkout executes actions in its own way: leave control out",
        ),
        (
            settings.timing.action_rate is not None or settings.timing.clock != PAUSED,
            "a checkout executes actions in its own way: leave action_rate and clock out",
        ),
        (simulation.parts, "a checkout has goals of its own: leave parts out"),
        (
            simulation.shuffle_instructions,
            "a checkout has its own sentences: leave shuffle_instructions out",
        ),
        (
            not options.config and any(m not in CONFIGS for m in selection.mode.split(",")),
            f"a checkout has the scene modes {' and '.join(CONFIGS)}, or a file of its own with "
            "checkout:DIR?config=NAME",
        ),
    ):
        if wrong:
            raise SettingsError(sentence)
    return replace(selection, instructions=folder)
