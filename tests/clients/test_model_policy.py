"""Noise belongs to rows: a batch draws what its members would draw alone."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from model_fakes import seen, trial

from robospa.clients.model_policy import (
    BLOCK,
    SAMPLES,
    ModelMissing,
    ModelPolicy,
    NotByRow,
    describe_checkpoint,
    import_code,
    seeded_rows,
)
from robospa.protocol.policy import PolicySpec


def test_rows_are_those_of_singles(torch: Any) -> None:
    with seeded_rows([5, 6]):
        together = torch.randn(2, 3)
    with seeded_rows([6]):
        alone = torch.randn(size=(1, 3))
    np.testing.assert_array_equal(together[1:], alone)


def test_later_draws_differ_and_repeat(torch: Any) -> None:
    drawn = []
    for _ in range(2):
        with seeded_rows([5]):
            drawn.append((torch.rand(1, 4), torch.rand(1, 4)))
    assert not np.array_equal(drawn[0][0], drawn[0][1])
    np.testing.assert_array_equal(drawn[0], drawn[1])


def test_one_row_may_draw_anything_repeatably(torch: Any) -> None:
    drawn = []
    for _ in range(2):
        with seeded_rows([5]):
            drawn.append(torch.randn(7))
    np.testing.assert_array_equal(*drawn)


def test_a_draw_that_belongs_to_no_row_is_refused_for_several(torch: Any) -> None:
    with pytest.raises(NotByRow), seeded_rows([5, 6]):
        torch.randn(7)
    with pytest.raises(NotByRow), seeded_rows([5, 6]):
        torch.randperm(2)


def test_a_generator_of_the_model_is_left_alone(torch: Any) -> None:
    with seeded_rows([5, 6]):
        given = torch.randn(9, generator=torch.Generator("cpu").manual_seed(3))
    assert given.shape == (9,)


class Counting(ModelPolicy):
    """Answers how often its trial was asked before."""

    spec = PolicySpec("counting", cameras=(), horizon=1)

    def predict(self, asks: Any) -> list[Any]:
        for ask in asks:
            ask.memory["n"] = ask.memory.get("n", 0) + 1
        return [np.full((1, 14), ask.memory["n"], np.float32) for ask in asks]


def test_memory_belongs_to_a_trial_of_a_session() -> None:
    policy, observation = Counting(), seen(Counting.spec)
    policy.reset_session(1, trial())
    policy.reset_session(2, trial())

    def ask(session: int) -> float:
        return float(policy.infer_batch([observation], [session])[0][0, 0])

    assert [ask(1), ask(1), ask(2)] == [1, 2, 1]
    policy.reset_session(1, trial())
    assert ask(1) == 1


def test_code_that_is_missing_is_named() -> None:
    with pytest.raises(ModelMissing, match=r"cannot import no_such_model .* with a checkout of X"):
        import_code("no_such_model", None, "a checkout of X")


def weights(folder: Path, byte: int) -> Path:
    folder.mkdir(parents=True)
    (folder / "config.json").write_text("{}")
    data = bytearray(2 * SAMPLES * BLOCK)
    data[-1] = byte
    (folder / "model.safetensors").write_bytes(data)
    return folder


def test_the_name_follows_the_weights_and_not_the_place(tmp_path: Path) -> None:
    first = describe_checkpoint(str(weights(tmp_path / "a" / "29999", 1)))
    other = describe_checkpoint(str(weights(tmp_path / "b" / "29999", 2)))
    moved = tmp_path / "c" / "29999"
    shutil.copytree(tmp_path / "a" / "29999", moved)
    assert first.startswith("29999 sample:")
    assert describe_checkpoint(str(moved)) == first != other
