"""The model card: a template to fill in, every field checked."""

from __future__ import annotations

import tomllib
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
from bundle_fakes import CARD_DATA

from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.card import check_checkpoints, check_folder, read_card, template, to_card

TASKS = ("Pick_Blocks_Size", "Press_Stapler_Repeat")


def test_the_template_asks_for_every_field_and_passes_once_filled_in() -> None:
    text = template()
    with pytest.raises(BundleError, match="'name' must be text of 1 to 80 plain characters"):
        to_card(tomllib.loads(text))
    filled = text.replace('""', '"x"').replace('link = "x"', 'link = "https://x.org"')
    filled = filled.replace('reference = "x"', 'reference = "https://x.org/w"')
    filled = filled.replace('sha256 = "x"', f'sha256 = "{"0" * 64}"')
    check_checkpoints(to_card(tomllib.loads(filled)), TASKS[:1])


def test_a_model_of_single_tasks_has_a_checkpoint_for_each() -> None:
    card = deepcopy(CARD_DATA)
    card["training"]["tasks"] = "single"
    card["checkpoints"] = {TASKS[0]: CARD_DATA["checkpoints"]["all"]}
    with pytest.raises(BundleError, match="no checkpoint for Press_Stapler_Repeat"):
        check_checkpoints(to_card(card), TASKS)
    card["checkpoints"][TASKS[1]] = CARD_DATA["checkpoints"]["all"]
    check_checkpoints(to_card(card), TASKS)
    card["checkpoints"]["Another_Task"] = CARD_DATA["checkpoints"]["all"]
    with pytest.raises(BundleError, match="Another_Task, which the run has no trials of"):
        check_checkpoints(to_card(card), TASKS)


@pytest.mark.parametrize(
    ("group", "field", "value"),
    [
        ("", "name", 3),
        ("", "name", "two\nlines"),
        ("", "parameters", True),
        ("", "parameters", -1),
        ("", "link", "ftp://x.org"),
        ("training", "tasks", "some"),
        ("training", "demonstrations", [50] * 4),
        ("training", "demonstrations", 50),
        ("actions", "rate", 0),
        ("actions", "rate", float("inf")),
        ("actions", "chunk", 0),
    ],
)
def test_a_field_that_is_not_what_it_has_to_be_is_named(group: str, field: str, value: Any) -> None:
    card = deepcopy(CARD_DATA)
    (card[group] if group else card)[field] = value
    with pytest.raises(BundleError, match=f"{field}' must be|printable|not finite"):
        to_card(card)


def test_a_field_left_out_is_named() -> None:
    card = deepcopy(CARD_DATA)
    del card["actions"]["rate"]
    with pytest.raises(BundleError, match="'actions' lacks the field 'rate'"):
        to_card(card)


@pytest.mark.parametrize(
    ("name", "text", "words"),
    [
        ("model.yaml", "name: x", "is YAML; the model card is TOML"),
        ("model.toml", "name: x", "is not TOML"),
        ("model.toml", None, "cannot be read"),
    ],
)
def test_a_file_that_is_no_card(tmp_path: Path, name: str, text: str | None, words: str) -> None:
    if text is not None:
        (tmp_path / name).write_text(text)
    with pytest.raises(BundleError, match=words):
        read_card(tmp_path / name)


def test_all_faults_of_a_card_are_said_at_once(tmp_path: Path) -> None:
    text = template().replace('tasks = "single"', 'tasks = "some"').replace("chunk =", "chunks =")
    (tmp_path / "model.toml").write_text(text)
    with pytest.raises(BundleError, match=r"model.toml has \d+ faults") as caught:
        read_card(tmp_path / "model.toml")
    found = str(caught.value).splitlines()[1:]
    for words in (
        "'name' must be text of 1 to 80 plain characters",
        "'link' must be a https address",
        "'training.tasks' must be one of single, multi, not 'some'",
        "'actions.chunks' is no field of a model card",
        "'actions.chunk' is missing",
        "'checkpoints.Pick_Blocks_Size.sha256' must be 64 hexadecimal digits",
    ):
        assert any(words in line for line in found), words


@pytest.mark.parametrize(
    ("name", "team"),
    [
        ("pi0.5", "Us"),
        ("Pi-0.5", "Us"),
        ("π0.5", "Us"),
        ("ρι 0.5".replace("ρι", "рі"), "Us"),  # two Cyrillic letters
        ("PIO.S", "Us"),
        ("x vla", "Us"),
        ("Х-VLA", "Us"),  # the first letter is Cyrillic
        ("G0-l (official)", "Us"),
        ("RDT, published", "Us"),
        ("Ｒ\u0044Ｔ", "Us"),  # wide letters
        ("Ours", "RoboSPA paper"),
        ("Ours", "The R0bo-SPA authors"),
        ("Ours", "RoboSРА"),  # the last two letters are Cyrillic
        ("RoboSPA baseline", "Us"),
    ],
)
def test_names_of_the_paper_are_reserved(name: str, team: str) -> None:
    with pytest.raises(BundleError, match=r"is that of the paper's|has the benchmark's name in it"):
        to_card({**CARD_DATA, "name": name, "team": team})


@pytest.mark.parametrize(
    ("name", "team"),
    [("pi0.5 (our lab)", "Us"), ("RDT-2", "Us"), ("Ours", "RoboSpace Lab"), ("模型", "大学")],
)
def test_names_that_say_more_are_free(name: str, team: str) -> None:
    assert to_card({**CARD_DATA, "name": name, "team": team}).name == name


def test_folders_of_the_papers_models_are_reserved() -> None:
    for name in ("pi0-5", "pi05", "x-vla", "xvla", "go-1", "g0-1", "rdt"):
        with pytest.raises(BundleError, match="is that of the paper's"):
            check_folder(name)
    check_folder("pi0-5-our-lab")
