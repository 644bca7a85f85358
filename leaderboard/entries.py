"""Who stands on the leaderboard: submissions with their badges, and the four published models.

An entry's values come from the counts of its single variants; all averages are computed here, and
a submission whose own averages differ from them is refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from robospa.categories import CATEGORIES, DIMENSIONS, SPATIAL
from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.scores import compare_scores
from robospa.leaderboard.submission import Submission, slug_of
from robospa.results.paper import rounding
from robospa.results.paper.columns import Column, published_column
from robospa.results.paper.published import LEVELS, load
from robospa.results.scoring.model_results import ModelResults
from robospa.results.scoring.score_json import to_json
from robospa.results.scoring.scores import VariantScore, combine
from robospa.results.scoring.setting import Setting
from robospa.results.statistics.intervals import Estimate

BADGES = {
    "published": "published, not verified",
    "valid": "valid",
    "outcomes": "outcomes replayed",
    "replayed": "replayed",
    "reproduced": "reproduced",
}
"""From the weakest to the strongest."""
UNKNOWN = "not stated"


@dataclass(frozen=True)
class Entry:
    """A line of the leaderboard. `about` is its card and `evidence` what its badges rest on, both
    as name and text; `parameters` is text."""

    slug: str
    name: str
    team: str
    parameters: str
    link: str
    badges: tuple[str, ...]
    embodiment: str
    mode: str
    split: str
    suite: str
    training: str
    scenes: str
    column: Column
    about: tuple[tuple[str, str], ...]
    evidence: tuple[tuple[str, str], ...]
    failures: Mapping[str, Mapping[str, int]]
    submission: Submission | None = None

    @property
    def badge(self) -> str:
        """The strongest one."""
        return max(self.badges, key=list(BADGES).index)


def published_entries() -> list[Entry]:
    """The models of the paper, from its per-task tables."""
    data = load()
    made = []
    for model, budget in data.models.items():
        column = published_column(model)
        parameters = budget.parameters
        about = (
            ("parameters", parameters),
            ("training", f"one checkpoint a base task, {budget.gpu_hours:g} GPU hours each"),
            ("trials", f"{data.trials} a variant, seeds not published"),
        )
        text = "Numbers as printed in the paper; there are no records that could be verified."
        made.append(
            Entry(
                slug=slug_of(model),
                name=column.title,
                team="RoboSPA paper",
                parameters=parameters,
                link="",
                badges=("published",),
                embodiment=data.embodiment,
                mode=data.mode,
                split="",
                suite="",
                training="single",
                scenes=UNKNOWN,
                column=column,
                about=about,
                evidence=((BADGES["published"], text),),
                failures={},
            )
        )
    return made


def entry_of(submission: Submission) -> Entry:
    """The entry of a submission; BundleError if its scores do not hold together."""
    card, settings = submission.card, submission.run["settings"]
    column = _column(submission)
    training, actions = card["training"], card["actions"]
    demonstrations = ", ".join(map(str, training["demonstrations"]))
    about = (
        ("team", card["team"]),
        ("licence of the weights", card["licence"]),
        ("parameters", short_count(card["parameters"])),
        ("training", "one checkpoint a base task" if training["tasks"] == "single"
         else "one checkpoint for all tasks"),
        ("training scenes", training["scenes"]),
        ("demonstrations", f"{demonstrations} (levels 1 to 5, per base task)"),
        ("actions", f"{actions['space']}, chunks of {actions['chunk']}, {actions['rate']:g} Hz"),
        ("embodiment", column.embodiment),
        ("scene mode", _first(settings["mode"])),
        ("instructions", _first(settings["split"])),
        ("suite", str(submission.run.get("suite", ""))),
        ("bundle", str(submission.manifest["bundle"])),
    )  # fmt: skip
    return Entry(
        slug=submission.folder.name,
        name=card["name"],
        team=card["team"],
        parameters=short_count(card["parameters"]),
        link=card["link"],
        badges=badges_of(submission.evidence),
        embodiment=_first(settings["embodiment"]),
        mode=_first(settings["mode"]),
        split=_first(settings["split"]),
        suite=str(submission.run.get("suite", "")),
        training=training["tasks"],
        scenes=training["scenes"],
        column=column,
        about=about,
        evidence=tuple(evidence_lines(submission.evidence)),
        failures=submission.failures,
        submission=submission,
    )


def _first(value: Any) -> str:
    return str(value[0] if isinstance(value, list) and value else value)


def short_count(count: int) -> str:
    """`3300000000` as `3.3B`."""
    for size, sign in ((10**9, "B"), (10**6, "M"), (10**3, "k")):
        if count >= size:
            return f"{count / size:.3g}{sign}"
    return str(count)


def _column(submission: Submission) -> Column:
    """The submission's scores as a column, computed from its variants."""
    run, where = submission.run, f"the submission {submission.folder.name}"
    settings, categories = run["settings"], run["categories"]
    counts = load().tasks
    cells: dict[tuple[str, int], VariantScore] = {}
    try:
        for task, levels in submission.scores["variants"].items():
            for name, part in levels.items():
                level, category = int(name.removeprefix("L")), str(categories[task])
                values = {
                    metric: None if part[metric] is None else _estimate(part[metric])
                    for metric in ("sr", "onta", "ps")
                    if metric in part
                }
                known = counts.get(task)
                n = known.counts[level - 1] if known and category in SPATIAL else 0
                listed = int(part["trials"]) + int(part["missing"])
                done = int(part["successes"])
                cells[task, level] = VariantScore(
                    task, level, category, listed, int(part["trials"]), done, values, n
                )
        scores = combine(cells)
        setting = Setting(
            (_first(settings["embodiment"]),),
            (_first(settings["mode"]),),
            (_first(settings["split"]),),
            (str(run.get("suite", "")),),
        )
        column = Column(ModelResults(str(submission.card["name"]), scores, setting))
        assert column.values, "computed here, where an error is the bundle's"
    except (KeyError, TypeError, ValueError, AttributeError, AssertionError, IndexError) as error:
        raise BundleError(f"{where}: scores.json is not a report's: {error!r}") from None
    if found := compare_scores(to_json(scores), submission.scores):
        raise BundleError(f"{where}: scores.json does not hold together: {found}")
    return column


def _estimate(triple: Any) -> Estimate:
    value, low, high = map(float, triple)
    return Estimate(value, low, high)


def badges_of(evidence: Mapping[str, Any]) -> tuple[str, ...]:
    """The badges that the evidence carries."""
    made = ["valid"]
    again = evidence.get("replayed")
    if again:
        made.append("replayed" if again["identical"] == again["sampled"] else "outcomes")
    if evidence.get("reproduced"):
        made.append("reproduced")
    return tuple(made)


def evidence_lines(evidence: Mapping[str, Any]) -> list[tuple[str, str]]:
    """What the badges rest on, as badge and sentence."""
    valid, again = evidence["valid"], evidence.get("replayed")
    fresh = evidence.get("reproduced")
    made = [
        (
            "valid",
            f"{valid['trials']} trials of {valid['variants']} variants: structure, hashes, chain, "
            "seeds, records, actions and scores hold.",
        )
    ]
    made += [("lint", str(text)) for text in valid.get("warnings", [])]
    if again:
        chance = again.get("catches_2_percent")
        said = (
            f"{again['sampled']} of {again['trials']} trials were played again: "
            f"{again['identical']} identical to the bit, {again['agrees']} with the same outcome "
            "and another final state, none with another outcome."
        )
        if isinstance(chance, (int, float)):
            said += f" 2 % of forged outcomes would have shown with {100 * chance:.1f} %."
        made.append((BADGES[badges_of({"replayed": again})[1]], said))
        made.append(("challenge", str(again.get("challenge", ""))))
    if fresh:
        made.append(
            (
                "reproduced",
                f"Hidden seeds agree with the claim: p = {fresh['overall']['p']:.2g} overall, "
                f"tested at {fresh['alpha']:g}.",
            )
        )
        made.append(("commitment", str(fresh.get("commitment", ""))))
    return made


def page_values(entry: Entry) -> dict[str, dict[str, list[list[float] | int]]]:
    """Percent by metric, row and level (0: all levels) as [value, low, high]; 0 is no value."""
    made: dict[str, dict[str, list[list[float] | int]]] = {}
    rows = [*load().tasks, *CATEGORIES, *DIMENSIONS, rounding.OVERALL]
    for metric in ("sr", "onta", "ps"):
        made[metric] = {}
        for row in rows:
            found = [_shown(entry.column, metric, row, level) for level in (0, *LEVELS)]
            if any(found):
                made[metric][row] = found
    return made


def _shown(column: Column, metric: str, row: str, level: int) -> list[float] | int:
    if level:
        estimate = column.estimate(metric, row, level)
    else:
        full = all(column.estimate(metric, row, n) is not None for n in LEVELS)
        estimate = _over_levels(column, metric, row) if full else None
    if estimate is None:
        return 0
    return [round(100 * x, 2) for x in (estimate.value, estimate.low, estimate.high)]


def _over_levels(column: Column, metric: str, row: str) -> Estimate | None:
    scores = column.scores
    if row == rounding.OVERALL:
        return scores.overall[0].values.get(metric)
    part = scores.tasks.get(row) or scores.categories.get((row, 0))
    part = part or scores.dimensions.get((row, 0))
    return None if part is None else part.values.get(metric)


def all_entries(submissions: Sequence[Submission]) -> list[Entry]:
    """Submissions and published models; BundleError if two have one name."""
    made = [*map(entry_of, submissions), *published_entries()]
    slugs = [entry.slug for entry in made]
    if twice := sorted({s for s in slugs if slugs.count(s) > 1}):
        raise BundleError(f"two entries are called {twice[0]}; rename the submission's folder")
    return made
