"""Recordings played again: how often they meet their goal is how near our world is to theirs.

What was commanded at each frame is an action of the next, by the rules of an evaluation; step
limits do not count, because recordings have more frames than trials have actions.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from robospa.harness.convention_check.episodes import Episode, EpisodeError, read_episode
from robospa.harness.official.checkout_parts import checkout_parts
from robospa.harness.official.rebuild import NotStored, rebuilt
from robospa.harness.official.recordings import Recording
from robospa.harness.official.sentences import UNSEEN
from robospa.harness.replay import replay
from robospa.harness.trial import TrialParts
from robospa.harness.world import ActionError, SceneUnstable, World
from robospa.trial import TrialKey

Rebuild = Callable[[Recording, Episode], tuple[TrialKey, TrialParts]]
"""The trial of a recording with its scene; raises NotStored."""


@dataclass(frozen=True)
class RecordingReplay:
    """What came of a recording: `success` None where it could not be played, with the `reason`."""

    recording: Recording
    frames: int
    success: bool | None
    reason: str = ""
    done: int = 0
    total: int = 0


def replay_recording(
    recording: Recording, world: World, episode: Episode | None = None, rebuild: Rebuild = rebuilt
) -> RecordingReplay:
    """Play one recording again in `world`; raises what `world` raises but for its scenes."""
    try:
        found = read_episode(recording.path) if episode is None else episode
        key, parts = rebuild(recording, found)
    except (EpisodeError, NotStored) as error:
        return RecordingReplay(recording, 0, None, str(error))
    actions = np.concatenate([found.actions, found.actions[-1:]])
    limit = parts.task.levels[key.level].steps
    try:
        record = replay(
            world, key, actions, "joint", parts=lambda _: parts, step_scale=len(actions) / limit
        )
    except (SceneUnstable, ActionError) as error:
        return RecordingReplay(recording, len(found), None, str(error))
    reason = "" if record.success else record.message or record.end
    return RecordingReplay(recording, len(found), record.success, reason, record.done, record.total)


def in_checkout(recording: Recording, episode: Episode) -> tuple[TrialKey, TrialParts]:
    """The trial of `recording` in an official checkout, which makes its scene from its seed."""
    if recording.variant is None or recording.seed is None:
        raise NotStored("its folder names no task and level, or seed.txt has no seed for it")
    key = TrialKey(*recording.variant, recording.seed, split=UNSEEN)
    numbers = [-1] * recording.number + [recording.seed]
    return key, checkout_parts(key, {key.variant: numbers})


def chosen(recordings: Iterable[Recording], most: int) -> list[Recording]:
    """At most the first `most` of each folder."""
    counts: Counter[Path] = Counter()
    found = []
    for recording in recordings:
        counts[recording.path.parent] += 1
        if counts[recording.path.parent] <= most:
            found.append(recording)
    return found


def summary(replays: Sequence[RecordingReplay]) -> list[str]:
    """The counts in words: a line for each variant, and why some could not be played."""
    lines = []
    for name, some in _by_variant(replays).items():
        played = [replay for replay in some if replay.success is not None]
        met = sum(bool(replay.success) for replay in played)
        line = f"{name}: {len(some)} recordings"
        if played:
            line += (
                f", {met} of {len(played)} meet their goal again ({100 * met / len(played):.0f} %)"
            )
        lines.append(line)
        reasons = Counter(replay.reason for replay in some if replay.success is None)
        lines += [f"  {count} not played: {reason}" for reason, count in reasons.most_common()]
    return lines


def _by_variant(replays: Iterable[RecordingReplay]) -> dict[str, list[RecordingReplay]]:
    found: dict[str, list[RecordingReplay]] = {}
    for one in replays:
        variant = one.recording.variant
        folders = one.recording.path.parts[-4:-2]
        name = f"{variant[0]} level {variant[1]}" if variant else "/".join(folders)
        found.setdefault(name, []).append(one)
    return found
