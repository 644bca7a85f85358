"""The features of a data set in LeRobot's formats: names, shapes, an episode's rows as a table.

LeRobot makes every feature whose name begins with `observation` an input of the policy that it
trains, and every one that begins with `action` an output. So only the pictures, the commanded
state, the action and, where it was asked for, the environment state begin so; what is there for
other uses (reward models, hierarchical policies, filtering) does not.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ARMS, ActionSpace
from robospa.harness.datasets.episode import ENDINGS, Camera, DatasetEpisode, Pictures
from robospa.harness.datasets.pictures import FPS
from robospa.observation import NAMES

if TYPE_CHECKING:
    import pyarrow as pa

UNSTATED = "unstated"
"""The robot of recordings that do not say theirs."""


class EpisodeMisfit(Exception):
    """An episode does not fit the data set it is to join; the message says how."""


@dataclass(frozen=True)
class EpisodeLayout:
    """What all episodes of a data set have in common."""

    robot: str
    space: ActionSpace
    joints: tuple[str, ...]
    """Names of the columns of a state."""
    cameras: Mapping[str, Camera]
    environment_state: bool = False
    """Whether frames have the objects as numbers."""
    absent: frozenset[str] = frozenset()
    """Features that imported recordings do not have."""

    @property
    def films(self) -> list[str]:
        """The cameras whose pictures are films."""
        return [name for name, camera in self.cameras.items() if camera.filmed]

    @property
    def stills(self) -> list[str]:
        """The others, whose pictures lie in the rows."""
        return [name for name, camera in self.cameras.items() if not camera.filmed]

    def check(self, episode: DatasetEpisode) -> None:
        """Raises EpisodeMisfit if `episode` is of another robot or of other settings."""
        found = layout_of(episode)
        for name, what in MISFITS.items():
            theirs, ours = getattr(found, name), getattr(self, name)
            if theirs != ours:
                raise EpisodeMisfit(
                    f"{episode.key.slug} has the {what} {_text(theirs)}, and the data set "
                    f"{_text(ours)}: a data set has one robot and the same settings throughout"
                )


MISFITS = {
    "robot": "robot",
    "space": "actions",
    "environment_state": "environment state",
    "absent": "missing features",
    "cameras": "pictures",
}
"""What all episodes have alike, in words."""


def layout_of(episode: DatasetEpisode) -> EpisodeLayout:
    """The layout of a data set that begins with `episode`."""
    robot, space, seen = episode.key.embodiment, episode.space, episode.pictures
    cameras = {name: Camera(of.codec, of.width, of.height) for name, of in seen.items()}
    objects = bool(episode.environment_state.size)
    absent = frozenset(episode.absent) & {*ALWAYS, "measured_state"}
    return EpisodeLayout(robot, space, joint_names(robot, space), cameras, objects, absent)


def joint_names(robot: str, space: ActionSpace) -> tuple[str, ...]:
    """The columns of a state of `robot`, by its joints' own names: `left_fl_joint1`, ...,
    `left_gripper`; by arm and number if the robot is UNSTATED. Raises EpisodeMisfit if they are not
    those of `space`."""
    if robot == UNSTATED:
        counts = zip(ARMS, space.joints, strict=True)
        columns = [(side, [f"joint{i + 1}" for i in range(n)]) for side, n in counts]
        return tuple(f"{side}_{name}" for side, of in columns for name in (*of, "gripper"))
    from robospa.harness.robots import embodiment

    arms = embodiment(robot).arms
    names = []
    for side, arm in zip(ARMS, arms, strict=True):
        names += [f"{side}_{joint.name}" for joint in arm.joints] + [f"{side}_gripper"]
    if len(names) != space.width:
        raise EpisodeMisfit(f"a state of {robot} has {len(names)} numbers, not {space.width}")
    return tuple(names)


def _text(value: object) -> str:
    if not isinstance(value, dict):
        return str(value)
    each = (f"{name} {c.codec} {c.width}x{c.height}" for name, c in value.items())
    return ", ".join(each) or "none"


ENVIRONMENT = "observation.environment_state"
"""As LeRobot calls what a policy knows of its surroundings besides pictures."""
POSES = tuple(
    f"{side}_{part}" for side in ARMS for part in ("x", "y", "z", "qw", "qx", "qy", "qz", "gripper")
)
ALWAYS = {
    "sim_time": "float32",
    "subtask_index": "int64",
    "label": "int64",
    "timestamp": "float32",
    "frame_index": "int64",
    "episode_index": "int64",
    "index": "int64",
    "task_index": "int64",
}
"""Features of one number, by their type."""


def picture_key(camera: str) -> str:
    """The feature of a camera's pictures."""
    return f"observation.images.{camera}"


def vectors(layout: EpisodeLayout) -> dict[str, tuple[str, ...]]:
    """The features of several float32 numbers, and what each number is."""
    objects = {ENVIRONMENT: NAMES} if layout.environment_state else {}
    return {
        "observation.state": layout.joints,
        **objects,
        "action": layout.joints,
        **({} if "measured_state" in layout.absent else {"measured_state": layout.joints}),
        "ee_pose": POSES,
    }


def singles(layout: EpisodeLayout) -> dict[str, str]:
    """The features of one number, and their types."""
    return {name: dtype for name, dtype in ALWAYS.items() if name not in layout.absent}


def described(layout: EpisodeLayout, depth_key: str) -> dict[str, dict[str, object]]:
    """`features` of LeRobot's meta/info.json; `depth_key` is how its version says "no depth"."""
    found: dict[str, dict[str, object]] = {}
    for name, names in vectors(layout).items():
        found[name] = {"dtype": "float32", "shape": [len(names)], "names": list(names)}
    for name, camera in layout.cameras.items():
        size = [camera.height, camera.width, 3]
        of: dict[str, object] = {"dtype": "image", "shape": size}
        of["names"] = ["height", "width", "channels"]
        if camera.filmed:
            of["dtype"] = "video"
            of["info"] = {
                "video.height": camera.height,
                "video.width": camera.width,
                "video.codec": camera.codec,
                "video.pix_fmt": "yuv420p",
                "video.fps": FPS,
                "video.channels": 3,
                "has_audio": False,
                depth_key: False,
            }
        found[picture_key(name)] = of
    for name, dtype in singles(layout).items():
        found[name] = {"dtype": dtype, "shape": [1], "names": None}
    return found


def facts_of(episode: DatasetEpisode) -> dict[str, object]:
    """What the table of episodes of version 3.0 says of one, besides what LeRobot asks for."""
    key = episode.key
    found: dict[str, object] = {
        "instructions": list(episode.instructions),
        "base_task": key.task,
        "level": key.level,
        "seed": key.seed,
        "embodiment": key.embodiment,
        "mode": key.mode,
        "kind": episode.kind,
        "success": episode.success,
        "failure": episode.failure,
        "scene_digest": episode.scene_digest,
        "replay_digest": episode.replay_digest,
        "stride": episode.stride,
    }
    if "seed" in episode.absent:  # of some recordings of a data set it is known
        found["seed"] = None
    return {name: of for name, of in found.items() if name == "seed" or name not in episode.absent}


def frame_schema(layout: EpisodeLayout) -> pa.Schema:
    """Columns of a data file: every feature but films."""
    import pyarrow as pa

    fields = [pa.field(n, pa.list_(pa.float32(), len(of))) for n, of in vectors(layout).items()]
    image = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
    fields += [pa.field(picture_key(name), image) for name in layout.stills]
    fields += [pa.field(name, pa.type_for_alias(dtype)) for name, dtype in singles(layout).items()]
    images = {picture_key(name): {"_type": "Image"} for name in layout.stills}
    about = {"huggingface": json.dumps({"info": {"features": images}})} if images else None
    return pa.schema(fields, metadata=about)


def frame_table(
    layout: EpisodeLayout,
    numbers: Mapping[str, NDArray[np.generic]],
    pictures: Mapping[str, Pictures],
) -> pa.Table:
    """The rows of an episode."""
    import pyarrow as pa

    schema = frame_schema(layout)
    columns = {}
    for name, values in numbers.items():
        kind = schema.field(name).type
        if values.ndim == 1:
            columns[name] = pa.array(values, kind)
        else:
            flat = pa.array(np.ascontiguousarray(values, np.float32).ravel())
            columns[name] = pa.FixedSizeListArray.from_arrays(flat, values.shape[1])
    for camera in layout.stills:
        seen = pictures[camera]
        key, ending = picture_key(camera), ENDINGS[seen.codec]
        named = ((f"frame-{t:06d}.{ending}", data) for t, data in enumerate(seen.files))
        images = [{"bytes": data, "path": name} for name, data in named]
        columns[key] = pa.array(images, schema.field(key).type)
    return pa.table([columns[name] for name in schema.names], schema=schema)
