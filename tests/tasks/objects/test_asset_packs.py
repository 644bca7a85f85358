"""Assets of other packages are found by name, and never change those of this one."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from robospa.tasks import objects

PACK = """
from robospa.tasks.objects.build import Asset
from robospa.tasks.shapes import ObjectModel

BALL = Asset(1, lambda look, params: ObjectModel("ball", (), (0.04,) * 3, 0.02, "ball"))
PACK = {"ball": BALL}
CLASH = {"block": BALL}
"""


@pytest.fixture(autouse=True)
def fresh() -> Iterator[None]:
    objects._packs.cache_clear()
    yield
    objects._packs.cache_clear()


def install(folder: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    (folder / "ball_pack.py").write_text(PACK)
    metadata = folder / "ball_pack-1.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Name: ball_pack\nVersion: 1\n")
    (metadata / "entry_points.txt").write_text(f"[robospa.assets]\nballs = ball_pack:{name}\n")
    monkeypatch.syspath_prepend(folder)


def test_an_asset_of_a_pack_is_found_by_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(tmp_path, monkeypatch, "PACK")
    assert objects.object_model("ball").asset == "ball"
    assert "ball" not in objects.assets()


def test_a_pack_cannot_replace_an_asset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    install(tmp_path, monkeypatch, "CLASH")
    with pytest.raises(ValueError, match=r"'balls' offers 'block'.* a name that is taken"):
        objects.object_model("ball")


def test_what_nobody_offers_is_unknown() -> None:
    with pytest.raises(KeyError, match="no asset 'bal'; "):
        objects.object_model("bal")
