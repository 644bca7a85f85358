"""What is learned from: scenes, sentences, states of plans and pictures, all functions of a seed.

Nothing here needs physics: a scene's plan is read as steps (`steps`), and the head camera draws the
objects where each step leaves them. Seeds are those of training alone, sentences of the split
`train`, textures of the split `seen`. What is made is kept in folders, a file a block of scenes, so
that a making that was cut short goes on where it was.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ARMS
from robospa.baselines.learned import steps
from robospa.baselines.learned.steps import KINDS, TYPES, Seen, State, Step
from robospa.geometry import Pose, yaw_rotation
from robospa.harness.robots import embodiment
from robospa.harness.running.atomic_file import replace_file
from robospa.observation import CameraSpec
from robospa.tasks.catalog import LEVELS, build_scene, tasks
from robospa.tasks.objects import model_of, object_model
from robospa.tasks.sampling.places import LayoutError
from robospa.tasks.scene import Scene
from robospa.tasks.seeds import FIRST_TRAINING_SEED
from robospa.tasks.sentences import sentences
from robospa.workcell import HEIGHT, WIDTH, WORKCELL

if TYPE_CHECKING:
    from robospa.harness.sim.renderer import Renderer

Array = NDArray[np.float32]
SEEN_WIDTH = 12
"""Numbers of one `Seen`: kind, x, y, z, half sizes, turn, colour, hinge."""
TOKEN_WIDTH = 2 * SEEN_WIDTH + 6
"""Numbers of one `Tracked`: now, first, acts, goals, visible, at start, object and destination of
the last step."""
NOTHING = -1
TOLD = 8
"""Sentences kept of a scene."""
RANDOMISED = 4
"""Of so many pictures one shows a randomised scene."""
FAR_UP = 0.05
"""A thing so far [m] above where it stood is in a hand: such states are not drawn."""
UNDRAWN = ("dock", "hang", "pour", "hit", "pick")
"""After these steps a thing is tilted, or in a hand, as no `Seen` says."""


def seen_numbers(seen: Seen) -> list[float]:
    """A `Seen` as SEEN_WIDTH numbers."""
    kind = float(KINDS.index(seen.kind))
    return [kind, *seen.place, *seen.half, seen.turn, *seen.color, seen.hinge]


def tokens_of(state: State) -> Array:
    """(N, TOKEN_WIDTH): the objects of a state; what cannot be seen is zero."""
    last = state.done[-1] if state.done else Step("wait")
    rows = np.zeros((len(state.objects), TOKEN_WIDTH), np.float32)
    for i, item in enumerate(state.objects):
        if item.visible:
            rows[i, :SEEN_WIDTH] = seen_numbers(item.now)
        if item.at_start or not item.visible:
            rows[i, SEEN_WIDTH : 2 * SEEN_WIDTH] = seen_numbers(item.first)
        flags = [item.visible, item.at_start, i == last.object, i == last.destination]
        rows[i, 2 * SEEN_WIDTH :] = [item.acts, item.goals, *flags]
    return rows


@dataclass(frozen=True)
class Lesson:
    """All states of a scene's plan: `tokens` (N, TOKEN_WIDTH) of each; `answers` (S, 6): type,
    object, destination, place or nan, reference; `last` (S, 2): steps done and type of the last
    one; and what the scene may be told by."""

    tokens: list[Array]
    answers: Array
    last: NDArray[np.int16]
    told: tuple[str, ...]
    variant: int
    """Index in `variants()`."""


def lesson(scene: Scene, split: str = "train", count: int = TOLD) -> Lesson:
    """The lesson of a scene, with `count` of its sentences."""
    pairs = steps.labelled(scene)
    if pairs[0][1].type == "pick" and len(pairs) == 2:
        pairs = pairs[:1]  # a picked target ends the trial
    reference = scene.facts.get("reference", "")
    names = [o.name for o in scene.objects if o.appears_at is None]
    refers = names.index(reference) if reference in names else NOTHING
    answers = [_answer(step, refers) for _, step in pairs]
    last = [(len(s.done), TYPES.index(s.done[-1].type) if s.done else NOTHING) for s, _ in pairs]
    every = sentences(scene, split)
    rng = np.random.default_rng([scene.seed, scene.level])
    told = tuple(every[int(i)] for i in rng.permutation(len(every))[:count])
    tokens = [tokens_of(state) for state, _ in pairs]
    where = variants().index((scene.task, scene.level))
    return Lesson(tokens, np.array(answers, np.float32), np.array(last, np.int16), told, where)


def _answer(step: Step, refers: int) -> tuple[float, ...]:
    numbers = [NOTHING if i is None else i for i in (step.object, step.destination)]
    place = step.place or (np.nan, np.nan)
    return (TYPES.index(step.type), *numbers, *place, refers)


@cache
def variants() -> tuple[tuple[str, int], ...]:
    """All variants of the benchmark's tasks, the basic ones too."""
    return tuple((name, level) for name in tasks() for level in LEVELS)


def scenes(block: int, first: int = FIRST_TRAINING_SEED, mode: str = "clean") -> Iterator[Scene]:
    """One scene of every variant: block number `block`, whose seeds begin at `first`."""
    for name, level in variants():
        for seed in range(first + block * 8, first + block * 8 + 8):
            try:
                yield build_scene(name, level, seed, mode=mode)
            except LayoutError:
                continue
            break


# -- pictures -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class Picture:
    """A head picture (H, W, 3) and the `seen` objects in it (N, SEEN_WIDTH)."""

    image: NDArray[np.uint8]
    seen: Array


@cache
def _renderer(robot: str) -> tuple[Renderer, list[dict[str, Pose]]]:
    """What draws, and the links of the arms at home; opened once a process."""
    from robospa.harness.sim.renderer import Renderer
    from robospa.harness.sim.sapien_world import SapienWorld

    world = SapienWorld(render=False)
    world.load(build_scene("Click_Bell_Repeat", 1, FIRST_TRAINING_SEED, robot))
    bodies, arms = world.bodies(), embodiment(robot).arms
    pairs = zip(ARMS, arms, strict=True)
    return Renderer(), [{n: bodies[f"{side} {n}"] for n in arm.links} for side, arm in pairs]


def picture(scene: Scene, state: State) -> Picture:
    """What the head camera sees of a state of the scene's plan, arms at home."""
    renderer, links = _renderer(scene.embodiment)
    items = [o for o in scene.objects if o.appears_at is None]
    items += [o for o in scene.objects if o.appears_at is not None]
    now = [o.now for o in state.objects]
    poses = {o.name: _pose(model_of(o).bottom, s) for o, s in zip(items, now, strict=False)}
    hinges = {o.name: s.hinge for o, s in zip(items, now, strict=False) if s.hinge}
    poses |= {o.name: o.pose for o in scene.clutter}
    renderer.sync(scene, embodiment(scene.embodiment), object_model)
    image = renderer.render([CameraSpec("head", WIDTH, HEIGHT)], links, poses, hinges)[0]
    shown = [o.now for o in state.objects if o.visible]
    shown += [
        steps.seen_at(o.asset, model_of(o), o.pose) for o in scene.clutter if o.asset in KINDS
    ]
    rows = np.array([seen_numbers(s) for s in shown], np.float32).reshape(-1, SEEN_WIDTH)
    return Picture(image, rows[in_picture(rows)])


def _pose(bottom: float, seen: Seen) -> Pose:
    x, y, z = seen.place
    return Pose((x, y, z - bottom), yaw_rotation(seen.turn))


def in_picture(rows: Array, margin: float = 1.0) -> NDArray[np.bool_]:
    """Which of the `Seen` rows (N, SEEN_WIDTH) have their middle in the picture."""
    u, v = middle_pixel(rows)
    inside = (u > margin) & (u < WIDTH - margin) & (v > margin) & (v < HEIGHT - margin)
    return np.asarray(inside)


def middle_pixel(rows: Array) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Column and row [px] of the middles of `Seen` rows (N, SEEN_WIDTH)."""
    x, y, z = (rows[:, i].astype(np.float64) for i in (1, 2, 3))
    return WORKCELL.head.pixel(x, y, z + rows[:, 6])


def drawable(pairs: Sequence[tuple[State, Step]]) -> list[State]:
    """The states of a plan in which every thing stands upright and in no hand."""
    return [s for s, _ in pairs if not any(step.type in UNDRAWN for step in s.done)]


def pictures(block: int, first: int = FIRST_TRAINING_SEED) -> Iterator[Picture]:
    """One picture of every variant: of the start, or of a later state of the plan; of a randomised
    scene for one in RANDOMISED of the blocks."""
    mode = "randomized-seen" if block % RANDOMISED == RANDOMISED - 1 else "clean"
    rng = np.random.default_rng([first, block])
    for scene in scenes(block, first, mode):
        states = drawable(steps.labelled(scene))
        later = len(states) > 1 and rng.random() < 0.5
        yield picture(scene, states[int(rng.integers(1, len(states))) if later else 0])


def save_pictures(path: Path, made: Sequence[Picture]) -> None:
    """Write pictures, packed without loss, and what is seen in them to one file."""
    from PIL import Image

    packed = []
    for item in made:
        stream = BytesIO()
        Image.fromarray(item.image).save(stream, "PNG", compress_level=1)
        packed.append(stream.getvalue())
    whole = BytesIO()
    np.savez(
        whole,
        packed=np.frombuffer(b"".join(packed), np.uint8),
        lengths=np.array([len(p) for p in packed], np.int64),
        seen=np.concatenate([item.seen for item in made]),
        sizes=np.array([len(item.seen) for item in made], np.int64),
    )
    replace_file(path, whole.getvalue())


class Pictures:
    """The pictures of several files, unpacked when they are asked for."""

    def __init__(self, paths: Sequence[Path]) -> None:
        self._packed: list[bytes] = []
        self.seen: list[Array] = []
        for path in paths:
            with np.load(path) as kept:
                data, ends = kept["packed"].tobytes(), np.cumsum(kept["lengths"])
                starts = ends - kept["lengths"]
                self._packed += [data[a:b] for a, b in zip(starts, ends, strict=True)]
                self.seen += np.split(kept["seen"], np.cumsum(kept["sizes"])[:-1])

    def __len__(self) -> int:
        """How many there are."""
        return len(self._packed)

    def image(self, index: int) -> NDArray[np.uint8]:
        """Picture number `index` (H, W, 3)."""
        from PIL import Image

        return np.asarray(Image.open(BytesIO(self._packed[index])))


def make(folder: Path, blocks: Sequence[int], say: Callable[[str], None]) -> list[Path]:
    """Make the `blocks` of pictures that are not in `folder` yet."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"pictures-{block:05}.npz" for block in blocks]
    for block, path in zip(blocks, paths, strict=True):
        if not path.exists():
            save_pictures(path, list(pictures(block)))
            say(f"{path.name} made")
    return paths
