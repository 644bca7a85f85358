"""Shuffled sentences: of other scenes of the variant, said wherever the results stand."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest
from fake_runs import KNOWN, make_run
from msgspec import structs

from robospa.harness.running.request import make_request
from robospa.harness.running.worker import task_finder
from robospa.harness.settings import EvaluationSettings, SettingsError, Simulation
from robospa.harness.trial import task_parts
from robospa.harness.worlds import SHUFFLED_PARTS, TASK_PARTS, other_seed, shuffled_parts
from robospa.results.paper.columns import run_column
from robospa.results.report.page import badges
from robospa.results.report.run_card import facts
from robospa.results.report.score_table import score_table
from robospa.results.scoring.scores import score_run
from robospa.tasks.catalog import build_scene
from robospa.tasks.sentences import instruction
from robospa.trial import TrialKey

KEYS = [TrialKey("Pick_Blocks_Size", 2, seed) for seed in range(100_000, 100_012)]


def test_a_trial_has_its_scene_and_goal_and_the_sentence_of_another() -> None:
    plain, shuffled = task_parts(KEYS[0]), shuffled_parts(KEYS[0])
    assert shuffled.scene == plain.scene and type(shuffled.tracker) is type(plain.tracker)
    other = build_scene("Pick_Blocks_Size", 2, other_seed(KEYS[0]), "aloha-agilex", "clean")
    assert shuffled.instruction == instruction(other, "heldout") != plain.instruction
    assert shuffled_parts(KEYS[0]).instruction == shuffled.instruction


def test_no_sentence_comes_from_a_scene_that_is_evaluated() -> None:
    seeds = [other_seed(key) for key in KEYS]
    assert len(set(seeds)) == len(seeds) and min(seeds) >= 1_000_000 and max(seeds) < 2_000_000
    moved = replace(KEYS[0], embodiment="piper", mode="randomized", split="train")
    assert other_seed(moved) == other_seed(KEYS[0])


def test_the_setting_chooses_the_parts_of_a_run(tmp_path: Path) -> None:
    settings = EvaluationSettings(policy=("random",), out=tmp_path)
    assert make_request(settings, keys=KEYS).config.parts == TASK_PARTS
    shuffled = replace(settings, simulation=Simulation(shuffle_instructions=True))
    assert make_request(shuffled, keys=KEYS).config.parts == SHUFFLED_PARTS
    assert task_finder(SHUFFLED_PARTS)(KEYS[0]).name == "Pick_Blocks_Size"
    with pytest.raises(SettingsError, match="suite's own trials"):
        Simulation(shuffle_instructions=True, parts="my:parts")


def test_it_is_said_wherever_the_results_stand(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", KNOWN)
    assert not any("another scene" in text for text in badges([run], ["x"]))
    settings = structs.replace(run.manifest.settings, shuffled_instructions=True)
    shuffled = replace(run, manifest=structs.replace(run.manifest, settings=settings))
    shown = (
        badges([shuffled], ["x"])[0],
        score_table(shuffled, score_run(shuffled)).title,
        str(facts(shuffled)),
        run_column(shuffled).title,
    )
    assert all("shuffled" in text or "sentence" in text for text in shown), shown
