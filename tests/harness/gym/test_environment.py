"""Tasks as Gymnasium environments: trials of the runner, stepped one action at a time."""

from typing import Any

import numpy as np
import pytest
from run_fakes import FakePolicy, FakeWorld, parts

gymnasium = pytest.importorskip("gymnasium", reason="Gymnasium comes with the extra gym")

from gymnasium.utils.env_checker import check_env  # noqa: E402

import robospa.gym  # noqa: E402, F401
from robospa.harness.gym.environment import TaskEnv, env_id  # noqa: E402
from robospa.harness.settings import SettingsError  # noqa: E402
from robospa.harness.trial import run_trial  # noqa: E402
from robospa.harness.world import SceneUnstable  # noqa: E402
from robospa.protocol.policy import PolicySpec  # noqa: E402
from robospa.tasks.catalog import tasks  # noqa: E402
from robospa.trial import TrialKey  # noqa: E402

FAKE = {
    "world": "run_fakes:FakeWorld",
    "parts": "run_fakes:parts",
    "seeds": [100000, 100001, 100002, 100003],
    "cameras": ["head"],
    "size": (8, 6),
}
"""A trial of seed s is won when the first entries of its actions add up to s % 10 + 1."""
ONES = np.ones(14, np.float32)


def fake(level: int = 1, **more: Any) -> Any:
    return gymnasium.make(env_id("Pick_Blocks_Size"), level=level, **{**FAKE, **more})


def test_every_task_has_one_id() -> None:
    ids = [name for name in gymnasium.registry if name.startswith("RoboSPA/")]
    assert ids == [f"RoboSPA/{name}-v3" for name in tasks()]


@pytest.mark.filterwarnings("ignore:.*recommend using a symmetric and normalized space")
def test_the_checker_of_gymnasium_finds_nothing() -> None:
    check_env(fake().unwrapped, skip_render_check=True)


def test_the_seed_is_the_trials_and_the_digests_are_the_runners() -> None:
    env, key = fake(), TrialKey("Pick_Blocks_Size", 1, 100002)
    observation, info = env.reset(seed=100002)
    assert info["seed"] == 100002 and info["instruction"] == observation["instruction"]
    ends = []
    for _ in range(3):
        observation, reward, terminated, truncated, info = env.step(ONES)
        ends.append((reward, terminated, truncated, info["end"]))
    assert ends == [(0.0, False, False, "")] * 2 + [(1.0, True, False, "success")]
    record = run_trial(FakeWorld(), FakePolicy(), key, policy_seed=0, parts=parts)
    assert (info["digest"], info["actions_digest"]) == (record.digest, record.actions_digest)
    made = env.unwrapped.record
    assert (made.steps, made.physics_steps, made.events) == (3, 15, record.events)


def test_events_come_once_and_progress_with_them() -> None:
    env = fake()
    env.reset(seed=100003)
    kinds, done = [], []
    for _ in range(4):
        *_, info = env.step(ONES)
        kinds.append([event["kind"] for event in info["events"]])
        done.append(info["done"])
    assert kinds == [[], ["subtask_done"], [], ["success"]] and done == [0, 1, 1, 2]


def test_an_action_that_cannot_be_executed_ends_the_trial_and_says_why() -> None:
    env = fake(action="ee").unwrapped
    env.reset(seed=100003)
    _, reward, terminated, truncated, info = env.step(np.zeros(16, np.float32))
    assert (reward, terminated, truncated) == (0.0, True, False)
    assert info["end"] == "policy_error" and "quaternion" in info["message"]
    with pytest.raises(gymnasium.error.ResetNeeded, match="call reset"):
        env.step(np.zeros(16, np.float32))


def test_what_could_not_be_executed_as_sent_is_told() -> None:
    env = fake()
    env.reset(seed=100003)
    far = np.zeros(14, np.float32)
    far[1], far[6] = 50.0, 3.0
    problems = env.step(far)[4]["problems"]
    assert len(problems) == 2 and "not from 0 (closed) to 1 (open)" in problems[1]
    assert env.step(ONES)[4]["problems"] == []


def test_without_a_seed_one_is_drawn_and_the_draw_repeats() -> None:
    env = fake()
    env.reset(seed=7)
    drawn = [env.reset()[1]["seed"] for _ in range(6)]
    assert set(drawn) <= set(FAKE["seeds"]) and len(set(drawn)) > 1
    env.reset(seed=7)
    assert [env.reset()[1]["seed"] for _ in range(6)] == drawn


def test_spaces_are_those_of_the_spec() -> None:
    spec = PolicySpec("mine", cameras=(), state="none", action="delta_ee")
    env = gymnasium.make(env_id("Pick_Blocks_Size"), **{**FAKE, "spec": spec}).unwrapped
    assert sorted(env.observation_space) == ["ee", "instruction", "step"]
    assert env.action_space.shape == (16,)
    seven = TaskEnv("Pick_Blocks_Size", embodiment="franka-panda")
    assert seven.action_space.shape == (16,) and seven.observation_space["state"].shape == (16,)


@pytest.mark.parametrize(
    ("given", "reason"),
    [
        ({"level": 6}, r"has levels \[1, 2, 3, 4, 5\], not 6"),
        ({"cameras": ["top"]}, "must be one of head, .*, not 'top'"),
        ({"cameras": ["head", "head"]}, "names a camera twice"),
        ({"render_camera": "top"}, "must be one of head, .*, not 'top'"),
        ({"size": (0, 240)}, "width' must be a whole number >= 1, not 0"),
        ({"render_size": (0, 0)}, "width' must be a whole number >= 1, not 0"),
        ({"state": "measure"}, "'state' must be one of commanded, measured, none"),
        ({"split": "test"}, "split 'test' is not one of heldout"),
        ({"step_scale": 0.0}, "step_scale is 0.0, and must be more than 0"),
        ({"seeds": []}, "one or more whole numbers"),
        ({"spec": PolicySpec("x", history=(-1,))}, "gives no history"),
        ({"spec": PolicySpec("x", privileged=True)}, "gives no privileged state"),
        ({"spec": PolicySpec("x", action_dim=7)}, "joint action of aloha-agilex has 14"),
        ({"render_mode": "human"}, "not rgb_array or None"),
    ],
)
def test_what_cannot_be_is_refused(given: dict[str, Any], reason: str) -> None:
    with pytest.raises(SettingsError, match=reason):
        TaskEnv("Pick_Blocks_Size", **given)


def test_a_level_of_another_type_is_the_same_scene() -> None:
    env = fake(level=np.float64(3)).unwrapped
    assert env.key == TrialKey("Pick_Blocks_Size", 3, 0) and type(env.key.level) is int


def test_a_reset_that_fails_leaves_no_trial_to_step(monkeypatch: pytest.MonkeyPatch) -> None:
    def unstable(*_: object) -> None:
        raise SceneUnstable("it does not come to rest")

    env = fake().unwrapped
    env.reset(seed=100003)
    monkeypatch.setattr(FakeWorld, "load", unstable)
    with pytest.raises(SceneUnstable):
        env.reset(seed=100001)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(ONES)


def test_a_picture_is_drawn_on_request() -> None:
    env = fake(render_mode="rgb_array", render_size=(32, 24))
    env.reset(seed=100001)
    assert env.render().shape == (24, 32, 3)


def test_environments_in_processes_of_their_own() -> None:
    envs = gymnasium.make_vec(env_id("Pick_Blocks_Size"), 2, vectorization_mode="async", **FAKE)
    try:
        observation, info = envs.reset(seed=100000)
        assert observation["images"]["head"].shape == (2, 6, 8, 3)
        assert list(info["seed"]) == [100000, 100001]
        assert observation["instruction"] == tuple(info["instruction"])
        assert list(envs.observations["instruction"]) == list(info["instruction"])
        _, rewards, terminated, _, info = envs.step(np.stack([ONES, ONES]))
        assert list(rewards) == [1.0, 0.0] and list(terminated) == [True, False]
        assert list(info["success"]) == [True, False]
    finally:
        envs.close()


@pytest.mark.sim
def test_the_simulator_ends_as_in_a_run() -> None:
    from robospa.harness.sim.sapien_world import SapienWorld

    rng = np.random.default_rng(0)
    actions = rng.uniform(-0.2, 0.2, (3, 14)).astype(np.float32)

    class Chunks(FakePolicy):
        def infer(self, observation: object) -> Any:
            return actions

    chunks = Chunks(PolicySpec("chunks", cameras=(), horizon=3))
    key = TrialKey("Pick_Blocks_Size", 3, 100000)
    record = run_trial(SapienWorld(render=False), chunks, key, policy_seed=0, step_scale=0.02)
    env = gymnasium.make(
        "robospa.gym:RoboSPA/Pick_Blocks_Size-v3", level=3, cameras=["head"], step_scale=0.02
    )
    observation, info = env.reset(seed=100000)
    assert observation["images"]["head"].std() > 5
    while not info["end"]:
        *_, info = env.step(actions[info["steps"]])
    env.close()
    assert record.end == info["end"] == "step_limit"
    assert (info["digest"], info["actions_digest"]) == (record.digest, record.actions_digest)
