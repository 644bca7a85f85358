"""The world that the tests of a module share, where they have none of their own."""

import pytest

from robospa.harness.sim.sapien_world import SapienWorld


@pytest.fixture(scope="module")
def world() -> SapienWorld:
    return SapienWorld(render=True)
