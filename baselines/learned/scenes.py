"""What is learned from: scenes, sentences, states of plans and pictures, all functions of a seed.

Nothing here needs physics: a scene's plan is read as steps (`steps`), and the head camera draws the
objects where each step leaves them. Seeds are those of training alone, sentences of the split
`train`, textures of the split `seen`. What is made is kept in folders, a file a block of scenes, so
that a making that was cut short goes on where it was.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cache
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from robospa.action_space import ARMS
from robospa.baselines.learned import steps
from robospa.baselines.learned.steps import KINDS, TYPES, Seen, State, Step
from robospa.geometry import Pose
from robospa.harness.robots import embodiment
from robospa.harness.running.atomic_file import replace_file
from robospa.observation import CameraSpec
from robospa.protocol.codec import Limits, decode, encode
from robospa.tasks.catalog import LEVELS, build_scene, task, tasks
from robospa.tasks.objects import model_of
from robospa.tasks.sampling.places import LayoutError
from robospa.tasks.scene import Scene
from robospa.tasks.seeds import FIRST_TRAINING_SEED
from robospa.tasks.sentences import sentences
from robospa.trial import REFERENCE
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
TOLD = 24
"""Sentences kept of a scene."""
LARGE = Limits(message=2**30, items=10**7)
"""Of a file of pictures."""
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


def last_of(state: State) -> tuple[int, int]:
    """How many steps are done, and the number of the type of the last one."""
    return len(state.done), TYPES.index(state.done[-1].type) if state.done else NOTHING


@dataclass(frozen=True)
class Lesson:
    """All states of a scene's plan: `tokens` (N, TOKEN_WIDTH) of each; `answers` (M, 6), the plan's
    and others that are as right: type, object, destination, place or nan, reference; `last` (S, 2):
    steps done and type of the last one; and what the scene may be told by."""

    tokens: list[Array]
    answers: list[Array]
    last: NDArray[np.int16]
    told: tuple[str, ...]
    variant: int
    """Index in `variants()`."""


def lesson(scene: Scene) -> Lesson:
    """The lesson of a scene. Where things may be moved in any order, half of the plans do."""
    rng = np.random.default_rng([scene.seed, scene.level])
    free = task(scene.task).category == "OFE" or scene.task == "Observe_Blocks_Move_Memory"
    pairs = steps.labelled(scene, rng if free and rng.random() < 0.5 else None)
    if pairs[0][1].type == "pick" and len(pairs) == 2:
        pairs = pairs[:1]  # a picked target ends the trial
    reference = scene.facts.get("reference", "")
    names = [o.name for o in steps.in_order(scene)]
    named = names.index(reference) if reference in names else None
    plan, answers = steps.numbered(scene) if free else [], []
    for state, step in pairs:
        untouched = [s for s in plan if s.object is not None and not state.objects[s.object].acts]
        left = [replace(s, destination=step.destination) for s in untouched if s.type == step.type]
        rows = [(s, steps.reminder(state, s) if named is None else named) for s in left or [step]]
        answers.append(np.array([_answer(*row) for row in rows], np.float32))
    last = np.array([last_of(state) for state, _ in pairs], np.int16)
    every = sentences(scene, "train")
    told = tuple(every[int(i)] for i in rng.permutation(len(every))[:TOLD])
    tokens = [tokens_of(among_clutter(state, scene)) for state, _ in pairs]
    where = variants().index((scene.task, scene.level))
    return Lesson(tokens, answers, last, told, where)


def among_clutter(state: State, scene: Scene) -> State:
    """The state with the clutter that the head camera shows behind its objects, of which a wall may
    hide some; nothing is done with it."""
    every = [steps.tracked(item) for item in scene.clutter if item.asset in KINDS]
    clutter = tuple(one for one in every if steps.in_picture(one.now))
    shown = steps.hidden(replace(state, objects=state.objects + clutter)).objects
    return replace(state, objects=state.objects + shown[len(state.objects) :])


def _answer(step: Step, refers: int | None) -> tuple[float, ...]:
    numbers = [NOTHING if i is None else i for i in (step.object, step.destination, refers)]
    return (TYPES.index(step.type), *numbers[:2], *(step.place or (np.nan, np.nan)), numbers[2])


@cache
def variants() -> tuple[tuple[str, int], ...]:
    """All variants of the benchmark's tasks, the basic ones too."""
    return tuple((name, level) for name in tasks() for level in LEVELS)


def scenes(block: int) -> Iterator[Scene]:
    """One scene of every variant, of seeds of the block's own; of four blocks two are of clean
    scenes, two of randomised ones."""
    mode = "randomized-seen" if block % 4 > 1 else "clean"
    first = FIRST_TRAINING_SEED + block * 8
    for name, level in variants():
        for seed in range(first, first + 8):
            with suppress(LayoutError):
                yield build_scene(name, level, seed, mode=mode)
                break


@dataclass(frozen=True)
class Picture:
    """A head picture, packed without loss, and the `seen` objects in it (N, SEEN_WIDTH)."""

    packed: bytes
    seen: Array

    @property
    def image(self) -> NDArray[np.uint8]:
        """(H, W, 3)."""
        from PIL import Image

        return np.asarray(Image.open(BytesIO(self.packed)))


@cache
def _renderer() -> tuple[Renderer, list[dict[str, Pose]]]:
    """What draws, and the links of the arms at home; opened once a process."""
    from robospa.harness.sim.renderer import Renderer
    from robospa.harness.sim.sapien_world import SapienWorld

    world = SapienWorld(render=False)
    world.load(build_scene("Click_Bell_Repeat", 1, FIRST_TRAINING_SEED))
    bodies, arms = world.bodies(), zip(ARMS, embodiment(REFERENCE).arms, strict=True)
    return Renderer(), [{n: bodies[f"{side} {n}"] for n in arm.links} for side, arm in arms]


def picture(scene: Scene, state: State) -> Picture:
    """What the head camera sees of a state of the scene's plan, arms at home."""
    from PIL import Image

    renderer, links = _renderer()
    poses, hinges = dict[str, Pose](), dict[str, float]()
    for item, shown in zip(steps.in_order(scene), state.objects, strict=False):
        poses[item.name] = steps.pose_of(shown.now, model_of(item))
        hinges |= {item.name: shown.now.hinge} if shown.now.hinge else {}
    poses |= {o.name: o.pose for o in scene.clutter}
    renderer.sync(scene, embodiment(scene.embodiment))
    image = renderer.render([CameraSpec("head", WIDTH, HEIGHT)], links, poses, hinges)[0]
    every = [o.now for o in among_clutter(state, scene).objects if o.visible]
    rows = [seen_numbers(one) for one in every if steps.in_picture(one)]
    packed = BytesIO()
    Image.fromarray(image).save(packed, "PNG", compress_level=1)
    return Picture(packed.getvalue(), np.array(rows, np.float32).reshape(-1, SEEN_WIDTH))


def middle_pixel(rows: Array) -> NDArray[np.float64]:
    """Column and row [px] of the middles of `Seen` rows (N, SEEN_WIDTH), as (N, 2)."""
    x, y, z = (rows[:, i].astype(np.float64) for i in (1, 2, 3))
    return np.stack(WORKCELL.head.pixel(x, y, z + rows[:, 6]), axis=1)


def drawable(pairs: Sequence[tuple[State, Step]]) -> list[State]:
    """The states of a plan in which every thing stands upright and in no hand."""
    return [s for s, _ in pairs if not any(step.type in UNDRAWN for step in s.done)]


def pictures(block: int) -> Iterator[Picture]:
    """One picture of every variant: of the start, or of a later state of the plan."""
    rng = np.random.default_rng([FIRST_TRAINING_SEED, block])
    for scene in scenes(block):
        states = drawable(steps.labelled(scene))
        later = len(states) > 1 and rng.random() < 0.5
        yield picture(scene, states[int(rng.integers(1, len(states))) if later else 0])


def read(paths: Iterable[Path]) -> list[Picture]:
    """The pictures in files that `make` wrote."""
    rows = [decode(path.read_bytes(), LARGE) for path in paths]
    return [Picture(**item) for row in rows if isinstance(row, list) for item in row]


def make(folder: Path, blocks: Sequence[int], say: Callable[[str], None]) -> list[Path]:
    """The files of the `blocks` of pictures in `folder`; those that are not there yet are made."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"pictures-{block:05}" for block in blocks]
    for block, path in zip(blocks, paths, strict=True):
        if not path.exists():
            replace_file(path, encode([vars(o) for o in pictures(block) if len(o.seen)], LARGE))
            say(f"{path.name} made")
    return paths
