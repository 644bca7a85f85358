"""Scenes made of a pack's objects; packs and assets of other packages, which replace none here."""

from collections.abc import Iterator
from pathlib import Path

import pytest
from installed import installed

from robospa.registry import UnknownName
from robospa.tasks import objects, packs
from robospa.tasks.catalog import build_scene
from robospa.tasks.objects import object_model
from robospa.tasks.packs import with_pack
from robospa.tasks.scene import Scene


@pytest.fixture(autouse=True)
def fresh() -> Iterator[None]:
    for clear in (packs.pack.cache_clear, objects._packs.cache_clear):
        clear()
    yield
    for clear in (packs.pack.cache_clear, objects._packs.cache_clear):
        clear()


@pytest.fixture
def scene() -> Scene:
    return build_scene("Click_Can_Place_Items", 5, 100_000)


BIG_CANS = """
from dataclasses import replace
from robospa.tasks.objects import object_model

class BigCans:
    name = "big"
    def has(self, asset, params):
        return asset == "can"
    def model(self, asset, params):
        return replace(object_model(asset, params), mass=7.0)
    def digest(self):
        return "big"
"""


def test_a_pack_of_another_package_is_found_by_name(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "big_cans.py").write_text(BIG_CANS)
    installed(tmp_path, {"robospa.packs": {"big": "big_cans:BigCans"}})
    monkeypatch.syspath_prepend(tmp_path)
    big = with_pack(scene, "big")
    named = {item.asset for item in big.objects if "pack" in item.params}
    assert named == {"can"}
    can = next(item for item in big.objects if item.asset == "can")
    assert object_model(can.asset, can.params).mass == 7.0
    assert big.digest != scene.digest
    assert Scene.from_json(big.to_json()) == big


def test_an_unknown_pack_is_named_with_those_there_are(scene: Scene) -> None:
    with pytest.raises(UnknownName, match="no asset pack 'offical'; did you mean official"):
        with_pack(scene, "offical")


BALLS = """
from robospa.tasks.objects.build import Asset
from robospa.tasks.shapes import ObjectModel

BALL = Asset(1, lambda look, params: ObjectModel("ball", (), (0.04,) * 3, 0.02, "ball"))
PACK, CLASH = {"ball": BALL}, {"block": BALL}
"""


@pytest.mark.parametrize("offered", ["PACK", "CLASH"])
def test_an_asset_of_another_package_is_found_and_replaces_none(
    offered: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "ball_pack.py").write_text(BALLS)
    installed(tmp_path, {"robospa.assets": {"balls": f"ball_pack:{offered}"}})
    monkeypatch.syspath_prepend(tmp_path)
    if offered == "CLASH":
        with pytest.raises(ValueError, match=r"'balls' offers 'block'.* a name that is taken"):
            object_model("ball")
    else:
        assert object_model("ball").asset == "ball" and "ball" not in objects.assets()
