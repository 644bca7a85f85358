"""BLEU-4 against values computed by hand."""

from __future__ import annotations

import math
import random

import pytest
from bleu import bleu, self_bleu

CAT = ["the", "cat", "sat", "on", "the", "mat"]


def test_a_copy_scores_one() -> None:
    assert bleu(CAT, [CAT, ["dog"]]) == pytest.approx(1.0)


def test_nothing_in_common_scores_zero() -> None:
    assert bleu(CAT, [["a", "dog", "ran"]]) == 0.0


def test_one_word_exchanged_by_hand() -> None:
    # 5 of 6 words, 3 of 5 pairs, 2 of 4 triples, 1 of 3 quadruples; all but the first plus one
    words = ["the", "cat", "sat", "on", "the", "rug"]
    by_hand = (5 / 6 * (4 + 1) / (5 + 1) * (3 + 1) / (4 + 1) * (2 + 1) / (3 + 1)) ** 0.25
    assert bleu(words, [CAT]) == pytest.approx(by_hand)


def test_repetitions_are_clipped_by_hand() -> None:
    # "the" counts twice at most (it is there twice); no pair occurs
    words = ["the"] * 4
    by_hand = (2 / 4 * 1 / 4 * 1 / 3 * 1 / 2) ** 0.25
    assert bleu(words, [CAT]) == pytest.approx(by_hand * math.exp(1 - 6 / 4))


def test_short_sentences_use_the_orders_that_they_have() -> None:
    # two words, both there, and their pair; the reference nearest in length is as long
    assert bleu(["the", "cat"], [CAT, ["a", "dog"]]) == pytest.approx(1.0)
    assert bleu(["the", "cat"], [CAT]) == pytest.approx(math.exp(1 - 6 / 2))


def test_clipping_takes_the_best_reference_not_their_sum() -> None:
    assert bleu(["a", "a"], [["a", "b"], ["b", "a"]]) == pytest.approx((1 / 2 * 1 / 2) ** 0.5)


def test_self_bleu_is_the_mean_over_all_against_the_others() -> None:
    pick = random.Random(0)
    made = [[pick.choice("abcdef") for _ in range(pick.randint(1, 9))] for _ in range(12)]
    slow = sum(bleu(w, made[:i] + made[i + 1 :]) for i, w in enumerate(made)) / len(made)
    assert self_bleu(made) == pytest.approx(slow)


def test_self_bleu_of_equal_and_of_unrelated_sentences() -> None:
    assert self_bleu([CAT, CAT, CAT]) == pytest.approx(1.0)
    assert self_bleu([["a", "b"], ["c", "d"]]) == 0.0


@pytest.mark.parametrize("sentences", [[], [CAT]])
def test_a_single_sentence_is_refused(sentences: list[list[str]]) -> None:
    with pytest.raises(ValueError, match="compares"):
        self_bleu(sentences)
