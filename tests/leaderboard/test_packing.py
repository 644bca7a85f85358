"""Packing: what enters, what stays at home, and what is refused with its reason."""

import dataclasses
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest
from bundle_fakes import CARD, PICK, PRESS, REFERENCE, SEEDS, all_keys, make_run, unzip
from msgspec.structs import replace

from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.packing import pack
from robospa.leaderboard.submission import add
from robospa.leaderboard.verify import verify
from robospa.trial import TrialKey


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("whole")
    make_run(folder / "run")
    pack([folder / "run"], CARD, folder / "b.zip", REFERENCE)
    return folder


def test_a_packed_run_is_valid(whole: Path) -> None:
    valid = verify(whole / "b.zip", REFERENCE)
    assert valid.evidence.trials == 20
    assert valid.card == CARD
    assert sum(r.success for r in valid.run.records.values()) == 15
    assert {r.end for r in valid.run.records.values()} == {"success", "step_limit", "policy_error"}
    files = unzip(whole / "b.zip")
    assert b"secret" not in b"".join(files.values()), "addresses and command lines stay at home"
    assert "arguments" not in json.loads(files["run.json"])["about"]
    assert sum(name.startswith("videos/") for name in files) == 1


def test_the_same_run_gives_the_same_bytes(whole: Path, tmp_path: Path) -> None:
    pack([whole / "run"], CARD, tmp_path / "again.zip", REFERENCE)
    assert (tmp_path / "again.zip").read_bytes() == (whole / "b.zip").read_bytes()


def test_two_runs_of_one_model_make_one_bundle(tmp_path: Path) -> None:
    one = make_run(tmp_path / "one", all_keys((PICK,)))
    two = make_run(tmp_path / "two", all_keys((PRESS,)))
    (packed,) = pack([two, one], CARD, tmp_path / "b.zip", REFERENCE)
    assert packed.evidence.variants == 10


PAIR = "piper+franka-panda:0.6"


def of_pair(key: TrialKey) -> TrialKey:
    return dataclasses.replace(key, embodiment=PAIR)


def test_a_run_of_several_robots_makes_a_bundle_for_each(whole: Path, tmp_path: Path) -> None:
    """The second robot has lists of one of the category's two tasks only."""

    def seeds(task: str, level: int, embodiment: str, mode: str) -> Sequence[int]:
        if embodiment == PAIR and task == PRESS:
            raise LookupError(task)
        return REFERENCE.seeds(task, level, embodiment, mode)

    both = dataclasses.replace(
        REFERENCE,
        robots=("aloha-agilex", PAIR),
        seeds=seeds,
        members=lambda category: (PICK, PRESS) if category == "GAC" else (PRESS,),
    )
    keys = [*all_keys((PICK, PRESS)), *(of_pair(key) for key in all_keys())]
    run = make_run(tmp_path / "run", keys, change=setting("embodiment", ["aloha-agilex", PAIR]))
    made = pack([run], CARD, tmp_path / "mine.zip", both)
    assert [one.path.name for one in made] == [
        "mine-aloha-agilex.zip",
        "mine-piper-franka-panda-0.6.zip",
    ]
    assert [one.settings.embodiment for one in made] == [("aloha-agilex",), (PAIR,)]
    assert [one.evidence.trials for one in made] == [40, 20]
    assert {key.embodiment for key in made[1].run.records} == {PAIR}


def test_no_bundle_is_written_if_one_robot_of_several_cannot_enter(tmp_path: Path) -> None:
    both = dataclasses.replace(REFERENCE, robots=("aloha-agilex", PAIR))
    keys = [*all_keys(), *(of_pair(key) for key in all_keys()[:-1])]
    run = make_run(tmp_path / "run", keys, change=setting("embodiment", ["aloha-agilex", PAIR]))
    with pytest.raises(BundleError, match="is incomplete: 1 of its 4 listed seeds are missing"):
        pack([run], CARD, tmp_path / "mine.zip", both)
    assert [path.name for path in tmp_path.iterdir()] == ["run"]
    (tmp_path / "mine-aloha-agilex.zip").touch()
    with pytest.raises(BundleError, match=r"mine-aloha-agilex\.zip is already there"):
        pack([run], CARD, tmp_path / "mine.zip", both)


def test_practice_takes_a_few_trials_and_enters_no_leaderboard(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", [TrialKey(PICK, 1, s) for s in SEEDS[:2]])
    (packed,) = pack([run], CARD, tmp_path / "b.zip", REFERENCE, practice=True, videos=False)
    assert verify(tmp_path / "b.zip", REFERENCE, practice=True).evidence.trials == 2
    with pytest.raises(BundleError, match="enters no leaderboard"):
        add(packed, [], tmp_path / "home")
    with pytest.raises(BundleError, match="packed for practice"):
        verify(tmp_path / "b.zip", REFERENCE)


def setting(name: str, value: object) -> Callable[[dict[str, Any], dict[str, Any]], None]:
    return lambda settings, about: settings.update({name: value})


Changed = dict[str, Any]


def older(settings: Changed, about: Changed) -> None:
    about["versions"]["sapien"] = "2.0"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (setting("privileged", True), "privileged"),
        (setting("profile", True), "what axes cost"),
        (setting("step_scale", 2.0), "step limits"),
        (setting("run_seed", 7), "the run's seed, 7, was given"),
        (setting("world", {"name": "my.world:Easy"}), "another world"),
        (setting("mode", ["clean", "randomised"]), "mixes modes"),
        (lambda settings, about: about.pop("versions"), "version"),
        (older, "of sapien, which cannot be"),
        ({"skip": 1}, "1 of 20 trials have no result"),
        ({"keys": [key for key in all_keys() if key.level != 4]}, "not Pick_Blocks_Size L4"),
    ],
)
def test_runs_that_are_not_the_benchmark_are_refused(
    tmp_path: Path, change: Any, words: str
) -> None:
    run = make_run(tmp_path / "run", **(change if isinstance(change, dict) else {"change": change}))
    with pytest.raises(BundleError, match=words):
        pack([run], CARD, tmp_path / "b.zip", REFERENCE)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run"]


def test_runs_of_two_versions_are_refused(tmp_path: Path) -> None:
    one = make_run(tmp_path / "one", all_keys((PICK,)))
    two = make_run(tmp_path / "two", all_keys((PRESS,)), change=older)
    with pytest.raises(BundleError, match=r"not made alike \(versions.sapien"):
        pack([one, two], CARD, tmp_path / "b.zip", REFERENCE)


def test_linted_runs_are_refused(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run")
    path = next((run / "trials").iterdir())
    lines = path.read_text().splitlines()
    first = json.loads(lines[0])
    first |= {"wall_time": 1e-9, "latency": dict.fromkeys(first["latency"], 0.0)}
    path.write_text("\n".join([json.dumps(first), *lines[1:], ""]))
    with pytest.raises(BundleError, match="faster than physics"):
        pack([run], CARD, tmp_path / "b.zip", REFERENCE)


def test_changed_actions_are_refused(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run")
    one, two = sorted((run / "actions").iterdir())[:2]
    one.write_bytes(two.read_bytes())
    with pytest.raises(BundleError, match="stored"):
        pack([run], CARD, tmp_path / "b.zip", REFERENCE)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run"]


def test_a_bundle_that_is_there_is_replaced_only_if_that_is_asked_for(
    whole: Path, tmp_path: Path
) -> None:
    (tmp_path / "b.zip").write_text("old")
    with pytest.raises(BundleError, match="--force"):
        pack([whole / "run"], CARD, tmp_path / "b.zip", REFERENCE)
    broken = replace(CARD, actions=replace(CARD.actions, chunk=50))
    with pytest.raises(BundleError, match="chunk = 50, but the policy that did Pick_Blocks_Size"):
        pack([whole / "run"], broken, tmp_path / "b.zip", REFERENCE, replace_old=True)
    assert (tmp_path / "b.zip").read_text() == "old"
    pack([whole / "run"], CARD, tmp_path / "b.zip", REFERENCE, replace_old=True)
    assert verify(tmp_path / "b.zip", REFERENCE).evidence.trials == 20
