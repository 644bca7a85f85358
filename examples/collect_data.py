"""Collect a small data set of demonstrations in LeRobot's format.

    python examples/collect_data.py data/mine --tasks Pick_Blocks_Size --episodes 10

Every episode is a trial of a training seed, which no evaluation has. What was recorded is replayed,
and kept only if the replay meets the goal. If it is stopped, the same command with --resume goes
on, and ends with the same bytes.
"""

from __future__ import annotations

import argparse

import robospa


def main() -> None:
    """Collect, and print what was made."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", help="folder of the data set")
    parser.add_argument("--tasks", default="Pick_Blocks_Size")
    parser.add_argument("--levels", default="1")
    parser.add_argument("--episodes", type=int, default=10, help="per variant")
    parser.add_argument("--cameras", default="head,left_wrist,right_wrist")
    parser.add_argument("--format", default="lerobot-v3")
    parser.add_argument("--workers", type=int, default=0)
    parser.add_argument("--resume", action="store_true")
    words = vars(parser.parse_args())
    made = robospa.collect(words.pop("out"), **words)
    if made is None:
        print("the data set was finished before")
        return
    for line in made.missing:
        print(line)
    print(f"{made.episodes} episodes in {', '.join(map(str, made.folders))}")


main()
