"""One bundle for all tests that forge it."""

from pathlib import Path

import pytest
from bundle_fakes import CARD, REFERENCE, Files, all_keys, make_run, unzip

from robospa.leaderboard.packing import pack


@pytest.fixture(scope="session")
def honest(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A valid bundle of two tasks."""
    folder = tmp_path_factory.mktemp("honest")
    run = make_run(folder / "run", all_keys(("Pick_Blocks_Size", "Press_Stapler_Repeat")))
    pack([run], CARD, folder / "bundle.zip", REFERENCE)
    return folder / "bundle.zip"


@pytest.fixture
def files(honest: Path) -> Files:
    """The files of the valid bundle, to be changed."""
    return unzip(honest)
