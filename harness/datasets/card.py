"""The card of a data set: README.md, as dataset hubs show it, with two pictures.

What it says is counted while the data set is packed, in memory that grows with the number of
variants, not of episodes.
"""

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from robospa.harness.datasets.episode import DatasetEpisode
from robospa.harness.datasets.features import EpisodeLayout
from robospa.harness.datasets.manifest import EPISODES, EVENTS, MANIFEST, SUMS, DatasetManifest
from robospa.harness.datasets.pictures import FPS, all_pictures
from robospa.harness.demonstrations.noise import LABELS
from robospa.harness.pictures.gallery import GalleryRow, save, sheet
from robospa.results.figures.series import COLOURS, new_figure, plain, styled
from robospa.text import markdown_table
from robospa.trial import CATEGORY_NAMES

CARD, SHEET, LENGTHS = "README.md", "episodes.jpg", "lengths.png"
PICTURED, COLUMNS = 24, 6
"""Episodes on the contact sheet, evenly spread over the data set, and those of a row."""
LICENSE = "mit"
SIZES = ((1_000, "n<1K"), (10_000, "1K<n<10K"), (100_000, "10K<n<100K"), (10**6, "100K<n<1M"))


@dataclass
class CardFacts:
    """What a card tells: given before, and counted by `add`."""

    format: str
    title: str
    layout: EpisodeLayout
    manifest: DatasetManifest
    expected: int
    """Number of episodes to come."""

    def __post_init__(self) -> None:
        self.episodes = self.frames = self.successes = 0
        self.about: dict[str, str] = {}
        self.variants: Counter[tuple[str, int]] = Counter()
        self.modes: Counter[str] = Counter()
        self.kinds: Counter[str] = Counter()
        self.labels = np.zeros(len(LABELS), np.int64)
        self.lengths: Counter[tuple[int, int]] = Counter()
        """Episodes by level and number of frames."""
        self.pictures: list[tuple[str, NDArray[np.uint8]]] = []
        """(height, width, 3) RGB each, with what stands below it."""
        count = min(PICTURED, self.expected)
        self._pictured = set(np.linspace(0, self.expected - 1, count).round().astype(int).tolist())

    def add(self, episode: DatasetEpisode) -> None:
        """Count the next episode; keep a picture of some."""
        key = episode.key
        if self.episodes in self._pictured and episode.pictures:
            seen = episode.pictures.get("head") or next(iter(episode.pictures.values()))
            middle = next(islice(all_pictures(seen), len(episode) // 2, None))
            self.pictures.append((f"L{key.level} {episode.instructions[0]}", middle))
        self.about = self.about or dict(episode.about)
        self.episodes, self.frames = self.episodes + 1, self.frames + len(episode)
        self.successes += episode.success
        self.variants[key.variant] += 1
        self.modes[key.mode] += 1
        self.kinds[episode.kind] += 1
        self.labels += np.bincount(episode.label, minlength=len(LABELS))
        self.lengths[key.level, len(episode)] += 1

    @property
    def cameras(self) -> str:
        """The cameras in words."""
        seen = self.layout.cameras.items()
        return ", ".join(f"{name} ({c.width}x{c.height}, {c.codec})" for name, c in seen)


def write_card(folder: Path, facts: CardFacts) -> None:
    """Write README.md, which says otherwise of imported recordings, and its pictures."""
    if facts.pictures:
        starts = range(0, len(facts.pictures), COLUMNS)
        rows = [GalleryRow("", "", tuple(facts.pictures[i : i + COLUMNS])) for i in starts]
        save(sheet(rows, f"From the middle of {len(facts.pictures)} episodes"), folder / SHEET)
    draw_lengths(folder / LENGTHS, facts.lengths)
    text = imported_card if "left_out" in facts.manifest.settings else card_text
    (folder / CARD).write_text(text(facts), encoding="utf-8")


def card_text(facts: CardFacts) -> str:
    """The card, in Markdown with a YAML head."""
    parts = [head(facts, LICENSE), _opening(facts)]
    if facts.pictures:
        parts.append(f"![Pictures from the middle of {len(facts.pictures)} episodes]({SHEET})")
    parts.append(
        "## How it was made\n\n"
        f"```\n{facts.manifest.command}\n```\n\n"
        "The same command with the same version gives the same bytes. "
        "`robospa collect --verify DIR` checks every file's hash, all counts, and replays a sample."
    )
    parts += [_counts(facts), _failures(facts), files_part()]
    parts.append("## License\n\nMIT, like `robospa`, whose scenes and expert it comes from.")
    return "\n\n".join(parts) + "\n"


def head(facts: CardFacts, license: str) -> str:
    """The YAML head that dataset hubs read."""
    size = next((name for most, name in SIZES if facts.frames < most), "n>1M")
    tags = ["robospa", facts.layout.robot, *(["LeRobot"] if "lerobot" in facts.format else [])]
    lines = ["---", f"license: {license}", "task_categories:", "- robotics", "tags:"]
    lines += [f"- {tag}" for tag in tags]
    lines += ["size_categories:", f"- {size}"]
    if "lerobot" in facts.format:
        lines += ["configs:", "- config_name: default", "  data_files: data/*/*.parquet"]
    return "\n".join([*lines, "---"])


def _opening(facts: CardFacts) -> str:
    made = facts.about
    return (
        f"# {facts.episodes:,} demonstrations of RoboSPA tasks by {facts.layout.robot}\n\n"
        f"{facts.episodes:,} episodes, {facts.frames:,} frames, "
        f"{len(facts.variants)} variants (base task and level), as {facts.title}. "
        f"Suite `{made.get('suite', '?')}`, made with robospa {made.get('version', '?')}. "
        f"{facts.layout.space.width} numbers an action; cameras: {facts.cameras or 'none'}. "
        f"Every episode was replayed from what is written here: {facts.successes:,} of "
        f"{facts.episodes:,} replays meet their task's goal. Instructions are training sentences, "
        "seeds are of a range that no evaluation uses.\n\n"
        f"Frames are named {FPS} a second; `sim_time` has their exact times. The action of a frame "
        "is the command of the next one, except where noise was added: there it is what the expert "
        "meant to do."
    )


def _counts(facts: CardFacts) -> str:
    from robospa.tasks.catalog import task

    levels = sorted({level for _, level in facts.variants})
    by_category: Counter[tuple[str, int]] = Counter()
    for (name, level), count in facts.variants.items():
        by_category[task(name).category, level] += count
    rows = []
    present = {category for category, _ in by_category}
    for category in [*CATEGORY_NAMES, *sorted(present - set(CATEGORY_NAMES))]:
        counts = [by_category[category, level] for level in levels]
        if category in present:
            title = CATEGORY_NAMES.get(category, category)
            rows.append([f"{title} ({category})", *counts, sum(counts)])
    totals = [sum(by_category[c, level] for c in present) for level in levels]
    rows.append(["all", *totals, facts.episodes])
    lengths = sorted(n for (_, n), count in facts.lengths.items() for _ in range(count))
    least, half, most = (lengths[max(0, math.ceil(q * len(lengths)) - 1)] for q in (0, 0.5, 1))
    return "\n\n".join(
        (
            "## Episodes",
            table(["category", *(f"L{level}" for level in levels), "all"], rows),
            table(["scene mode", "episodes"], sorted(facts.modes.items())),
            table(["kind", "episodes"], sorted(facts.kinds.items())),
            table(["whose command", "frames"], list(zip(LABELS, facts.labels, strict=True))),
            f"Frames of an episode: {least} to {most}, half of them up to {half}.",
            f"![Frames of an episode by level]({LENGTHS})",
        )
    )


def _failures(facts: CardFacts) -> str:
    failed = Counter(f"{f.key.task} L{f.key.level}" for f in facts.manifest.failures)
    tried = facts.episodes + failed.total()
    if not failed:
        return f"## Seeds\n\n{tried:,} seeds were tried, and every one gave an episode."
    text = (
        f"## Seeds\n\n{tried:,} seeds were tried: {facts.episodes:,} gave an episode; "
        f"{failed.total():,} did not, and others took their place."
    )
    worst = table(["variant", "seeds without an episode"], failed.most_common(10))
    return f"{text} Most often:\n\n{worst}"


def files_part() -> str:
    """What the files are that all formats have."""
    return "## Files beside the format's own\n\n" + table(
        ["file", "what"],
        [
            [f"`{MANIFEST}`", "settings, counts, seeds without an episode"],
            [f"`{EPISODES}`", "a line an episode: trial, kind, sentences, digests"],
            [f"`{EVENTS}`", "what happened when: grasped, subtask done, dropped, success"],
            [f"`{SUMS}`", "hashes, for `sha256sum --check SHA256SUMS`"],
        ],
    )


def table(heads: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Rows in Markdown."""
    cells = ([f"{x:,}" if isinstance(x, int | np.integer) else str(x) for x in r] for r in rows)
    return markdown_table(heads, cells)


MOST_BINS = 40


def draw_lengths(path: Path, lengths: Mapping[tuple[int, int], int]) -> None:
    """Write a histogram of episodes by (level, frames) as a PNG."""
    from matplotlib.ticker import MaxNLocator

    levels = sorted({level for level, _ in lengths})
    longest = max(frames for _, frames in lengths)
    edges = np.linspace(0, longest + 1, min(MOST_BINS, longest + 1) + 1)
    with styled():
        figure = new_figure(2.1)
        axis = figure.subplots()
        below = np.zeros(len(edges) - 1)
        for level in levels:
            own = {frames: n for (of, frames), n in lengths.items() if of == level}
            counts, _ = np.histogram(list(own), edges, weights=list(own.values()))
            colour = COLOURS[(level - 1) % len(COLOURS)]
            axis.bar(
                edges[:-1], counts, np.diff(edges), below, align="edge", color=colour,
                label=f"L{level}",
            )  # fmt: skip
            below += counts
        axis.set_xlabel("frames of an episode")
        axis.set_ylabel("episodes")
        axis.yaxis.set_major_locator(MaxNLocator(integer=True))
        axis.legend(frameon=False)
        plain(axis)
        figure.savefig(path, dpi=200, metadata={"Software": None})


MEANS = {
    "measured_state": "measured joints (commanded ones are there)",
    "sim_time": f"times: `timestamp` counts frames, {FPS} a second, whatever their real times were",
    "subtask_index": "what was being done at each frame",
    "label": "whose command an action is",
    "embodiment": "the robot: columns are called by arm and number",
    "success": "whether the goal was met",
    "failure": "why it was not",
    "scene_digest": "the scene",
    "replay_digest": "how it ended",
    "stride": "how far apart frames are",
}
"""What each of the absent features is, in words."""


def imported_card(facts: CardFacts) -> str:
    """The card, in Markdown with a YAML head."""
    settings = facts.manifest.settings
    left_out = Counter(row["why"] for row in settings["left_out"])
    rows = sorted((f"{task} L{level}", n) for (task, level), n in facts.variants.items())
    parts = [
        head(facts, "unknown"),
        f"# {facts.episodes:,} official recordings of RoboSPA tasks\n\n"
        f"**Official recordings**, converted and not made by robospa {facts.about.get('version')}: "
        f"{facts.episodes:,} episodes, {facts.frames:,} frames, {len(facts.variants)} variants, as "
        f"{facts.title}. {facts.layout.space.width} numbers an action; cameras: {facts.cameras}. "
        "The action of a frame is the command of the next one. Sentences are those of `seen`; "
        "those of `unseen` are for evaluation and not here.",
        "## What they do not have\n\n"
        + "\n".join(f"* `{name}`: {MEANS.get(name, name)}" for name in settings["absent"])
        + "\n\nNothing was put in their place. Nothing was replayed: the scenes are known to the "
        "official code alone. `robospa collect --verify DIR` checks every file's hash and all "
        "counts; `robospa collect --import DATA` plays again what can be played.",
        *([f"![Pictures from the middle of episodes]({SHEET})"] if facts.pictures else []),
        f"## How it was made\n\n```\n{facts.manifest.command}\n```\n\nThe hash of each file that "
        "was read stands with its episode in `meta/robospa_episodes.jsonl`.",
        "## Episodes\n\n" + table(["variant", "episodes"], rows),
        table(["configuration", "episodes"], sorted(facts.modes.items())),
        f"![Frames of an episode by level]({LENGTHS})",
        f"{left_out.total():,} of {settings['imported']:,} recordings are left out.",
        *([table(["why", "recordings"], left_out.most_common())] if left_out else []),
        files_part(),
        "## License\n\nThat of the data that were read: see where you got them.",
    ]
    return "\n\n".join(parts) + "\n"
