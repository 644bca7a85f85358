"""From settings to what the driver runs."""

import json
import time
from pathlib import Path
from typing import Any

import pytest
from command_line import printed
from msgspec import structs
from run_fakes import fake_config

import robospa
from robospa.harness.running import code_hash as module
from robospa.harness.running.code_hash import FOLDERS, LEFT_OUT, code_hash, files_of
from robospa.harness.running.manifest import about_machine, check_folder, open_run, write_manifest
from robospa.harness.running.request import client_options, make_request, run_folder
from robospa.harness.running.runner import Runner, RunOptions
from robospa.harness.settings import EvaluationSettings, SettingsError, updated
from robospa.results.records.manifest import (
    PolicySettings,
    Processor,
    RunAbout,
    RunError,
    RunSettings,
    make_manifest,
    read_manifest,
    seed_hash,
)
from robospa.results.records.runs import read_records
from robospa.trial import TrialKey

KEYS = [TrialKey("A", 1, 0)]


def settings(policy: str, **given: Any) -> EvaluationSettings:
    return updated(EvaluationSettings(), {"policy": policy, **given})


def test_a_server_gets_its_deadlines_and_its_token() -> None:
    asked = settings("ws://h:1", timeout=1, first_timeout=2, wait=3, patience=4, workers=3)
    request = make_request(asked, token="t", keys=KEYS)
    timeouts = request.config.options["timeouts"]
    assert (timeouts.infer, timeouts.first_infer, timeouts.wait) == (1.0, 2.0, 4.0)
    assert request.wait == 3.0
    assert request.config.options["token"] == "t"
    assert request.options.workers == 3


def test_the_trials_are_those_of_the_settings() -> None:
    request = make_request(settings("hold", tasks="Pick_Blocks_Size", levels=[1, 3], trials=2))
    assert {key.task for key in request.keys} == {"Pick_Blocks_Size"}
    assert [key.level for key in request.keys] == [1, 1, 3, 3]


def test_client_options_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "client.json"
    path.write_text('{"horizon": 25, "execute": 10, "names": "head:cam"}')
    assert client_options("openpi://h:1", path)["execute"] == 10


@pytest.mark.parametrize("text", ["{", "[]", '{"horizn": 5}', '{"horizon": "x"}', '{"extra": "["}'])
def test_broken_client_options_are_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "client.json"
    path.write_text(text)
    with pytest.raises(SettingsError, match=r"--client .*client\.json"):
        client_options("openpi://h:1", path)


def test_options_in_a_url_are_checked_before_the_run() -> None:
    with pytest.raises(SettingsError, match="no option 'horizn'"):
        make_request(settings("openpi://h:1?horizn=5"), keys=KEYS)


@pytest.mark.parametrize(
    ("policy", "reason"),
    [
        ((), "or else --policy-map"),
        (("ws://a", "ws://a"), "ws://a is named twice"),
        (("ws://a", "hold"), "'hold' is no URL"),
    ],
)
def test_servers_that_do_not_go_together_are_refused(policy: tuple[str, ...], reason: str) -> None:
    with pytest.raises(SettingsError, match=reason):
        make_request(EvaluationSettings(policy=policy), keys=KEYS)


def test_the_default_folder_is_named_after_the_policy() -> None:
    folder = run_folder(settings("ws://host:8000"))
    assert folder.name.startswith("host-8000-")
    assert run_folder(settings("ws://host:8000/")).name.startswith("host-8000-")
    assert run_folder(settings("ws://host:8000")) != folder, "two runs that start in one second"
    with pytest.raises(SettingsError, match="say with out which one"):
        run_folder(settings("hold"), resume=True)


@pytest.mark.parametrize("scheme", ["robotwin+tcp", "xpolicylab"])
def test_a_server_with_one_state_for_all_gets_one_worker(scheme: str) -> None:
    url = f"{scheme}://h:1"
    request = make_request(settings(url), keys=KEYS)
    assert (request.options.workers, request.options.most) == (1, 1)
    assert request.config.one_trial == {url: "h:1"}
    with pytest.raises(SettingsError, match="workers is 2, but this server keeps one state"):
        make_request(settings(url, workers=2), keys=KEYS)


@pytest.mark.parametrize(
    ("policy", "given", "most"),
    [
        ("ws://h:1", {}, 3),
        ("ws://h:1", {"workers": 8}, 3),
        ("ws://h:1", {"workers": 8, "trials_per_worker": 1}, 1),
        ("ws://h:1", {"workers": 1}, 1),
        ("ws://h:1", {"workers": 1, "trials_per_worker": 2}, 2),
        ("ws://h:1", {"world": "run_fakes:FakeWorld"}, 1),
        ("ws://h:1", {"executor": "ray"}, 1),
        ("robotwin+tcp://h:1", {}, 1),
        ("hold", {}, 1),
    ],
)
def test_how_many_trials_a_worker_holds(policy: str, given: dict[str, Any], most: int) -> None:
    assert make_request(settings(policy, **given), keys=KEYS).options.concurrent_trials == most


def test_more_trials_a_worker_than_can_be_are_refused() -> None:
    with pytest.raises(SettingsError, match="trials_per_worker is 2, but a policy without a serv"):
        make_request(settings("hold", trials_per_worker=2), keys=KEYS)


# ------- the hash of the code changes with every file that can change an outcome, and with no other


ROOT = Path(robospa.__path__[0])


def test_files_are_found_by_folder(tmp_path: Path) -> None:
    counted = ["a.py", "tasks/b.py", "tasks/in/c.toml", "harness/g.py"]
    others = ["seeds/d.json", "__pycache__/x.py", "README.md", ".e.swp", "f.py~"]
    for name in [*counted, "harness/in/h.py", *(f"tasks/{other}" for other in others)]:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name)
    assert files_of(tmp_path, ("robospa/", "tasks/", "harness/*"), LEFT_OUT) == counted
    with pytest.raises(FileNotFoundError, match="gone"):
        files_of(tmp_path, ("gone/",))


def test_the_hash_is_of_names_and_contents(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        module, "import_module", lambda name: type("M", (), {"__path__": [tmp_path]})
    )
    found = set()
    for name, text in (("a.py", "1"), ("a.py", "2"), ("b.py", "2")):
        (tmp_path / name).write_text(text)
        code_hash.cache_clear()
        found.add(code_hash(("robospa/",)))
    code_hash.cache_clear()
    assert len(found) == 3 and {len(one) for one in found} == {16}


def test_it_covers_every_module_that_scenes_goals_and_a_world_load() -> None:
    pytest.importorskip("sapien")
    code = """
import sys
import robospa.clients
import robospa.harness.sim.sapien_world
from robospa.harness.trial import task_parts
from robospa.tasks.catalog import tasks
from robospa.trial import TrialKey
of_each_family = {task.draw.__module__: name for name, task in tasks().items()}
for task in of_each_family.values():
    task_parts(TrialKey(task, 1, 100000))
for name in sorted(sys.modules):
    if name.startswith("robospa."):
        print(sys.modules[name].__file__)
"""
    loaded = {Path(line).resolve() for line in printed(code).split()}
    counted = {(ROOT / name).resolve() for name in files_of(ROOT, FOLDERS, LEFT_OUT)}
    beside = {path for path in loaded - counted if path.name != "__init__.py"}
    kept = ("results/records/", "tasks/seeds/")
    assert [p for p in beside if not any(name in p.as_posix() for name in kept)] == []


# ---------------------------------- A run is what its manifest says, and a resume must say the same


KEYS_MANIFEST = tuple(TrialKey("Pick_Fake", level, seed) for level in (1, 2) for seed in (5, 6))
SETTINGS = RunSettings(policy=PolicySettings({"name": "fake", "horizon": 4}), split=("heldout",))
RUN = ("Pick_Fake",)
"""The tasks that have a result."""
MANIFEST = make_manifest(SETTINGS, KEYS_MANIFEST, RunAbout(code="a", versions={"numpy": "2"}))


def edit(folder: Path, **changes: Any) -> None:
    path = folder / "run.json"
    path.write_text(json.dumps({**json.loads(path.read_text()), **changes}))


def test_the_manifest_survives_the_file(tmp_path: Path) -> None:
    write_manifest(tmp_path, MANIFEST)
    found = read_manifest(tmp_path)
    assert found == MANIFEST and found.keys == KEYS_MANIFEST and found.policy.horizon == 4
    text = (tmp_path / "run.json").read_text()
    assert "clock" not in text and "salt" not in text  # what has no value is left out


def test_the_seed_hash_ignores_order_and_nothing_else() -> None:
    assert seed_hash(KEYS_MANIFEST) == seed_hash(reversed(KEYS_MANIFEST))
    assert seed_hash(KEYS_MANIFEST) != seed_hash(KEYS_MANIFEST[:-1])


def test_resuming_only_counts_drivers_and_kinds_of_processors(tmp_path: Path) -> None:
    open_run(tmp_path, MANIFEST, False, ())
    two = tuple(Processor(vendor) for vendor in ("A", "B"))
    for there in (two[:1], two, two[:1]):
        about = structs.replace(MANIFEST.about, machine={"name": "another"}, processors=there)
        open_run(tmp_path, structs.replace(MANIFEST, about=about), True, RUN)
    about = structs.replace(MANIFEST.about, drivers=4, processors=two)
    assert read_manifest(tmp_path) == structs.replace(MANIFEST, about=about)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"format": 2}, "reads up to 1"),
        ({"format": "new"}, "has format new"),
        ({"about": {"code": "b", "versions": {"numpy": "2"}}}, "code: 'b' -> 'a'"),
        ({"about": {"code": "a", "versions": {"numpy": "1"}}}, r"versions.numpy: '1' -> '2'"),
        ({"about": {}}, "code"),
        ({"settings": {"split": ["heldout"]}}, r"policy\.spec\.horizon: 'unset' -> 4"),
        ({"settings": {"run_seed": 7}}, "run_seed: 7 -> 0"),
        ({"settings": [1]}, "'settings' must be a map"),
        ({"trials": []}, f"trials: {len(KEYS_MANIFEST)} new and 0 gone"),
        ({"trials": 3}, "no list of trials"),
        ({"trials": [{"task": "A"}]}, "lacks the field 'level'"),
    ],
)
def test_another_run_is_not_gone_on_with(
    tmp_path: Path, changes: dict[str, Any], words: str
) -> None:
    write_manifest(tmp_path, MANIFEST)
    edit(tmp_path, **changes)
    with pytest.raises(RunError, match=words):
        open_run(tmp_path, MANIFEST, True, RUN)


@pytest.mark.parametrize(
    "text", ["", "{", "[]", "[" * 100_000, '{"a": 1, "a": 2}', '{"trials": "\\ud800"}']
)
def test_a_manifest_that_is_none_is_named(tmp_path: Path, text: str) -> None:
    (tmp_path / "run.json").write_text(text)
    with pytest.raises(RunError, match=r"run\.json"):
        read_manifest(tmp_path)


@pytest.mark.parametrize(
    ("name", "value"),
    [("task", "../../x"), ("task", 3), ("level", "1"), ("seeds", "123"), ("seeds", [1e308])],
)
def test_names_that_would_be_paths_and_numbers_that_are_none_are_refused(
    tmp_path: Path, name: str, value: Any
) -> None:
    write_manifest(tmp_path, MANIFEST)
    rows = json.loads((tmp_path / "run.json").read_text())["trials"]
    rows[0][name] = value
    edit(tmp_path, trials=rows)
    with pytest.raises(RunError, match=rf"trials\[0\]\.{name}"):
        read_manifest(tmp_path)


def test_a_folder_that_holds_something_is_left_alone(tmp_path: Path) -> None:
    (tmp_path / "thesis.tex").touch()
    for folder, resume, words in (
        (tmp_path, False, "neither empty nor a run"),
        (tmp_path / "thesis.tex", False, "is a file"),
        (tmp_path, True, "no run"),
        (tmp_path / "none", True, "no run"),
        (tmp_path / ("n" * 300), False, "cannot be a folder: File name too long"),
    ):
        with pytest.raises(RunError, match=words):
            open_run(folder, MANIFEST, resume, ())
    open_run(tmp_path / "run", MANIFEST, False, ())
    with pytest.raises(RunError, match="--resume"):
        open_run(tmp_path / "run", MANIFEST, False, ())


def test_a_driver_killed_before_its_first_file_leaves_a_folder_to_start_in(tmp_path: Path) -> None:
    (tmp_path / ".lock").touch()
    (tmp_path / ".run.json.123.part").touch()
    check_folder(tmp_path, resume=False)


def test_the_machine_is_described() -> None:
    about = about_machine({"simulator": "fake"})
    assert about.world == {"simulator": "fake"}
    assert set(about.versions) == {"robospa", "python", "numpy", "sapien"}
    assert about.processors[0].vendor in str(about.processors[0])


def test_a_clock_that_goes_backwards_changes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = [2e9]

    def backwards() -> float:
        now[0] -= 1000.0
        return now[0]

    monkeypatch.setattr(time, "time", backwards)
    Runner(fake_config(tmp_path), KEYS_MANIFEST[:2], RunOptions()).run()
    assert set(read_records(tmp_path)) == set(KEYS_MANIFEST[:2])
