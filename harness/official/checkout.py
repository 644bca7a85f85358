"""A RoboSPA checkout as a kind of world: how it is named (`checkout:DIR`, with options as in a
URL), what it can do, and the parts of its trials.

A trial's scene only names what is made there, and its goal is the checkout's own verdict.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from msgspec import Meta

from robospa.harness.clock.policy_clock import PAUSED
from robospa.harness.settings import EvaluationSettings, Selection, SettingsError
from robospa.harness.trial import TrialSetup
from robospa.harness.worlds import Parts, WorldKind
from robospa.protocol.options import option, plain_options, read_options, url_options
from robospa.tasks.catalog import task as find_task
from robospa.tasks.events import Event, ObjectRole
from robospa.tasks.scene import Scene
from robospa.tasks.snapshot import Snapshot
from robospa.trial import TrialKey

PREFIX = "checkout:"
PARTS = "robospa.harness.official.checkout:checkout_parts"
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
        folder, options = parse_checkout(settings.simulation.world)
        selection, simulation = settings.selection, settings.simulation
        timed = settings.timing.action_rate is not None or settings.timing.clock != PAUSED
        filmed = settings.recording.video != "none"
        for setting, given, why in (
            ("instructions", selection.instructions, "has its own sentences"),
            ("video", filmed, "does not play a trial again, which is how films are made"),
            ("control", simulation.control != "rest_to_rest", "executes actions in its own way"),
            ("action_rate and clock", timed, "executes actions in its own way"),
            ("parts", simulation.parts, "has goals of its own"),
            ("profile", selection.profile, "has its own scenes and sentences"),
        ):
            if given:
                raise SettingsError(f"a checkout {why}: leave {setting} out")
        if selection.seeds is None:
            raise SettingsError(
                "a checkout's valid seeds are not ours: find some with `robospa official checkout "
                "DIR --find FILE` and name the file with seeds"
            )
        if not options.config and not {*selection.mode.split(",")} <= {*CONFIGS}:
            raise SettingsError(
                f"a checkout has the scene modes {' and '.join(CONFIGS)}, or a file of its own "
                "with checkout:DIR?config=NAME"
            )
        return replace(selection, instructions=folder)

    def arguments(self, settings: EvaluationSettings) -> dict[str, object]:
        folder, options = parse_checkout(settings.simulation.world)
        return {"folder": str(folder), **plain_options(options)}

    def parts(self, settings: EvaluationSettings, keys: Sequence[TrialKey]) -> Parts:
        return PARTS, {"episodes": episodes_of(keys)}


CHECKOUT = _CheckoutKind("checkout", "robospa.harness.official.checkout_world:CheckoutWorld")


@dataclass(frozen=True, slots=True)
class CheckoutSnapshot(Snapshot):
    """What is known of an instant: the robot, whether the goal is met, and flags of subtasks."""

    success: bool = False
    flags: tuple[bool, ...] = ()


class CheckoutTracker:
    """The checkout's own flags and success as events, of `total` subtasks."""

    needs_contacts = False

    def __init__(self, total: int) -> None:
        self.total = total
        self._flags: tuple[bool, ...] = ()
        self._success = False

    @property
    def roles(self) -> Mapping[str, ObjectRole]:
        """None: the objects are not known here."""
        return {}

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        """Flags that are up before the first action; success counts after one only (official)."""
        return self._changes(snapshot, _verdict(snapshot).flags)

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        seen = _verdict(snapshot)
        events = self._changes(snapshot, seen.flags)
        if seen.success and not self._success:
            self._success = True
            events += (Event(snapshot.time, "success"),)
        return events

    def diagnostics(self) -> Mapping[str, object]:
        return {"flags": list(self._flags)}

    def _changes(self, snapshot: Snapshot, flags: tuple[bool, ...]) -> tuple[Event, ...]:
        flags = flags[: self.total]
        before = self._flags + (False,) * (len(flags) - len(self._flags))
        self._flags = flags
        return tuple(
            Event(snapshot.time, "subtask_done" if now else "subtask_undone", index=index)
            for index, (was, now) in enumerate(zip(before, flags, strict=False))
            if was != now
        )


def _verdict(snapshot: Snapshot) -> CheckoutSnapshot:
    if not isinstance(snapshot, CheckoutSnapshot):
        raise TypeError("this goal is the verdict of a checkout: it needs its world")
    return snapshot


def checkout_parts(key: TrialKey, episodes: Episodes) -> TrialSetup:
    """What is known here of the trial `key`; its sentence is told by the world."""
    task = find_task(key.task)
    try:
        episode = list(episodes[key.variant]).index(key.seed)
    except (KeyError, ValueError):
        raise ValueError(f"{key.slug} is none of the run's trials") from None
    scene = Scene(
        key.task, key.level, key.seed, key.embodiment, key.mode, (), {"episode": episode},
        suite=SUITE,
    )  # fmt: skip
    return TrialSetup(scene, task, CheckoutTracker(task.levels[key.level].subtasks), "")
