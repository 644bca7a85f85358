"""Optional packages: every one has an extra, and the sentence names what pip was given."""

from __future__ import annotations

import tomllib
from importlib import metadata
from pathlib import Path

import pytest

from robospa import extras, registry
from robospa.extras import user_cache

ROOT = Path(__file__).resolve().parents[2]


class Installed:
    """A distribution whose installer left a note of where it came from."""

    def __init__(self, note: str | None) -> None:
        self._note = note

    def read_text(self, name: str) -> str | None:
        assert name == "direct_url.json"
        return self._note


@pytest.mark.parametrize(
    ("note", "expected"),
    [
        ('{"url": "file:///home/me/robospa", "dir_info": {}}', "/home/me/robospa"),
        ('{"url": "https://example.org/robospa.whl"}', "robospa"),
        (None, "robospa"),
        ("no json", "robospa"),
    ],
)
def test_a_remedy_names_where_robospa_came_from(
    note: str | None, expected: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(metadata, "distribution", lambda name: Installed(note))
    assert extras.remedy("pandas") == f"install it with: pip install '{expected}[notebook]'"


def test_every_extra_that_is_named_exists() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert set(extras.EXTRAS.values()) <= set(project["optional-dependencies"])


def test_a_package_that_is_there_but_lacks_one_of_its_own_is_not_called_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "halfway.py").write_text("import nothing_of_that_name\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ModuleNotFoundError, match="nothing_of_that_name") as found:
        extras.need("halfway")
    assert not isinstance(found.value, extras.MissingPackage)


def test_a_part_of_ours_that_lacks_an_extra_names_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(module: str) -> None:
        raise ModuleNotFoundError("No module named 'sapien'", name="sapien")

    monkeypatch.setattr(registry.importlib, "import_module", missing)
    with pytest.raises(registry.UnknownName, match=r"sapien is not installed; .*\[sim\]'"):
        registry.load("robospa.harness.sim.sapien_world:SapienWorld")
    with pytest.raises(registry.UnknownName, match="cannot load 'mine:Policy': No module named"):
        registry.load("mine:Policy")


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
