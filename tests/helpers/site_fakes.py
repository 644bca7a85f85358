"""Submissions with badges, made from fake bundles; entries in any number."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from bundle_fakes import CARD_DATA, REFERENCE, Weak, make_run
from fake_runs import record
from run_fakes import FakePolicy

from robospa.leaderboard.bundle import canonical
from robospa.leaderboard.card import to_card
from robospa.leaderboard.entries import Entry, page_values, published_entries
from robospa.leaderboard.evidence import TESTED
from robospa.leaderboard.packing import pack
from robospa.leaderboard.submission import add
from robospa.leaderboard.verify import Valid
from robospa.results.paper.columns import Column
from robospa.results.paper.published import LEVELS, load
from robospa.results.scoring.models import ModelResults, Setting
from robospa.results.scoring.scores import combine, score_cell

REPLAYED: dict[str, Any] = {
    "challenge": "0123456789abcdef",
    "sampled": 20,
    "trials": 20,
    "identical": 20,
    "agrees": 0,
    "different": 0,
}
REPRODUCED: dict[str, Any] = {
    "commitment": "c" * 64,
    "alpha": 0.01,
    "trials": 2000,
    "power": {"0.02": 0.4, "0.05": 0.97, "0.1": 1.0},
    "categories": {"Pick_Blocks_Size": "GAC"},
    "counts": {m: {f"Pick_Blocks_Size/{n}": [60, 100, 242, 400] for n in LEVELS} for m in TESTED},
    "cells": {"GAC/0": 0.97, "Pick_Blocks_Size/0": 0.97, "Pick_Blocks_Size/1": 0.3},
}


def make_valid(folder: Path, policy: FakePolicy | None = None, **card: Any) -> Valid:
    """A valid bundle in `folder` of what `policy` did, its card changed by `card`."""
    run = make_run(folder / "run", policy=policy)
    return pack([run], to_card({**CARD_DATA, **card}), folder / "bundle.zip", REFERENCE)[0]


def make_submission(folder: Path, home: Path, *evidence: dict[str, Any], **card: Any) -> Path:
    """A submission below `home`."""
    valid = make_valid(folder, **card)
    found = [{badge: of_bundle(valid, part[badge]) for badge in part} for part in evidence]
    return add(valid, found, home, address="https://example.org/bundle.zip")


def of_bundle(valid: Valid, evidence: dict[str, Any]) -> dict[str, Any]:
    """`evidence` as that of this very bundle, unless it names another."""
    return {"bundle": valid.manifest.bundle, **evidence}


class Weaker(Weak):
    """Fails at seeds that end in 2, too."""

    def infer(self, observation: Any) -> Any:
        assert self.trial is not None
        return super().infer(observation) * (self.last_digit != 2)


def many_entries(count: int) -> list[Entry]:
    """The published models, and `count` more with random results of the whole benchmark."""
    published = published_entries()
    return [*published, *(_random_entry(published[0], number) for number in range(count))]


def _random_entry(model: Entry, number: int) -> Entry:
    rng = np.random.default_rng(number)
    skill = rng.uniform(0.05, 0.9)
    cells = {}
    for task in load().tasks.values():
        for level in LEVELS:
            count = task.counts[level - 1]
            good = rng.random(20) < skill * (1.1 - 0.15 * level)
            records = [
                record(task.name, level, n, int(g) * count, count, category=task.category)
                for n, g in enumerate(good)
            ]
            cells[task.name, level] = score_cell(task.name, level, task.category, 20, records)
    name = f"Model {number}"
    mode = ("clean", "randomised")[number % 2]
    setting = Setting(("aloha-agilex",), (mode,), ("heldout",), ("robospa-1",))
    column = Column(ModelResults(name, combine(cells), setting))
    return replace(
        model,
        slug=f"model-{number}",
        name=name,
        team=f"Team {number % 7}",
        badges=("valid", *("replayed",) * (number % 2), "reproduced"),
        column=column,
        cells=tuple(f"{row}/{n}" for row in page_values(model)["sr"] for n in (0, *LEVELS)),
    )


def change(path: Path, edit: Any) -> None:
    """Edit a JSON file as canonical text."""
    data = json.loads(path.read_text())
    edit(data)
    path.write_bytes(canonical(data))
