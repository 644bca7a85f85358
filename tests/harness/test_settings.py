"""One definition of an evaluation's settings: as flags, as a file, as keywords."""

import ast
import inspect
import json
from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path

import pytest
import typer
from hypothesis import given
from hypothesis import settings as examples
from hypothesis import strategies as st

from robospa.harness.cli.eval import evaluate
from robospa.harness.running.heartbeat import HEARTBEAT_SECONDS
from robospa.harness.seeds.lists import save
from robospa.harness.selection import (
    list_trials,
    parse_levels,
    parse_numbers,
    parse_seeds,
    parse_tasks,
)
from robospa.harness.settings import (
    GROUPS,
    LEAST_STUCK_SECONDS,
    EvaluationSettings,
    Selection,
    SettingsError,
    flat,
    group_of,
    read_settings,
    to_toml,
    updated,
)
from robospa.tasks import catalog
from robospa.tasks.seeds import ListKey
from robospa.tasks.task import Task

DEFAULTS = EvaluationSettings()
OWN = {"more", "config", "auto_resume", "resume", "token", "latency", "as_json", "help_all"}
"""Flags of `robospa eval` that are no settings."""


def write(folder: Path, text: str, name: str = "run.toml") -> Path:
    path = folder / name
    path.write_text(text)
    return path


def test_a_settings_name_is_unique_and_has_help() -> None:
    named = [f for kind in (EvaluationSettings, *GROUPS.values()) for f in fields(kind)]
    names = [f.name for f in named if f.name not in GROUPS]
    assert len(names) == len(set(names)) == len(group_of()) == len(flat(DEFAULTS))
    assert all(f.metadata["help"] for f in named if f.name not in GROUPS)


def test_every_setting_is_a_flag_with_its_default() -> None:
    app = typer.Typer(add_completion=False)
    app.command()(evaluate)
    flags = {p.name: p for p in typer.main.get_command(app).params}
    assert set(group_of()) < set(flags)
    for name, value in flat(DEFAULTS).items():
        if name != "policy":
            assert flags[name].default == value
            assert flags[name].opts[0] == "--" + name.replace("_", "-")
    assert set(flags) - set(group_of()) == OWN


def test_several_splits_are_a_list_whose_entries_are_checked() -> None:
    for splits in ("heldout,train", ["heldout", "train"]):
        assert updated(DEFAULTS, {"split": splits}).selection.split == "heldout,train"
    with pytest.raises(SettingsError, match="split 'test' is not one of heldout, train"):
        updated(DEFAULTS, {"split": "heldout,test"})


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    changed = updated(
        DEFAULTS,
        {
            "policy": ["ws://a:1", "ws://b:2"],
            "out": tmp_path,
            "tasks": ["GAC", "RPF"],
            "levels": [1, 3],
            "seeds": 'odd "name"\n\x7f.json',
            "backoff": 1e-05,
            "patience": 600000.0,
            "gpus_per_worker": 0.1,
            "client": "client.json",
            "world": "a:b",
        },
    )
    assert changed.selection.tasks == "GAC,RPF" and changed.selection.levels == "1,3"
    for settings in (changed, DEFAULTS):
        assert read_settings(write(tmp_path, to_toml(settings))) == settings


NUMBERS = [name for name, value in flat(DEFAULTS).items() if type(value) in (int, float)]


@pytest.mark.parametrize("name", NUMBERS)
@pytest.mark.parametrize("value", [float("nan"), float("inf"), -5, 10**18])
def test_no_number_is_without_bounds(tmp_path: Path, name: str, value: float) -> None:
    """In a file, as a flag or keyword, and of a group that is made by itself."""
    with pytest.raises(SettingsError, match=name):
        updated(DEFAULTS, {name: value})
    kind = GROUPS[group_of()[name]]
    with pytest.raises(
        SettingsError, match=f"{name} is .*, and must be (at least|more than) .* and at most"
    ):
        kind(**{name: value})


@examples(max_examples=30, deadline=None)
@given(st.text())
def test_any_text_survives_the_file(tmp_path_factory: pytest.TempPathFactory, text: str) -> None:
    settings = updated(DEFAULTS, {"tasks": text.encode(errors="ignore").decode()})
    path = write(tmp_path_factory.getbasetemp(), to_toml(settings))
    assert read_settings(path) == settings


def test_json_has_the_same_form(tmp_path: Path) -> None:
    text = json.dumps({"policy": "ws://a:1", "selection": {"levels": [1, 3], "trials": 5}})
    found = read_settings(write(tmp_path, text, "run.json"))
    assert found.policy == ("ws://a:1",)
    assert found.selection == Selection(levels="1,3", trials=5)
    assert found.retries == DEFAULTS.retries


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("trials = 3", r"no setting 'trials'; did you mean trials of \[selection\]\?"),
        ("[selection]\ntrails = 3", r"\[selection\] has no setting 'trails'; did you mean trials"),
        ("[conection]\nwait = 3", r"no setting 'conection'; did you mean \[connection\]\?"),
        ("[recording]\nattempts = 3", r"did you mean attempts of \[retries\]\?"),
        ("selection = 3", r"write a table \[selection\]"),
        ("[compute]\nworkers = 'many'", "workers='many' is not a whole number"),
        ("[compute]\nworkers = -1", "workers is -1, and must be at least 0"),
        ("[compute]\naddress = 'auto'", "address goes with executor ray"),
        ("[recording]\nvideo = 'some'", "not one of none, failures, first, all"),
        (
            "[recording]\nvideo_cameras = 'head,top'",
            r"video_cameras \['top'\] are none of head, left_",
        ),
        ("token = 'secret'", "a token does not belong in a file"),
        ("[connection]\ntoken = 'secret'", "a token does not belong in a file"),
        ("a = [", "it is no TOML"),
    ],
)
def test_a_wrong_file_is_named_in_one_sentence(tmp_path: Path, text: str, reason: str) -> None:
    with pytest.raises(SettingsError, match=rf"run\.toml: .*{reason}") as error:
        read_settings(write(tmp_path, text))
    assert "\n" not in str(error.value) and "secret" not in str(error.value)
    with pytest.raises(SettingsError, match=r"none\.toml: it cannot be read \(No such file"):
        read_settings(tmp_path / "none.toml")


@pytest.mark.parametrize(
    "wrong",
    [{"executor": "slurm"}, {"control": "free"}, {"split": "test"}, {"log": "tensorboard"}],
)
def test_values_that_are_no_choice_are_refused(wrong: dict[str, str]) -> None:
    with pytest.raises(SettingsError, match=next(iter(wrong))):
        updated(DEFAULTS, wrong)


def test_a_worker_that_gets_on_is_not_taken_for_stuck() -> None:
    assert LEAST_STUCK_SECONDS >= 3 * HEARTBEAT_SECONDS


def test_functions_of_the_command_line_stay_short() -> None:
    """Commands are thin: what is longer than this belongs in a module that needs no terminal."""
    folder = Path(inspect.getfile(evaluate)).parent
    lengths = {
        f"{path.name}:{node.name}": (node.end_lineno or 0) - node.body[0].lineno
        for path in folder.glob("*.py")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.FunctionDef)
    }
    assert {name: length for name, length in lengths.items() if length > 60} == {}


# ------------ what users write for tasks, levels and seeds, and what they are told when it is wrong


def test_tasks_by_category_dimension_and_name() -> None:
    names = parse_tasks("all")
    assert len(names) == len(set(names)) >= 10
    assert names[0] == "Pick_Blocks_Size", "the paper's order"
    assert "Pick_Blocks_Size" in parse_tasks("gac")
    assert set(parse_tasks("spatial")) | set(parse_tasks("procedural")) == set(parse_tasks("all"))
    assert parse_tasks("pick blocks size, GAC")[0] == "Pick_Blocks_Size"
    assert parse_tasks("Pick_Blocks_Size,Pick_Blocks_Size") == ["Pick_Blocks_Size"]


def test_basic_grounding_is_no_part_of_all(monkeypatch: pytest.MonkeyPatch) -> None:
    def fake(name: str, category: str) -> Task:
        return replace(catalog.task("Pick_Blocks_Size"), name=name, category=category)

    sets = ("CBG", "EPG", "SOI")
    made = [fake("Base", "GAC"), *(fake(f"{c}_{i}", c) for c in sets for i in range(5))]
    monkeypatch.setattr(catalog, "tasks", lambda: {t.name: t for t in made})
    assert parse_tasks("all") == ["Base"]
    assert parse_tasks("basic") == [t.name for t in made[1:]]
    assert parse_tasks("epg") == [f"EPG_{i}" for i in range(5)]
    assert len(parse_tasks("all,basic")) == 16


def test_levels_and_numbers_which_keep_their_order_and_lose_repetitions() -> None:
    assert parse_levels("1,3-5") == parse_levels("L1,L3-L5") == [1, 3, 4, 5]
    assert parse_numbers("5,3-4,5", "seeds") == [5, 3, 4]
    with pytest.raises(SettingsError, match="is more than"):
        parse_numbers(str(10**23), "seeds")
    many = [*range(100000, 100200, 2)]  # longer than a file's name may be
    assert parse_seeds(",".join(map(str, many)))("A", 1) == many


LEVELS = ("0", "6", "", "2-1", "1-", "-1", "a", "1,,2", "1-99999999")
TASKS = ("", "Pick_Nothing_At_All", "XYZ")


@pytest.mark.parametrize(
    ("parse", "text"), [*((parse_levels, t) for t in LEVELS), *((parse_tasks, t) for t in TASKS)]
)
def test_levels_and_tasks_that_do_not_exist_are_refused(
    parse: Callable[[str], object], text: str
) -> None:
    with pytest.raises(SettingsError):
        parse(text)


@pytest.mark.parametrize("text", ["{", '{"A": {"1": [1.5]}}', '{"A": {"1": [-1]}}', "{}"])
def test_bad_seed_files_are_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "seeds.json"
    path.write_text(text)
    with pytest.raises(SettingsError, match=r"seeds\.json"):
        parse_seeds(str(path))("A", 1)


def test_a_folder_of_lists_is_read_as_it_was_written(tmp_path: Path) -> None:
    save(tmp_path / ListKey("Pick_Blocks_Size", 2, "piper", "clean").file, 2, [100000, 100002])
    there, elsewhere = (parse_seeds(str(tmp_path), robot) for robot in ("piper", "ur5-wsg"))
    assert there("Pick_Blocks_Size", 2) == (100000, 100002)
    for read, level in ((there, 3), (elsewhere, 2)):
        with pytest.raises(SettingsError, match="has no list of seeds"):
            read("Pick_Blocks_Size", level)


def test_the_first_seeds_of_every_variant() -> None:
    tasks = "Pick_Blocks_Size,Press_Stapler_Repeat"
    keys = list_trials(Selection(tasks, "1,2", 2, "7-9", "train"))
    assert [(k.task, k.level, k.seed) for k in keys][:3] == [
        ("Pick_Blocks_Size", 1, 7), ("Pick_Blocks_Size", 1, 8), ("Pick_Blocks_Size", 2, 7)
    ]  # fmt: skip
    assert len(keys) == 8
    assert len(list_trials(Selection(tasks, "1,2", seeds="7-9"))) == 12
    assert {(k.embodiment, k.mode, k.split) for k in keys} == {("aloha-agilex", "clean", "train")}


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        (Selection(embodiment="nao"), r"no embodiment 'nao'; known are .*aloha-agilex"),
        (Selection(embodiment="aloha_agilex"), r"did you mean aloha-agilex\?"),
        (Selection(mode="cleen"), r"no scene mode 'cleen'; did you mean clean\?"),
        (
            Selection("Pick_Blocks_Size", "1", 4, "7-9,7"),
            "Pick_Blocks_Size level 1 has 3 seeds, not 4",
        ),
    ],
)
def test_what_is_not_installed_and_a_variant_with_too_few_seeds_are_refused(
    wrong: Selection, sentence: str
) -> None:
    with pytest.raises(SettingsError, match=sentence):
        list_trials(wrong)
