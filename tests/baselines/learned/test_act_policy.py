"""Plans end where the network rests, fail once they have ended, and are made anew a few times."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from robospa.baselines.learned.act.examples import Batch
from robospa.baselines.learned.act.policy import PLANS, ActPolicy, until_rest
from robospa.baselines.learned.act.poses import WIDTH, from_poses, to_poses
from robospa.baselines.learned.act.settings import About, ActOptions
from robospa.observation import WIDTH as ENVIRONMENT_WIDTH
from robospa.protocol.conformance import synthetic_observation
from robospa.protocol.policy import TrialInfo, check_chunk, check_observation

CHUNK = 6
TURN = (0.70710678, 0.0, 0.0, 0.70710678)
HOME = np.array([(x, -0.3, 0.9, *TURN, 1.0) for x in (-0.3, 0.3)], np.float32)
ABOUT = About("act", ActOptions(chunk=CHUNK), ("block", "red"), 4, (0.0,) * WIDTH, (1.0,) * WIDTH)


def at(x: float) -> NDArray[np.float32]:
    """Arms of which the right one is `x` to the right of home, gripper closed."""
    pose = HOME.copy()
    pose[1, 0] += x
    pose[1, 7] = 0.0
    return pose


class Network:
    """Answers the same plan to everybody, and keeps what it was shown."""

    def __init__(self, *places: float) -> None:
        self.plan = from_poses(np.stack([at(x) for x in places]))
        self.seen: list[Batch] = []

    def __call__(self, batch: Batch) -> NDArray[np.float32]:
        self.seen.append(batch)
        return np.repeat(self.plan[None], len(batch.arms), axis=0)


def observation(ee: NDArray[np.float32] = HOME, sentence: str = "The RED block!") -> Any:
    spec = ActPolicy(ABOUT, Network(0.1), "x").spec
    seen = {**synthetic_observation(spec), "ee": ee, "instruction": sentence}
    return check_observation(seen, spec)


def policy(network: Network) -> ActPolicy:
    made = ActPolicy(ABOUT, network, "w")
    made.reset(TrialInfo("T", "aloha-agilex", "x"))
    return made


def test_it_says_that_it_does_not_see_and_is_privileged() -> None:
    spec = policy(Network(0.1)).spec
    assert spec.cameras == () and spec.environment_state and spec.sees_state
    assert (spec.action, spec.horizon, spec.seeded, spec.checkpoint) == (
        "ee",
        CHUNK,
        True,
        "w",
    )


def test_the_network_is_shown_arms_objects_and_known_words() -> None:
    network = Network(0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
    given = observation(sentence="the red, red cube")
    given["environment_state"] = np.arange(ENVIRONMENT_WIDTH, dtype=np.float32)
    chunk = policy(network).infer(given)
    (batch,) = network.seen
    assert np.allclose(to_poses(batch.arms)[0], HOME, atol=1e-6)
    assert np.array_equal(batch.objects.ravel(), given["environment_state"])
    assert batch.words.tolist() == [[0.0, 1.0]]
    assert check_chunk(chunk, policy(network).spec).shape == (CHUNK, 16)


def test_a_plan_ends_with_the_second_rest() -> None:
    plan = np.stack([at(x) for x in (0.1, 0.1, 0.2, 0.2, 0.2, 0.7)])
    rows, over = until_rest(HOME, plan)
    assert over and np.array_equal(rows, plan[:5])
    rows, over = until_rest(HOME, plan[:4])
    assert not over and len(rows) == 4
    rows, over = until_rest(at(0.1), plan)
    assert over and len(rows) == 2  # it begins with two


def test_a_plan_without_an_end_goes_on_from_where_it_is() -> None:
    network = Network(0.1, 0.2, 0.3, 0.4, 0.5, 0.6)
    made = policy(network)
    made.infer(observation())
    made.infer(observation(at(0.6)))
    assert np.allclose(to_poses(network.seen[1].arms)[0], at(0.6), atol=1e-6)


def test_after_a_plan_that_has_not_helped_the_arms_go_home_and_another_is_made() -> None:
    network = Network(0.1, 0.2, 0.2, 0.2, 0.2, 0.2)
    made = policy(network)
    assert len(made.infer(observation())) == 4
    back = made.infer(observation(at(0.2))).reshape(-1, 2, 8)
    assert np.allclose(back[0, :, :7], at(0.2)[:, :7]) and back[0, :, 7].tolist() == [1.0, 1.0]
    assert np.allclose(back[1], HOME) and len(network.seen) == 1
    made.infer(observation())
    assert len(network.seen) == 2


def test_after_the_last_plan_the_arms_rest_until_the_next_trial() -> None:
    network = Network(0.2, 0.2, 0.2, 0.2, 0.2, 0.2)
    made = policy(network)
    for _ in range(2 * PLANS + 3):
        last = made.infer(observation(at(0.2)))
    assert len(network.seen) == PLANS
    assert np.allclose(last.reshape(-1, 2, 8), at(0.2))
    made.reset(TrialInfo("T", "aloha-agilex", "x"))
    made.infer(observation())
    assert len(network.seen) == PLANS + 1


def test_trials_of_several_connections_are_kept_apart() -> None:
    network = Network(0.1, 0.2, 0.2, 0.2, 0.2, 0.2)
    made = ActPolicy(ABOUT, network, "")
    for session in (3, 4):
        made.reset_session(session, TrialInfo("T", "aloha-agilex", "x"))
    made.infer_batch([observation()], [3])
    mixed = made.infer_batch([observation(at(0.2)), observation()], [3, 4])
    assert [len(chunk) for chunk in mixed] == [2, 4]
    assert [len(batch.arms) for batch in network.seen] == [1, 1]


@pytest.mark.parametrize(
    ("changes", "told"), [({"width": 130}, "no multiple"), ({"steps": 0}, "at least 1")]
)
def test_options_that_cannot_be(changes: dict[str, int], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        ActOptions(**changes)
