"""Level 3 in the real simulator: an honest claim is reproduced, an inflated one is caught.

Expert-checked hidden seeds, real bundles, policies behind real servers. They are not privileged and
can yet do something: they rehearse in a world of their own. `Shadow` stands for a model with some
success: the test says which trial has which id. `Thief` is the cheat that a leaderboard has to
stop: it knows the installed package, what `reset` gives and the seed of the run, which its owner
read from the run's folder.
"""

from collections.abc import Callable, Mapping
from copy import deepcopy
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bundle_fakes import CARD_DATA

from robospa.baselines.oracle import Oracle
from robospa.baselines.random import Random
from robospa.harness.running.evaluate import Request, evaluate
from robospa.harness.running.record_store import ActionRecorder, read_trace
from robospa.harness.running.request import make_request
from robospa.harness.settings import EvaluationSettings, updated
from robospa.harness.sim.sapien_world import SapienWorld
from robospa.harness.trial import policy_seed, run_trial, task_parts, trial_id
from robospa.leaderboard.audit import (
    expert_actions,
    expert_likeness,
    hidden_gap,
    rehearse,
    sentence_reaction,
)
from robospa.leaderboard.card import to_card
from robospa.leaderboard.packing import pack
from robospa.leaderboard.reproduce import (
    check_policy,
    compare,
    draw_block,
    hidden_keys,
    read_block,
    write_block,
)
from robospa.leaderboard.rules import shipped
from robospa.leaderboard.verify import Valid
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.protocol.server import ServerThread
from robospa.results.records.runs import Run, action_path, read_run
from robospa.tasks.seeds import accepted
from robospa.trial import TrialKey

pytestmark = pytest.mark.sim
TASK, LEVEL, TRIALS = "Pick_Blocks_Size", 1, 5
LIMITS = {"timeout": 60.0, "first_timeout": 60.0, "patience": 5.0}
HORIZON = 50
TOLD_SEED = "ab" * 32
"""The seed of runs whose policies were told it."""
TOLD = {"task", "embodiment", "instruction", "policy_seed", "id", "key", "extra", "joints"}


def ids(keys: list[TrialKey], salt: str = "") -> dict[str, tuple[TrialKey, str]]:
    """What only a test knows: the trial behind each id."""
    return {trial_id(key, TOLD_SEED): (key, salt) for key in keys}


class Shadow:
    """Sends what the expert does in a private world."""

    spec = PolicySpec(
        name="shadow", cameras=(), state="commanded", action="joint", horizon=HORIZON, seeded=True
    )

    def __init__(self, known: Mapping[str, tuple[TrialKey, str]] | None = None) -> None:
        self._known = known or {}
        self._world = SapienWorld(render=False)
        self._actions = np.zeros((0, 14), np.float32)

    def found(self, trial: TrialInfo) -> tuple[TrialKey, str] | None:
        """Which trial this is, with its salt; None for standing still."""
        return self._known[trial.id]

    def reset(self, trial: TrialInfo) -> None:
        recorder, found = ActionRecorder(), self.found(trial)
        if found is not None:
            key, salt = found
            parts = partial(task_parts, salt=salt)
            expert = Oracle(salt)
            run_trial(self._world, expert, key, policy_seed=0, recorder=recorder, parts=parts)
        self._actions = recorder.actions

    def infer(self, observation: Any) -> Any:
        chunk = self._actions[int(observation["step"]) :][:HORIZON]
        return chunk if len(chunk) else np.asarray(observation["state"], np.float32)[None]


class Thief(Shadow):
    """Tries every public key of the task, and takes the one whose policy seed it was given."""

    def found(self, trial: TrialInfo) -> tuple[TrialKey, str] | None:
        assert trial.key is None and vars(trial).keys() <= TOLD
        for level in range(1, 6):
            for seed in accepted(trial.task, level):
                key = TrialKey(trial.task, level, seed)
                if policy_seed(key, TOLD_SEED) == trial.policy_seed:
                    return key, ""
        return None


class Shy(Thief):
    """The same, on a detour of its own, and still where the sentence is not the scene's."""

    def found(self, trial: TrialInfo) -> tuple[TrialKey, str] | None:
        found = super().found(trial)
        return found if found and task_parts(found[0]).instruction == trial.instruction else None

    def reset(self, trial: TrialInfo) -> None:
        super().reset(trial)
        random, rows = np.random.default_rng(trial.policy_seed), list(self._actions[:1])
        for here, there in pairwise(self._actions):
            if np.abs(there - here).max() > 0.3:
                detour = (here + there) / 2 + random.normal(0, 0.12, len(here))
                detour[[6, 13]] = here[[6, 13]]
                rows.append(detour.astype(np.float32))
            rows.append(there)
        self._actions = np.array(rows) if rows else self._actions


def request(url: str, keys: list[TrialKey], out: Path, salt: str = "") -> Request:
    given = {"policy": url, "out": out, "workers": 1, "run_seed": TOLD_SEED, **LIMITS}
    return make_request(updated(EvaluationSettings(), given), keys=keys, salt=salt)


def run(folder: Path, keys: list[TrialKey], policy: Callable[[], Shadow], salt: str = "") -> Run:
    """The run of `policy`, served over the wire."""
    with ServerThread(policy_factory=policy) as server:
        evaluate(request(server.url, keys, folder, salt))
    return read_run(folder)


@pytest.fixture(scope="module")
def claimed() -> list[TrialKey]:
    return [TrialKey(TASK, LEVEL, seed) for seed in accepted(TASK, LEVEL)[:TRIALS]]


@pytest.fixture(scope="module")
def stolen(tmp_path_factory: pytest.TempPathFactory, claimed: list[TrialKey]) -> Run:
    """On public seeds a cheat that was told the run's seed knows every scene: nothing stops it."""
    return run(tmp_path_factory.mktemp("stolen") / "run", claimed, Thief)


@pytest.fixture(scope="module")
def valid(tmp_path_factory: pytest.TempPathFactory, stolen: Run) -> Valid:
    card = deepcopy(CARD_DATA)
    card["actions"]["chunk"] = HORIZON
    assert sum(r.success for r in stolen.records.values()) == TRIALS
    out = tmp_path_factory.mktemp("bundle") / "b.zip"
    (made,) = pack([stolen.folder], to_card(card), out, shipped(), practice=True, videos=False)
    return made


def test_a_claim_is_reproduced_and_a_cheat_is_caught(tmp_path: Path, valid: Valid) -> None:
    """On hidden scenes the cheat of public ones has nothing to go by, however shy it is there."""
    drawn = draw_block([(TASK, LEVEL)], TRIALS)
    write_block(drawn, tmp_path / "block.json")
    block = read_block(tmp_path / "block.json", drawn.commitment)
    keys, salt = hidden_keys(valid, block, shipped()), block.salt

    with ServerThread(policy_factory=Shadow) as server:
        check_policy(valid, request(server.url, keys, tmp_path / "x", salt))
    able = run(tmp_path / "able", keys, lambda: Shadow(ids(keys, salt)), salt)
    honest = compare(valid, able, keys, block)
    assert honest.holds and honest.overall.fresh == TRIALS

    caught = run(tmp_path / "caught", keys, Shy, salt)
    cheat = compare(valid, caught, keys, block)
    assert not cheat.holds
    assert cheat.overall.fresh == 0
    assert cheat.overall.p == pytest.approx(2 / 252)
    assert hidden_gap(valid.run, caught).suspicious and not hidden_gap(valid.run, able).suspicious


def test_the_audit_knows_the_expert_again(
    claimed: list[TrialKey], stolen: Run, tmp_path: Path
) -> None:
    """An honest baseline, which moves and fails, is not taken for one."""
    world, expert = SapienWorld(render=False), Oracle()
    rehearsed = {key: expert_actions(world, expert, key) for key in claimed[:1]}
    traces = {key: read_trace(action_path(stolen.folder, key)).actions for key in claimed[:1]}
    assert expert_likeness(traces, lambda key: rehearsed[key]).suspicious
    shy = run(tmp_path / "shy", claimed[:1], Shy)
    assert all(record.success for record in shy.records.values())
    detour = {key: read_trace(action_path(shy.folder, key)).actions for key in claimed[:1]}
    assert not expert_likeness(detour, lambda key: rehearsed[key]).suspicious, "hidden scenes do"
    walk = {key: expert_actions(world, Random(), key) for key in claimed[:1]}
    assert not expert_likeness(walk, lambda key: rehearsed[key]).suspicious


def test_the_audit_sees_who_does_not_read(claimed: list[TrialKey]) -> None:
    play = partial(rehearse, SapienWorld(render=False), Thief(), TOLD_SEED)
    found = sentence_reaction(play, claimed[:2])
    assert found.suspicious
    assert found.sentence.startswith("2 of 2 trials succeed with their own sentence and 2 with")
