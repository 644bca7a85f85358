"""Compare two runs on the same seeds: what differs, by how much, and how sure that is.

    python examples/compare_two_runs.py runs/mine runs/before

Trials on one seed are held against each other, so that a difference shows with far fewer trials
than two unrelated rates would need. A published model's name may stand for one of the runs.
"""

from __future__ import annotations

import argparse

import robospa


def main() -> None:
    """Print both tables and the differences."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("first")
    parser.add_argument("second")
    parser.add_argument("--metric", default="sr", choices=["sr", "sr1", "onta", "onta1", "ps"])
    words = parser.parse_args()
    found = robospa.compare(words.first, words.second, words.metric)
    for note in (found.banner, *found.notes):
        if note:
            print(note)
    print(found.table())
    overall = found.groups[-1]
    low, high = 100 * overall.estimate.low, 100 * overall.estimate.high
    sure = "differ" if low > 0 or high < 0 else "cannot be told apart"
    print(f"{found.first} and {found.second} {sure}: [{low:+.1f}, {high:+.1f}] points at 95 %")


main()
