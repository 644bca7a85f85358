"""Tokens counted without a tokenizer, never too many."""

from __future__ import annotations

import pytest

from robospa.clients.chunks import budget_warning, least_tokens


@pytest.mark.parametrize(
    ("text", "count"),
    [("", 2), ("pick", 3), ("pick the red, small block.", 9), ("3 blocks (left)", 7)],
)
def test_tokens_are_counted_from_below(text: str, count: int) -> None:
    assert least_tokens(text) == count


def test_a_budget_is_warned_about_only_when_it_is_broken() -> None:
    assert budget_warning(None, {"A": "word " * 500}) is None
    assert budget_warning(50, {"A": "word " * 48}) is None
    warning = budget_warning(50, {"A": "word " * 49, "B": "word", "C": "word " * 70})
    assert warning is not None
    assert "2 of 3 tasks" in warning and "C: at least 72" in warning
