"""Try a task of your own before it is in any package: scenes, sentences, and the expert.

    python examples/make_my_own_task.py                        # docs/examples/leftmost_block
    python examples/make_my_own_task.py my_folder.task:TASK --level 3 --out task.png

A task is a module that ends in a TASK, and a TOML file of sentences beside it. Copy the folder
docs/examples/leftmost_block and change what differs; docs/adding-a-task.md explains each part.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from robospa.harness.factory import policy_factory
from robospa.harness.pictures.gallery import first_frame, save
from robospa.harness.seeds.attempt import ORACLE, attempt
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.registry import UnknownName, load
from robospa.tasks.catalog import build_scene, offer
from robospa.tasks.seeds import ListKey
from robospa.tasks.sentences import instruction

WORKED = "leftmost_block.task:TASK"
sys.path += [str(Path.cwd()), str(Path(__file__).resolve().parents[1] / "docs" / "examples")]


def main() -> None:
    """Draw scenes, print their sentences, and let the expert solve them."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("task", nargs="?", default=WORKED, help="module:TASK")
    parser.add_argument("--level", type=int, default=3)
    parser.add_argument("--first", type=int, default=500_000, help="first seed")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--out", default=None, help="PNG file of the first scene")
    words = parser.parse_args()
    try:
        offer(task := load(words.task))  # from now on this process knows it by its name
        build_scene(task.name, words.level, words.first)
    except (UnknownName, ValueError) as error:
        parser.error(str(error))

    world, expert = SapienWorld(), policy_factory(ORACLE)()
    solved = 0
    for seed in range(words.first, words.first + words.seeds):
        scene = build_scene(task.name, words.level, seed)
        tried = attempt(world, expert, ListKey(task.name, words.level), seed)
        solved += tried.accepted
        said = instruction(scene, "train")
        print(f"seed {seed}: {said} Expert: {tried.reason or 'done'}")
    print(f"{task.name} level {words.level}: the expert solves {solved} of {words.seeds} seeds")
    if words.out:
        scene = build_scene(task.name, words.level, words.first)
        save(first_frame(world, scene, size=(640, 480)), Path(words.out))
        print(words.out)
    world.close()


main()
