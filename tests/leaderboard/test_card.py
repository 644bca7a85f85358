"""The model card: a template to fill in, every field checked."""

import json
import tomllib
from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from bundle_fakes import CARD_DATA, PICK, make_run
from msgspec import to_builtins
from site_fakes import Weaker, make_submission

from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.card import check_checkpoints, read_card, template, to_card
from robospa.leaderboard.entries import entry_of
from robospa.leaderboard.site import pairs_of, write_pairs
from robospa.leaderboard.submission import read_submissions
from robospa.leaderboard.verify import compare_scores, outcomes_of, paired, results_of, scores_of
from robospa.results.comparison.compare import compare_results
from robospa.results.records.runs import Run, read_run
from robospa.results.records.trial_record import EventRow
from robospa.results.scoring.models import ModelResults, results_of_run
from robospa.results.scoring.scores import to_json

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
        ("RD\u03a4", "Us"),  # a Greek Tau
        ("R\u0110T", "Us"),  # with a stroke
        ("Rᴅᴛ", "Us"),  # small capitals
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
    ("name", "words"),
    [
        ("\ua4e3\ua4d3\ua4d4", "LISU LETTER ZHA"),
        ("\u13a1DT", "CHEROKEE LETTER E"),
        ("pi\u0660.5", "ARABIC-INDIC DIGIT ZERO"),
        ("RDT\u3164", "invisible"),
    ],
)
def test_letters_that_nobody_tells_from_latin_ones_are_in_no_name(name: str, words: str) -> None:
    with pytest.raises(BundleError, match=words):
        to_card({**CARD_DATA, "name": name})
    for other in ("智元 GO", "Łódź net", "β-VLA"):
        to_card({**CARD_DATA, "name": other})


@pytest.mark.parametrize(
    ("name", "team"),
    [("pi0.5 (our lab)", "Us"), ("RDT-2", "Us"), ("Ours", "RoboSpace Lab"), ("模型", "大学")],
)
def test_names_that_say_more_are_free(name: str, team: str) -> None:
    assert to_card({**CARD_DATA, "name": name, "team": team}).name == name


# ----------- two submissions on equal seeds: the numbers are those of `robospa compare` on the runs


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> tuple[Run, Run]:
    folder = tmp_path_factory.mktemp("pairs")
    return (read_run(make_run(folder / "one")), read_run(make_run(folder / "two", policy=Weaker())))


def side(run: Run) -> ModelResults:
    return results_of("x", outcomes_of(run), run.manifest)


def test_the_numbers_are_those_of_comparing_the_runs(runs: tuple[Run, Run]) -> None:
    rows = paired(side(runs[0]), side(runs[1]))
    for metric in ("sr", "onta"):
        right = compare_results(*(results_of_run(run) for run in runs), metric)
        assert right.paired
        for row in (*right.cells, *right.groups):
            shown = rows[metric][row.label][str(row.level)]
            wanted = [100 * x for x in (row.estimate.value, row.estimate.low, row.estimate.high)]
            assert shown[:3] == pytest.approx(wanted, abs=0.006)
            assert shown[3:5] == [row.only_first, row.only_second]
            assert shown[5] == pytest.approx(row.q, rel=0.05)
    assert rows["sr"][PICK]["0"][3:5] == [5, 0], "one seed of four at each of five levels"
    assert "ps" not in rows


def test_scores_follow_from_outcomes_alone(runs: tuple[Run, Run]) -> None:
    """First choices and what held at the start, too, though no event is kept."""
    blank = EventRow(time=0.0, kind="wrong_object", object="", index=-1, note="", step=0)
    more = (blank, {**blank, "kind": "subtask_done", "index": 0})
    records = {
        key: replace(record, events=(*more[: key.level % 3], *record.events))
        for key, record in runs[0].records.items()
    }
    run = replace(runs[0], records=records)
    assert not compare_scores(scores_of(run), to_json(side(run).scores))
    rate = side(run).scores.categories["GAC", 0].values
    assert rate["sr"].value > rate["sr1"].value == pytest.approx(0.15)


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [
        ("success", "01", "not of 4 trials"),
        ("success", "01x1", "must be text of 0, 1 and 2"),
        ("done", "9999", "more is done than"),
        ("total", 99, "must be a whole number <= 35, not 99"),
        ("more", 1, "unknown field 'more'"),
    ],
)
def test_outcomes_that_cannot_be_are_refused(
    runs: tuple[Run, Run], field: str, value: object, words: str
) -> None:
    outcomes = to_builtins(outcomes_of(runs[0]))
    outcomes[f"{PICK}/1"][field] = value
    with pytest.raises(BundleError, match=words):
        results_of("x", outcomes, runs[0].manifest)
    del outcomes[f"{PICK}/1"]
    with pytest.raises(BundleError, match="other variants"):
        results_of("x", outcomes, runs[0].manifest)


def test_pairs_are_written_only_of_what_was_measured_alike(tmp_path: Path) -> None:
    home = tmp_path / "home"
    for number in (1, 2):
        make_submission(tmp_path / f"m{number}", home, name=f"Fake {number}")
    entries = [entry_of(found) for found in read_submissions(home)]
    (tmp_path / "pairs" / "gone").mkdir(parents=True)
    (tmp_path / "pairs" / "gone" / "x.js").write_text("")
    write_pairs(pairs_of(entries), tmp_path, str)
    call = (tmp_path / "pairs" / "fake-1" / "fake-2.js").read_text()
    rows = json.loads(call.removeprefix('pairLoaded("fake-1/fake-2", ').removesuffix(");\n"))
    assert rows["sr"]["GAC"]["0"][:1] == [0]
    assert not (tmp_path / "pairs" / "gone").exists()
