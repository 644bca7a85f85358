"""`robospa check` from the outside: hints about first actions, and the replay of a file."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import Done, robospa
from replay_fakes import CHUNK, Learned, episode, grippers, joints

from robospa.harness.convention_check.episodes import write_episode
from robospa.harness.convention_check.initial_actions import KEYFRAMES, hints
from robospa.protocol.server import ServerThread

MADE = episode()


@pytest.fixture
def demo(tmp_path: Path) -> Path:
    path = tmp_path / "episode.hdf5"
    write_episode(path, MADE)
    return path


def check(words: list[object], make: Any) -> Done:
    with ServerThread(policy_factory=make) as server:
        return robospa("check", server.url, "--trials", "0", "--load-seconds", "0", *words)


def test_a_wrong_one_fails_with_the_mistake_in_a_sentence_and_a_table(demo: Path) -> None:
    def make() -> Learned:
        return Learned(MADE, grippers(lambda g: 1 - g))

    code, out, _ = check(["--demo", demo, "--points", "5"], make)
    assert code == 1
    assert "It looks as if 1 is a closed gripper and 0 an open one" in out
    assert "left gripper" in out and "as it is" in out and "can be evaluated" not in out


class Begins(Learned):
    """Answers a chunk that begins near the state it is shown, in conventions of its own."""

    def infer(self, observation: Any) -> Any:
        now = np.asarray(observation["state"], float)
        chunk = np.tile(now, (CHUNK, 1)) + 0.01 * np.arange(CHUNK)[:, None]
        return self.answer(chunk, now).astype(np.float32)


FIRST = {
    "named first": (lambda c, now: c[:, [*range(7, 14), *range(7)]], "right arm first"),
    "degrees": (joints(np.degrees), "degrees"),
    "closed for open": (grippers(lambda g: 1 - g), "1 is a closed gripper"),
    "differences": (lambda c, now: c - now, "differences"),
    "differences of joints": (lambda c, now: c - now * (np.arange(14) % 7 != 6), "differences"),
    "metres": (grippers(lambda g: 0.08 * g), "openings in metres"),
    "-1..1": (grippers(lambda g: -g), "gripper numbers run from"),
    "lost": (lambda c, now: 0 * c + np.linspace(0.0, 1.0, 14), "at once"),
    "nowhere": (lambda c, now: 2.5 + 0 * c, "at once"),
}


@pytest.mark.parametrize("what", FIRST)
def test_first_actions_hint_at(what: str) -> None:
    change, told = FIRST[what]
    found, _ = hints(Begins(MADE, change))
    assert told in "; ".join(found), found


def test_first_actions_of_a_right_policy_raise_no_hint() -> None:
    found, seen = hints(Begins(MADE))
    assert found == [] and "from the state" in seen


def test_keyframes_need_not_begin_near_the_state() -> None:
    spec = replace(Begins(MADE).spec, contract=(KEYFRAMES,))
    found, _ = hints(Begins(MADE, FIRST["nowhere"][0], spec=spec))
    assert found == []


def test_a_model_that_always_closes_is_not_accused_of_inverted_grippers() -> None:
    found, _ = hints(Begins(MADE, grippers(lambda g: 0 * g)))
    assert "closed gripper" not in "; ".join(found)


def test_hints_do_not_fail_a_server() -> None:
    code, out, _ = check([], lambda: Begins(MADE, FIRST["metres"][0]))
    assert code == 0 and "openings in metres" in out
