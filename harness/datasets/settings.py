"""What a data set is made of: the settings of `robospa collect`, the variants that they name, the
versions that it depends on besides, the command that makes it, and the disk space that it takes.
"""

import shlex
import shutil
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Annotated

from msgspec import Meta

from robospa.harness.datasets.pictures import CODECS
from robospa.harness.running.code_hash import FOLDERS, code_hash
from robospa.harness.running.ray_executor import versions as packages
from robospa.harness.selection import (
    parse_embodiments,
    parse_levels,
    parse_modes,
    parse_tasks,
)
from robospa.harness.settings import SettingsError, check_values
from robospa.observation import CAMERAS, WIDTH, CameraSpec
from robospa.protocol.options import option
from robospa.tasks.catalog import task
from robospa.tasks.modes import for_training
from robospa.tasks.scene import SUITE
from robospa.tasks.seeds import ListKey
from robospa.text import size_text
from robospa.trial import REFERENCE, TrialKey

Share = Annotated[float, Meta(ge=0, le=1)]

AUTO = "auto"
NO_CAMERAS = "none"
STRIDE, KEYFRAMES = "stride", "keyframes"


@dataclass(frozen=True)
class Collection:
    """The episodes of a data set and how their pictures are kept."""

    tasks: str = option(
        "all",
        "task names, categories (GAC), spatial, procedural, basic, or all (without basic)",
    )
    levels: str = option("1-5", "such as 1,3-5")
    episodes: Annotated[int, Meta(ge=1, le=100_000)] = option(50, "episodes per variant")
    embodiment: str = option(REFERENCE, "robots: names, comma separated, or all")
    mode: str = option(
        "clean", "scene modes; of randomized scenes those with textures that are for training"
    )
    images: str = option(
        AUTO, "how pictures are kept; auto: h264, or what the format needs", (AUTO, *CODECS)
    )
    cameras: str = option(
        "head,left_wrist,right_wrist",
        f"some of {', '.join(CAMERAS)}, comma separated, or none: a data set without pictures",
    )
    frames: str = option(
        STRIDE,
        "stride: a frame every so many physics steps, as officially; keyframes: only where the "
        "expert's own actions begin and end, 7 to 40 an episode",
        (STRIDE, KEYFRAMES),
    )
    environment_state: bool = option(
        False,
        "keep what the objects are and where they lie as observation.environment_state, for "
        "policies that do not see (and are marked as privileged)",
    )
    noise: Share = option(0.0, "share of the episodes with noise that the expert makes good")
    mistakes: Share = option(0.0, "share of the episodes in which a scripted mistake is made")
    midstates: Share = option(0.0, "share of the episodes that begin in the midst of the task")

    def __post_init__(self) -> None:
        check_values(self)
        self.camera_specs()
        if self.noise and self.frames == KEYFRAMES:
            raise SettingsError(
                "a keyframe is where the expert is back on its way, so it shows nothing of noise: "
                "leave out noise, or collect frames by stride"
            )
        if self.noise + self.mistakes + self.midstates > 1:
            raise SettingsError("noise, mistakes and midstates are more than all of the episodes")

    def camera_specs(self) -> tuple[CameraSpec, ...]:
        """The cameras, in their order, none for `NO_CAMERAS`; SettingsError for one that there is
        not."""
        if self.cameras.strip() == NO_CAMERAS:
            return ()
        names = list(dict.fromkeys(word.strip() for word in self.cameras.split(",")))
        if wrong := [name for name in names if name not in CAMERAS]:
            raise SettingsError(f"there is no camera {wrong[0]!r}; known are {', '.join(CAMERAS)}")
        return tuple(CameraSpec(name) for name in names)


def lists_of(settings: Collection) -> list[ListKey]:
    """The variants with their robots and scene modes, in the order of the data set; SettingsError.

    A data set has the first good seeds of each, so it follows from its settings alone.
    """
    tasks, levels = parse_tasks(settings.tasks), parse_levels(settings.levels)
    return [
        ListKey(task, level, robot, mode)
        for robot in parse_embodiments(settings.embodiment)
        for mode in dict.fromkeys(map(for_training, parse_modes(settings.mode)))
        for task in tasks
        for level in levels
    ]


def trial_of(key: ListKey, seed: int) -> TrialKey:
    """The trial of a demonstration."""
    return TrialKey(key.task, key.level, seed, key.embodiment, key.mode, "train")


MADE_BY = (
    *FOLDERS,
    "harness/datasets/",
    "harness/demonstrations/",
)
"""What makes episodes and packs them."""


@cache
def versions() -> dict[str, str]:
    """Suite, packages, and a hash of the code: with other ones, other bytes may come out."""
    found = {"suite": SUITE, **packages()}
    found["code"] = code_hash(MADE_BY)
    for package in ("av", "pillow"):
        try:
            found[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[package] = "missing"
    return found


def command_of(settings: Collection, layout: str) -> str:
    """The command line that makes the same data set, wherever that is put."""
    words = ["robospa", "collect"]
    for field in fields(settings):
        value = getattr(settings, field.name)
        flag = "--" + field.name.replace("_", "-")
        if value != field.default:
            words += [flag] if value is True else [flag, str(value)]
    return shlex.join([*words, "--format", layout, "--out", "DIR"])


SHARE_OF_LIMIT = 0.48
"""Frames of a demonstration, as a share of its step limit: mean of the variants
(`benchmarks/results/demonstrations.csv`)."""
KEYFRAME_SHARE = 0.06
"""The same of keyframes, an eighth of those by stride."""
FRAME_BYTES: Mapping[str, int] = {"h264": 1_500, "av1": 1_500, "jpeg": 9_000, "png": 12_000}
"""Of a picture of 320 x 240; measured, and rounded up."""
OTHER_BYTES, ROW_BYTES = 20_000, 400
"""Of an episode besides its pictures: its header, and numbers for every frame."""
STATE_BYTES = 4 * WIDTH
"""Of a frame's environment state."""
COPIES = 2
"""An episode's file stays until the data set is packed."""


def frames_of(settings: Collection, key: ListKey) -> float:
    """Frames that an episode of a variant has, about."""
    share = KEYFRAME_SHARE if settings.frames == KEYFRAMES else SHARE_OF_LIMIT
    return share * task(key.task).levels[key.level].steps


def expected_bytes(settings: Collection, keys: Iterable[ListKey], images: str) -> float:
    """Bytes of the data set, about."""
    frame = ROW_BYTES + FRAME_BYTES[images] * len(settings.camera_specs())
    frame += STATE_BYTES * settings.environment_state
    return sum(settings.episodes * (OTHER_BYTES + frame * frames_of(settings, key)) for key in keys)


def check_room(folder: Path, wanted: float) -> str:
    """A sentence about the room that `wanted` more bytes take in `folder` until they are packed;
    SettingsError if there is less."""
    free = shutil.disk_usage(folder).free
    need = COPIES * wanted
    if need > free:
        raise SettingsError(
            f"about {size_text(need)} are needed in {folder} and {size_text(free)} are free: make "
            "room, choose another --out, fewer episodes or cameras, or images that are smaller"
        )
    return f"about {size_text(wanted)}, twice that while it is packed; {size_text(free)} are free"
