import pytest

from robospa.text import clock_text, duration_text, interval_text, listed, markdown_table, some


def test_numbers_with_their_intervals() -> None:
    assert interval_text(12, 5.649, 23.751) == "12.0 [5.6, 23.8]"
    assert interval_text(-0.001, 1, 2) == "0.0 [1.0, 2.0]"


@pytest.mark.parametrize(
    ("seconds", "duration", "clock"),
    [
        (40, "40 s", "0:40"),
        (89.4, "89 s", "1:29"),
        (719, "12 min", "11:59"),
        (11_100, "3 h 05 min", "3:05:00"),
        (3599.6, "1 h 00 min", "1:00:00"),
    ],
)
def test_durations(seconds: float, duration: str, clock: str) -> None:
    assert (duration_text(seconds), clock_text(seconds)) == (duration, clock)


def test_names() -> None:
    assert [listed(list("abc")[:n]) for n in (0, 1, 2, 3)] == ["", "a", "a and b", "a, b and c"]
    assert some(list("abc")) == "a, b, c"
    assert some(list("abcde")) == "a, b, c and 2 more"


def test_markdown() -> None:
    table = "| a | b |\n|---|---:|\n| 1 | 2 |"
    assert markdown_table(("a", "b"), [("1", "2")], ("---", "---:")) == table
