"""The 3-D scene in the browser: what stands where, and the server's start and end."""

from __future__ import annotations

import time
import urllib.request
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from test_playback import played

from robospa.geometry import Pose
from robospa.harness.viewer.playback import DrawnBody, DrawnMesh

HAS_VISER = bool(pytest.importorskip("importlib.util").find_spec("viser"))
needs_viser = pytest.mark.skipif(not HAS_VISER, reason="needs viser, of the extra `view`")

CORNERS = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0.2]], np.float32)
MESH = DrawnMesh(CORNERS, np.array([[0, 1, 2]], np.uint32), np.array([255, 0, 0], np.uint8))
BODIES = [
    DrawnBody("table", (MESH,), Pose((0.0, 0.0, 0.7))),
    DrawnBody("object_0", (MESH,)),
    DrawnBody("object_1", (MESH,)),
]


class Node:
    """A thing in a scene that only remembers what was set."""

    def __init__(self, name: str, **given: Any) -> None:
        self.name, self.visible, self.given = name, True, given
        self.position: tuple[float, ...] = (0.0, 0.0, 0.0)
        self.wxyz: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)


class FakeScene:
    """Stands for viser's scene."""

    def __init__(self) -> None:
        self.nodes: dict[str, Node] = {}

    def __getattr__(self, name: str) -> Callable[..., Node]:
        def add(path: str = "", *more: Any, **given: Any) -> Node:
            node = Node(path, more=more, **given)
            if name.startswith("add_"):
                self.nodes[path] = node
            return node

        return add


def test_bodies_move_names_stand_above_them_and_wanted_ones_are_marked() -> None:
    from robospa.harness.viewer.server import Scene3D

    fake = FakeScene()
    scene = Scene3D(fake, played(), BODIES)
    assert fake.nodes["/0"].position == (0.0, 0.0, 0.7)
    assert fake.nodes["/1/name"].given["more"] == ("the red block",)
    assert "/0/name" not in fake.nodes
    assert fake.nodes["/1/name"].given["position"][2] > 0.2
    assert scene.show(0.1) == 2
    assert fake.nodes["/1"].position == (0.0, 0.0, 0.1)
    assert not fake.nodes["/1/wanted"].visible, "its subtask is done"
    assert not fake.nodes["/2"].visible, "it does not exist yet"
    assert fake.nodes["/2/wanted"].visible
    scene.name_objects(False)
    assert not fake.nodes["/1/name"].visible


@needs_viser
def test_it_is_served_on_this_machine_plays_and_ends() -> None:
    from robospa.harness.viewer.server import play, serving

    with serving(played(), BODIES) as (address, advance):
        assert address.startswith("http://127.0.0.1:")
        with urllib.request.urlopen(address, timeout=10) as answer:
            assert b"<html" in answer.read(2000)
        port = int(address.rpartition(":")[2])
        with pytest.raises(OSError, match="in use"), serving(played(), BODIES, port):
            raise AssertionError("two servers on one port")
        play(advance, time.monotonic() + 0.1)
    with pytest.raises(OSError):
        urllib.request.urlopen(address, timeout=2)


@needs_viser
def test_a_page_for_itself_holds_the_scene() -> None:
    from robospa.harness.viewer.server import as_html

    assert "<html" in as_html(played(), BODIES)[:2000]
