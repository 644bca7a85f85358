"""Where caches are on every platform."""

from __future__ import annotations

from pathlib import Path

import pytest

from robospa.extras import user_cache


@pytest.mark.parametrize(
    ("platform", "variables", "expected"),
    [
        ("linux", {}, "home/.cache/robospa"),
        ("linux", {"XDG_CACHE_HOME": "/x"}, "/x/robospa"),
        ("darwin", {"XDG_CACHE_HOME": "/x"}, "home/Library/Caches/robospa"),
        ("win32", {}, "home/AppData/Local/robospa"),
        ("win32", {"LOCALAPPDATA": "/local"}, "/local/robospa"),
        ("linux", {"ROBOSPA_CACHE": "/mine", "XDG_CACHE_HOME": "/x"}, "/mine"),
    ],
)
def test_the_folder_of_caches(
    platform: str, variables: dict[str, str], expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("ROBOSPA_CACHE", "XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.delenv(name, raising=False)
    for name, value in {"HOME": "home", **variables}.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr("sys.platform", platform)
    assert user_cache() == Path(expected)
