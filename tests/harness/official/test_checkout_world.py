"""A stand-in checkout as a world: its scenes, sentences, verdicts and faults."""

import ast
import io
import json
import struct
import sys
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from standin_checkout import Ringer, write_standin

from robospa.harness.official import checkout_server
from robospa.harness.official.checkout import (
    CHECKOUT,
    CheckoutOptions,
    CheckoutTracker,
    checkout_parts,
    episodes_of,
    parse_checkout,
)
from robospa.harness.official.checkout_server import packed, unpacked
from robospa.harness.official.checkout_world import (
    SECONDS,
    CheckoutFailed,
    CheckoutProcess,
    CheckoutSnapshot,
    CheckoutWorld,
    NoValidSeed,
    examine,
    numbers,
    valid_seeds,
)
from robospa.harness.official.sentences import SEEN, UNSEEN
from robospa.harness.running.request import make_request
from robospa.harness.settings import EvaluationSettings, SettingsError, updated
from robospa.harness.trial import run_trial
from robospa.harness.world import ActionError, RenderUnavailable, SceneUnstable
from robospa.observation import CameraSpec
from robospa.protocol.policy import PolicySpec
from robospa.results.records.trial_record import TrialRecord
from robospa.tasks.scene import Scene
from robospa.trial import TrialKey

pytest.importorskip("yaml", reason="a checkout needs PyYAML")
TASK = "Click_Bell_Repeat"
SPEC = PolicySpec(name="any", cameras=(CameraSpec("head"), CameraSpec("left_wrist")))


@pytest.fixture(scope="module")
def checkout(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_standin(tmp_path_factory.mktemp("standin"))


@pytest.fixture(scope="module")
def world(checkout: Path) -> Iterator[CheckoutWorld]:
    made = CheckoutWorld(str(checkout), sys.executable)
    yield made
    made.close()


def key(seed: int = 100000, level: int = 2, split: str = UNSEEN) -> TrialKey:
    return TrialKey(TASK, level, seed, split=split)


def scene(seed: int = 100000, level: int = 2, episode: int = 0) -> Scene:
    seeds = [*range(900, 900 + episode), seed]
    return checkout_parts(key(seed, level), {(TASK, level): seeds}).scene


def act(first: float) -> np.ndarray:
    action = np.zeros(14, np.float32)
    action[[6, 13]] = 1.0
    action[0] = first
    return action


def trial(world: CheckoutWorld, one: TrialKey, policy: Any, step_scale: float = 1.0) -> TrialRecord:
    return run_trial(
        world,
        policy,
        one,
        policy_seed=1,
        parts=lambda k: checkout_parts(k, episodes_of([one])),
        step_scale=step_scale,
    )


def test_a_trial_is_run_with_official_sentence_verdict_and_progress(world: CheckoutWorld) -> None:
    policy = Ringer()
    record = trial(world, key(), policy)
    assert (record.end, record.success, record.done, record.total) == ("success", True, 2, 2)
    assert (record.steps, record.category) == (3, "RPF")
    assert record.physics_steps == 50 + 50 + 1  # the checkout stops at success
    assert record.instruction == "make the golden bell sound 2 times"
    assert policy.trials[0].instruction == record.instruction
    assert [e["kind"] for e in record.events] == ["subtask_done", "subtask_done", "success"]
    assert policy.seen[0]["images"]["head"][0, 0].tolist() == [0, 100000 % 256, 0]
    trained = trial(world, key(level=1, split=SEEN), Ringer())
    assert trained.instruction in ("ring the brass bell", "ring the brass bell with the left arm")


def test_a_trial_that_fails_keeps_its_progress(world: CheckoutWorld) -> None:
    class Once(Ringer):
        def infer(self, observation: Any) -> np.ndarray:
            return act(1.0)[None]

    policy = Once()
    policy.spec = replace(policy.spec, cameras=())
    record = trial(world, key(), policy, 0.025)
    assert (record.end, record.success, record.done, record.best) == ("step_limit", False, 1, 1)
    assert record.steps == 10  # ours: the checkout's own limit of 1 does not cut it


def test_the_episode_number_is_the_seeds_place_in_the_list(world: CheckoutWorld) -> None:
    world.load(scene(episode=3))
    assert world.observe(SPEC)["images"]["left_wrist"][0, 0, 0] == 3
    keys = [key(7), key(5), key(7), key(9, level=1)]
    assert episodes_of(keys) == {(TASK, 2): (7, 5), (TASK, 1): (9,)}
    with pytest.raises(ValueError, match="none of the run's trials"):
        checkout_parts(key(8), episodes_of(keys))


@pytest.mark.parametrize("seed", [100001, 100002, 100003])
def test_a_scene_that_is_not_valid_officially_is_no_seed(world: CheckoutWorld, seed: int) -> None:
    with pytest.raises(SceneUnstable, match=f"seed {seed} is not valid in the checkout: "):
        world.load(scene(seed))
    world.load(scene())  # it goes on


def test_what_a_checkout_cannot_do_is_one_sentence(world: CheckoutWorld) -> None:
    world.load(scene())
    for action, space, sentence in (
        (act(np.nan), "joint", "14 finite numbers"),
        (np.zeros(7, np.float32), "joint", "14 finite numbers"),
        (np.zeros(14, np.float32), "delta_ee", "joint and ee actions, not delta_ee"),
    ):
        with pytest.raises(ActionError, match=sentence):
            world.step(action, space, lambda snapshot: False)
    with pytest.raises(RenderUnavailable, match="in 320x240, and the policy asks for 64x48"):
        world.render(CameraSpec("head", 64, 48))
    with pytest.raises(CheckoutFailed, match="draws no camera third"):
        world.render(CameraSpec("third"))
    with pytest.raises(RenderUnavailable, match="this policy wants more"):
        world.observe(replace(SPEC, state="measured"))
    before = world.still()
    world.step(act(0.0), "joint", lambda snapshot: False)
    with pytest.raises(RenderUnavailable, match="only the present"):
        before.render(CameraSpec("head"))
    with pytest.raises(CheckoutFailed, match="no task Lift_Fan_Repeat_1"):
        world.load(replace(scene(), task="Lift_Fan_Repeat", level=1))
    with pytest.raises(CheckoutFailed, match="cannot load: RuntimeError: no texture 7"):
        world.load(scene(100009))
    with pytest.raises(CheckoutFailed, match="has no robot piper"):
        world.load(replace(scene(), embodiment="piper"))


def test_a_process_that_dies_or_hangs_is_ended_with_one_sentence(checkout: Path) -> None:
    process = CheckoutProcess(checkout, sys.executable, {**SECONDS, "load": 1.0})
    request = {"task": "Click_Bell_Repeat_2", "episode": 0, "config": "demo_clean",
               "embodiment": ["aloha-agilex"]}  # fmt: skip
    started = time.monotonic()
    with pytest.raises(CheckoutFailed, match="did not load within 1 s and was ended"):
        process.ask("load", seed=100008, **request)
    assert time.monotonic() - started < 30
    with pytest.raises((CheckoutFailed, ValueError)):
        process.ask("load", seed=100000, **request)
    process.close()
    again = CheckoutProcess(checkout, sys.executable)
    with pytest.raises(CheckoutFailed, match=r"ended \(exit code 3\) at load"):
        again.ask("load", seed=100007, **request)
    again.close()


def test_a_checkout_that_is_none_says_what_is_wrong(tmp_path: Path, checkout: Path) -> None:
    with pytest.raises(CheckoutFailed, match="cannot be started"):
        CheckoutProcess(checkout, "/no/such/python")
    with pytest.raises(CheckoutFailed, match="has no folder envs: name the folder that holds"):
        CheckoutProcess(tmp_path, sys.executable)
    (tmp_path / "env_cfg").mkdir()
    with pytest.raises(CheckoutFailed, match="looks like RoboTwin's main branch"):
        CheckoutProcess(tmp_path, sys.executable)


def test_numbers_that_are_none_are_refused() -> None:
    assert numbers([[1, 2]], (-1, 2), "rows").tolist() == [[1.0, 2.0]]
    for value in (None, "x", [1.0], [[1.0, float("nan")]], [[1, 2, 3]]):
        with pytest.raises(CheckoutFailed, match="rows are not numbers"):
            numbers(value, (-1, 2), "rows")


def test_flags_that_fall_are_undone() -> None:
    tracker = CheckoutTracker(2)
    here = CheckoutSnapshot(0.0, {}, (0, 0), (None, None), grasp_points=None)  # type: ignore[arg-type]
    first = tracker.start(replace(here, flags=(True, False), success=True))
    assert [(e.kind, e.index) for e in first] == [("subtask_done", 0)]
    later = tracker.update(replace(here, flags=(False, True, True), success=True))
    assert [(e.kind, e.index) for e in later] == [
        ("subtask_undone", 0), ("subtask_done", 1), ("success", -1)
    ]  # fmt: skip
    assert tracker.update(replace(here, flags=(False, True), success=True)) == ()


def settings(checkout: Path, **more: object) -> EvaluationSettings:
    given = {
        "policy": ["standin_checkout:Ringer"],
        "world": f"checkout:{checkout}?python={sys.executable}",
        "tasks": TASK, "levels": "1,2", "trials": 2, "seeds": "100004,100000", **more,
    }  # fmt: skip
    return updated(EvaluationSettings(), given)


def test_a_run_in_a_checkout_has_its_world_splits_and_episodes(checkout: Path) -> None:
    made = make_request(settings(checkout))
    assert {k.split for k in made.keys} == {UNSEEN} and made.options.workers == 1
    assert made.config.world_arguments == {
        "folder": str(checkout), "python": sys.executable, "config": "", "patience": 1.0,
    }  # fmt: skip
    assert made.config.parts_arguments["episodes"][(TASK, 1)] == (100004, 100000)
    assert made.settings is not None and made.settings.selection.instructions is None
    assert parse_checkout("checkout:x?patience=2")[1] == CheckoutOptions(patience=2.0)


@pytest.mark.parametrize(
    ("more", "sentence"),
    [
        ({"seeds": None}, "robospa official checkout DIR --find"),
        ({"video": "all"}, "leave video out"),
        ({"instructions": "x"}, "leave instructions out"),
        ({"control": "fixed_rate"}, "leave control out"),
        ({"clock": "real:200ms", "action_rate": 25.0}, "leave action_rate and clock out"),
        ({"mode": "randomized:light"}, "scene modes clean and randomized"),
        ({"world": "checkout:"}, "lacks the folder"),
        ({"world": "checkout:x?gpu=1"}, "there is no option 'gpu'"),
    ],
)
def test_settings_that_a_checkout_cannot_have(
    checkout: Path, more: dict[str, object], sentence: str
) -> None:
    with pytest.raises(SettingsError, match=sentence):
        CHECKOUT.selection(settings(checkout, **more))


def test_valid_seeds_are_found_as_officially(world: CheckoutWorld) -> None:
    told: list[tuple[int, bool]] = []
    found = valid_seeds(
        world,
        key(),
        range(100000, 100007),
        3,
        lambda seed, bad: told.append((seed, not bad)),
    )
    assert found == [100000, 100004, 100005]
    assert told == [(100000 + n, n not in (1, 2, 3)) for n in range(6)]
    assert world.observe(SPEC)["images"]["head"][0, 0, 0] == 2  # the third valid one is episode 2
    with pytest.raises(NoValidSeed, match="of 2 seeds from 100001 on, 0 of"):
        valid_seeds(world, key(), range(100001, 100003), 1)


def test_the_check_shows_what_to_look_at(world: CheckoutWorld) -> None:
    found = {one.what: one for one in examine(world, key(100001))}
    assert found["scene"].seen == "Click_Bell_Repeat level 2 seed 100004: its expert solves"
    assert found["sentence"].seen == "make the golden bell sound 2 times"
    assert found["holding still"].good and found["holding still"].seen == "50 physics steps"
    assert found["camera head"].good and found["flags of subtasks"].good
    assert found["version of torch"].good is False


# ------------------------------------- the messages between a harness and the process of a checkout


def reader(data: bytes):  # type: ignore[no-untyped-def]
    stream = io.BytesIO(data)

    def read(count: int) -> bytes:
        found = stream.read(count)
        if len(found) < count:
            raise EOFError
        return found

    return read


def test_what_is_packed_is_unpacked() -> None:
    arrays = {
        "a": np.arange(6, dtype=np.uint8).reshape(1, 2, 3),
        "b": np.linspace(0, 1, 4, dtype=np.float32)[::2],
        "none": np.zeros((0, 3)),
    }
    header, found = unpacked(reader(packed({"do": "x", "n": [1, None]}, arrays)))
    assert header == {"do": "x", "n": [1, None]}
    assert list(found) == list(arrays)
    for name, array in arrays.items():
        assert found[name].dtype == array.dtype and np.array_equal(found[name], array)


def header(rows: object) -> bytes:
    text = json.dumps({"arrays": rows}).encode()
    return struct.pack(">I", len(text)) + text


@pytest.mark.parametrize(
    ("data", "sentence"),
    [
        (struct.pack(">I", 2**31), "a header of 2147483648 bytes"),
        (struct.pack(">I", 2) + b"[]", "without a list of arrays"),
        (header([["a", "object", [1]]]), "an array of 'object'"),
        (header([["a", "uint8", [-1]]]), "shape \\[-1\\]"),
        (header([["a", "uint8", [2**27, 2**27]]]), "more than 134217728 bytes"),
        (header([["a", "uint8", [2**27]], ["b", "uint8", [2]]]), "more than|"),
    ],
)
def test_a_message_that_is_none_is_refused_before_anything_is_allocated(
    data: bytes, sentence: str
) -> None:
    with pytest.raises((ValueError, EOFError), match=sentence):
        unpacked(reader(data))


def test_the_script_needs_nothing_of_ours_and_runs_on_python_3_10() -> None:
    source = Path(checkout_server.__file__).read_text()
    tree = ast.parse(source, feature_version=(3, 10))
    nodes = list(ast.walk(tree))
    names = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    names += [str(node.module) for node in nodes if isinstance(node, ast.ImportFrom)]
    imported = {name.split(".")[0] for name in names}
    assert "robospa" not in imported and "sapien" not in imported
    assert imported <= {
        "__future__", "collections", "importlib", "json", "numpy", "os", "struct", "sys",
        "traceback", "typing",
    }  # fmt: skip
