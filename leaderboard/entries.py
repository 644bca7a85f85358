"""Who stands on the leaderboard: submissions with their badges, and the four published models.

An entry's values come from the outcomes of its trials; a submission whose own scores differ from
them is refused. Two entries of one `Group` are ranked against each other in the cells that are in
the `ranks` of both.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import astuple, dataclass, replace

from robospa.leaderboard.agreement import CELL_LIE, LEAST_POWER, LIE
from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.card import recipe_of
from robospa.leaderboard.evidence import APART, BadgeEvidence, what_it_catches
from robospa.leaderboard.submission import Submission, slug_of
from robospa.leaderboard.verify import compare_scores, results_of
from robospa.results.paper import rounding
from robospa.results.paper.columns import Column, published_column
from robospa.results.paper.origin import DIFFERENCES
from robospa.results.paper.published import LEVELS, load
from robospa.results.records.manifest import JOINTS
from robospa.results.scoring.scores import to_json
from robospa.trial import CATEGORIES, DIMENSIONS, METRICS


@dataclass(frozen=True, order=True)
class Group:
    """What has to be equal for two values to be of one benchmark; no part is empty."""

    suite: str
    embodiment: str
    mode: str
    split: str
    track: str = JOINTS

    def __str__(self) -> str:
        return ", ".join(part for part in astuple(self) if part != JOINTS)

    @property
    def of_paper(self) -> bool:
        """Whether these are the numbers that the paper prints."""
        return self.suite == load().suite

    @property
    def of_draft(self) -> bool:
        """Whether its suite still changes: two entries of one draft may be of different scenes."""
        return self.suite.endswith("-draft")

    @property
    def title(self) -> str:
        if self.of_paper:
            return f"Numbers printed in the paper: {self.embodiment}, {self.mode} scenes"
        track = "" if self.track == JOINTS else f"Track of {self.track}, "
        setting = f"{self.embodiment}, {self.mode} scenes, {self.split} instructions"
        return f"{track}{self.suite}: {setting}"

    @property
    def note(self) -> str:
        """Why nobody in it is ranked; empty where somebody can be."""
        if self.of_draft:
            return "A draft suite, whose scenes still change: no ranks."
        return f"Another suite, with {DIFFERENCES}: no ranks." if self.of_paper else ""


def group(entry: Entry) -> Group | None:
    """The group of `entry`; None if it does not state all parts, so that it is in nobody's."""
    return entry.setting if all(astuple(entry.setting)) else None


def ranks(entry: Entry) -> tuple[str, ...]:
    """The cells in which `entry` gets a rank in its group: it has trials of a frozen suite of this
    benchmark, and hidden scenes would have shown a lie there. All else is a claim."""
    found = group(entry)
    if found is None or found.of_draft or entry.column.published:
        return ()
    return entry.cells


def groups_of(entries: Iterable[Entry]) -> list[Group]:
    """The groups of `entries` in the order in which they are shown: the paper's last."""
    found = {one for entry in entries if (one := group(entry))}
    return sorted(found, key=lambda one: (one.of_paper, one))


BADGES = {
    "published": "published, not verified",
    "valid": "valid",
    "outcomes": "outcomes replayed",
    "replayed": "replayed",
    "reproduced": "reproduced",
}
"""From the weakest to the strongest."""
MEANINGS = {
    "published": "Numbers printed in the paper, which nobody can check without the models.",
    "valid": (
        "Structure, hashes, seeds, scenes, records, actions and scores of the bundle are "
        "consistent. This does not show that the trials took place: a consistent forgery passes."
    ),
    "outcomes": (
        "A sample of the trials, chosen by a value that nobody could know in advance, was replayed "
        "with the same outcomes, but not all final states are identical to the bit, as happens on "
        f"another kind of processor. Where records have final positions, half are within {APART:g} "
        "mm. This does not show that a model chose the actions: those of an expert who knows the "
        "scene, the best of many runs, and a model trained on the public seeds replay just as well."
    ),
    "replayed": (
        "The same, with all final states identical to the bit, as on one kind of processor. This "
        "does not show that a model chose the actions either."
    ),
    "reproduced": (
        "The server acted in hidden scenes, which nobody could know or train on, and agrees with "
        "the claim as a whole and in every cell; rates "
        f"{100 * LIE:g} points lower everywhere would have been detected with at least "
        f"{100 * LEAST_POWER:g} % power. Smaller gains, such as the best of many runs on the "
        "public seeds, may remain hidden, and nothing shows what runs behind the server. Cells are "
        f"ranked where {100 * CELL_LIE:g} points too many in that cell alone would have been "
        "detected."
    ),
}
"""What a badge proves, and what it does not."""
HOW_REPRODUCED = (
    "After the merge, a team may ask for reproduction in its pull request. A maintainer then "
    "publishes a commitment to hidden scenes, runs them on the team's server, and publishes the "
    "scenes and results. Only then is the model ranked."
)
"""Who reproduces an entry, when and how: the one story of page and documentation."""
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
    training: str
    scenes: str
    column: Column
    about: tuple[tuple[str, str], ...]
    evidence: tuple[tuple[str, str], ...]
    failures: Mapping[str, Mapping[str, int]]
    submission: Submission | None = None
    cells: tuple[str, ...] = ()
    """"ROW/LEVEL" where hidden scenes would have shown a lie."""

    @property
    def setting(self) -> Group:
        """What it was measured in; what is not stated is empty."""
        found = self.column.results.setting
        parts = (found.suite, found.embodiment, found.mode, found.split, found.track)
        return Group(*map(", ".join, parts))

    @property
    def badge(self) -> str:
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
            ("training", f"one checkpoint per base task, {budget.gpu_hours:g} GPU hours each"),
            ("trials", f"{data.trials} per variant, seeds not published"),
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
    card, run, evidence = submission.card, submission.run, submission.evidence
    results = results_of(card.name, submission.outcomes, run)
    if found := compare_scores(to_json(results.scores), submission.scores):
        where = f"the submission {submission.folder.name}: scores.json"
        raise BundleError(f"{where} does not hold together: {found}")
    column = Column(replace(results, trials={}))  # 28,000 records of every submission
    training, actions = card.training, card.actions
    demonstrations = ", ".join(map(str, training.demonstrations))
    about = (
        ("team", card.team),
        ("licence of the weights", card.licence),
        ("parameters", short_count(card.parameters)),
        *((f"weights, {task}", f"remade by bash {script}; sha256 {point.sha256}")
          for task, point in card.checkpoints.items()
          if (script := recipe_of(point.reference))),
        ("training", "one checkpoint per base task" if training.tasks == "single"
         else "one checkpoint for all tasks"),
        ("training scenes", training.scenes),
        ("demonstrations", f"{demonstrations} (levels 1 to 5, per base task)"),
        ("actions", f"{actions.space}, chunks of {actions.chunk}, {actions.rate:g} Hz"),
        ("embodiment", column.embodiment),
        ("scene mode", run.settings.mode[0]),
        ("instructions", run.settings.split[0]),
        ("suite", run.suite),
        ("track", column.results.setting.track[0]),
        ("bundle", submission.bundle),
    )  # fmt: skip
    return Entry(
        slug=submission.folder.name,
        name=card.name,
        team=card.team,
        parameters=short_count(card.parameters),
        link="" if recipe_of(card.link) else card.link,
        badges=evidence.badges,
        training=training.tasks,
        scenes=training.scenes,
        column=column,
        about=about,
        evidence=tuple(evidence_lines(evidence)),
        failures=submission.failures,
        submission=submission,
        cells=tuple(evidence.reproduced.ranks) if evidence.reproduced else (),
    )


def short_count(count: int) -> str:
    """`3300000000` as `3.3B`."""
    for size, sign in ((10**9, "B"), (10**6, "M"), (10**3, "k")):
        if count >= size:
            return f"{count / size:.3g}{sign}"
    return str(count)


def evidence_lines(evidence: BadgeEvidence) -> list[tuple[str, str]]:
    """What the badges rest on, as badge and sentence."""
    valid, again, fresh = evidence.valid, evidence.replayed, evidence.reproduced
    lines = [
        (
            "valid",
            f"{valid.trials} trials of {valid.variants} variants: structure, hashes, chain, "
            f"seeds, records, actions, scores and scenes hold. {valid.attempts}",
        )
    ]
    lines += [("lint", text) for text in valid.warnings]
    if again:
        text = f"{again.sentence} {what_it_catches(again.trials, again.sampled)}"
        lines += [(BADGES[evidence.badges[1]], text), ("challenge", again.challenge)]
    if fresh:
        text = " ".join(fresh.sentences())
        lines += [("reproduced", text), ("commitment", fresh.commitment)]
    return lines


def page_values(entry: Entry) -> dict[str, dict[str, list[list[float] | int]]]:
    """Percent by metric, row and level (0: all levels) as [value, low, high], with digits enough to
    be rounded as elsewhere; 0 is no value."""
    made: dict[str, dict[str, list[list[float] | int]]] = {metric: {} for metric in METRICS}
    for metric, values in made.items():
        for row in (*load().tasks, *CATEGORIES, *DIMENSIONS, rounding.OVERALL):
            found = [_shown(entry.column, metric, row, level) for level in (0, *LEVELS)]
            if any(found):
                values[row] = found
    return made


def _shown(column: Column, metric: str, row: str, level: int) -> list[float] | int:
    if level:
        estimate = column.estimate(metric, row, level)
    else:
        full = all(column.estimate(metric, row, n) is not None for n in LEVELS)
        part = column.scores.part(row, 0) if full else None
        estimate = part.values.get(metric) if part else None
    if estimate is None:
        return 0
    return [round(100 * x, 6) for x in (estimate.value, estimate.low, estimate.high)]


def all_entries(submissions: Sequence[Submission]) -> list[Entry]:
    """Submissions and published models; BundleError if two are of the same trials."""
    owner: dict[str, Submission] = {}
    for one in submissions:
        if (first := owner.setdefault(one.rows, one)) is not one:
            raise BundleError(
                f"the submissions {first.folder.name} and {one.folder.name} are of the same trials"
            )
    return [*map(entry_of, submissions), *published_entries()]
