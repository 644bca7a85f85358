"""The results of one model in its setting; different settings are never averaged or compared."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from robospa.results.records.manifest import JOINTS, OFFICIAL, REST_TO_REST, TRACKS, RunManifest
from robospa.results.records.runs import Run, finished
from robospa.results.records.trial_record import TrialRecord
from robospa.results.scoring.scores import Scores, Variant, score
from robospa.results.statistics.intervals import METHODS
from robospa.results.statistics.samples import Sample
from robospa.trial import BASIC, METRIC_CATEGORIES, METRIC_NAMES, RATES, TrialKey

TABLE = ("embodiment", "mode", "suite", "split", "track")
COMPARISON = (*TABLE, "step_scale")
"""Parts of a setting that runs have to share in one table, and in one comparison."""
BESIDE_PAPER = ("embodiment", "mode", "track")
"""Parts that a run has to share with published models, which are a suite of their own."""
RAN_WITH = {
    "embodiment": "the embodiments {} and {}",
    "mode": "the scene modes {} and {}",
    "split": "the instruction splits {} and {}",
    "suite": "the suites {} and {}",
    "step_scale": "{:g} and {:g} times the official step limits",
    "clock": "the clocks {} and {}",
    "track": "the tracks {} and {}",
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
    track: tuple[str, ...] = (JOINTS,)


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
        manifest.tracks,
    )


def check_same(settings: Iterable[tuple[str, Setting]], parts: Sequence[str]) -> None:
    """IncomparableError if one of the named settings mixes values, or two differ in `parts`.

    What one of several does not state equals nothing.
    """
    known = list(settings)
    for name, setting in known:
        for part in ("embodiment", "mode", "split", "track"):
            if len(values := getattr(setting, part)) > 1:
                what = RAN_WITH[part].format(", ".join(values[:-1]), values[-1])
                raise IncomparableError(
                    f"{name} mixes {what}, whose mean means nothing: evaluate one at a time"
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


@dataclass(frozen=True)
class ModelResults:
    """A run or a published model.

    `to_run` more trials are to be run, of a run in progress: they are no part of the scores.
    `trials` has the trials that have a result, by variant and seed; of a `published` model (its
    name there) no trials are known.
    """

    name: str
    scores: Scores
    setting: Setting
    manifest: RunManifest = field(default_factory=RunManifest)
    trials: Mapping[Variant, Mapping[int, TrialRecord]] = field(default_factory=dict)
    published: str = ""
    to_run: int = 0

    @property
    def records(self) -> list[TrialRecord]:
        """All results of a run."""
        return [record for trials in self.trials.values() for record in trials.values()]

    @property
    def categories(self) -> dict[str, str]:
        """The category of every task that a trial is listed of."""
        return self.scores.category_of

    @cached_property
    def listed(self) -> dict[Variant, int]:
        """Number of listed trials by variant."""
        return {variant: cell.listed for variant, cell in self.scores.cells.items()}

    def samples(self, metric: str) -> dict[Variant, Sample]:
        """Outcomes of every variant that has results and `metric`.

        Raises IncomparableError if they are not known, or not of one kind.
        """
        found: dict[Variant, Sample] = {}
        for (task, level), cell in self.scores.cells.items():
            if not cell.trials or cell.category not in categories_of(metric):
                continue
            if metric not in cell.samples and self.published:
                raise IncomparableError(
                    f"of {self.name} only success rates and mean progress are published, without "
                    "the trials: compare sr or onta"
                )
            if metric not in cell.samples:
                raise IncomparableError(
                    f"{self.name}, {task} L{level}: trials differ in their number of candidates, "
                    f"so there is no {METRIC_NAMES[metric]}: compare {RATES[metric]}"
                )
            found[task, level] = cell.samples[metric]
        return found


def categories_of(metric: str) -> tuple[str, ...]:
    """The categories that have `metric`; basic grounding has success rates too."""
    return METRIC_CATEGORIES[metric] + (BASIC if metric in ("sr", "sr1") else ())


def restricted(results: ModelResults, variants: Collection[Variant]) -> ModelResults:
    """`results` as if only `variants` had been run."""
    scores, trials = results.scores, results.trials
    cells = {variant: cell for variant, cell in scores.cells.items() if variant in variants}
    return replace(
        results,
        scores=Scores(cells, scores.ci),
        trials={variant: trials[variant] for variant in trials if variant in variants},
    )


FREE = ("embodiment", "mode", "split", "clock")
"""Parts of a setting in which runs of one policy may differ and stand beside each other: scenes of
one seed have the same objects, whatever the robot, the scene mode, the sentence and the clock."""


def one_policy(models: Sequence[ModelResults]) -> bool:
    """Whether all are runs of one policy."""
    names = {model.manifest.policy.name for model in models}
    return len(names) == 1 and "" not in names and not any(model.published for model in models)


def by_track(models: Sequence[ModelResults]) -> dict[str, list[ModelResults]]:
    """`models` by track, in their order; each track stands for itself."""
    made: dict[str, list[ModelResults]] = {track: [] for track in (JOINTS, *TRACKS.values())}
    for model in models:
        made.setdefault(", ".join(model.setting.track), []).append(model)
    return {track: found for track, found in made.items() if found}


def suite_of(results: ModelResults) -> str:
    """The suite; "" where it is not stated."""
    return results.manifest.suite or next(iter(results.setting.suite), "")


def in_official_world(results: ModelResults) -> bool:
    """Whether these are of a run that is held against the paper, and against no suite of ours."""
    return suite_of(results).startswith(OFFICIAL)


def check_alike(models: Sequence[ModelResults], parts: Sequence[str]) -> None:
    """IncomparableError unless the runs among `models` share `parts` of their settings, and with
    published models, which are of another suite, those of `BESIDE_PAPER`.

    Runs of one policy may differ in FREE; runs of official worlds beside published models in their
    suite, because each is of another suite than those anyway.
    """
    runs = [m for m in models if not m.published]
    shared = [part for part in parts if not (one_policy(runs) and part in FREE)]
    if len(runs) < len(models) and all(map(in_official_world, runs)):
        shared = [part for part in shared if part != "suite"]
    check_same([(m.name, m.setting) for m in runs], shared)
    if len(runs) < len(models):
        for run in runs:
            if run.manifest.control != REST_TO_REST:
                raise IncomparableError(
                    f"{run.name} is of the suite {run.manifest.suite}, whose actions have a fixed "
                    "duration, and published numbers are of actions from rest to rest: compare it "
                    "with another run at its rate"
                )
        check_same([(m.name, m.setting) for m in models], BESIDE_PAPER)


def results_of_run(run: Run, name: str = "", ci: str = METHODS[0]) -> ModelResults:
    """The results of `run`, called `name` or as its folder, with intervals by the method `ci`."""
    found = results_of_records(name or run.folder.name, run.counted, run.records, run.manifest, ci)
    setting = setting_of(run.keys, run.manifest)
    return replace(found, setting=setting, to_run=len(run.waiting))


def results_of_records(
    name: str,
    keys: Sequence[TrialKey],
    records: Mapping[TrialKey, TrialRecord],
    manifest: RunManifest,
    ci: str = METHODS[0],
) -> ModelResults:
    """The results of the trials `keys`, of which `records` has some."""
    trials: dict[Variant, dict[int, TrialRecord]] = {}
    for key in keys:
        record = records.get(key)
        if record is not None and finished(record):
            trials.setdefault(key.variant, {})[key.seed] = record
    scores = score(keys, records, manifest.categories, ci)
    return ModelResults(name, scores, setting_of(keys, manifest), manifest, trials)
