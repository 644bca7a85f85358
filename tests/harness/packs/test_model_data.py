"""The JSON of a model: scale and points, in new and old files; broken ones."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from robospa.harness.packs.archive import ArchiveError
from robospa.harness.packs.placing import LARGEST_DATA, ModelData, read_model_data

FRAME = [[1, 0, 0, 2], [0, 1, 0, 4], [0, 0, 1, 6], [0, 0, 0, 1]]


def read(folder: Path, **values: object) -> ModelData:
    path = folder / "model_data0.json"
    path.write_text(json.dumps(values))
    return read_model_data(path)


def test_points_are_scaled_with_the_model(tmp_path: Path) -> None:
    data = read(tmp_path, scale=[0.5, 0.25, 0.5], contact_points_pose=[FRAME], mass=0.2)
    assert data.point("contact 0") == (1.0, 1.0, 3.0)
    assert data.point("contact 1") is None and data.point("functional 0") is None
    assert data.mass == 0.2


@pytest.mark.parametrize("key", ["contact_points", "contact_pose"])
def test_older_names_of_points_are_known(tmp_path: Path, key: str) -> None:
    assert read(tmp_path, **{key: [FRAME]}).point("contact 0") == (2.0, 4.0, 6.0)


def test_points_of_a_link_are_moved_into_the_root(tmp_path: Path) -> None:
    data = read(tmp_path, scale=[0.5] * 3, contact_points_pose=[{"base": "door", "matrix": FRAME}])
    shifted = np.eye(4)
    shifted[:3, 3] = (10, 0, 0)
    assert data.in_root({"door": shifted}).point("contact 0") == (6.0, 2.0, 3.0)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"scale": [1, 2]}, "must give three numbers as scale"),
        ({"scale": [1, 1, "x"]}, "must give three numbers as scale"),
        ({"scale": [0, 0, 0]}, "which no model can have"),
        ({"scale": [1e9] * 3}, "which no model can have"),
        ({"extents": [1, float("nan"), 1]}, "must give three numbers as extents"),
        ({"contact_points_pose": [[1, 2]]}, "contact points that are no 4x4 frames"),
        ({"contact_points_pose": [FRAME] * 300}, "must list its contact points"),
        ({"functional_matrix": {"a": 1}}, "must list its functional points"),
        ({"functional_matrix": [[[1e300] * 4] * 4]}, "at places that no object can have"),
        ({"mass": -1}, "the mass -1, which no object can have"),
    ],
)
def test_what_makes_no_sense_is_refused(
    tmp_path: Path, values: dict[str, object], message: str
) -> None:
    with pytest.raises(ArchiveError, match=message):
        read(tmp_path, **values)


@pytest.mark.parametrize("text", ["", "[1, 2]", "{", "[" * 100_000])
def test_what_is_no_json_object_is_refused(tmp_path: Path, text: str) -> None:
    path = tmp_path / "model_data0.json"
    path.write_text(text)
    with pytest.raises(ArchiveError, match="JSON"):
        read_model_data(path)


def test_a_huge_file_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "model_data0.json"
    with path.open("wb") as file:
        file.truncate(LARGEST_DATA + 1)
    with pytest.raises(ArchiveError, match="larger than 4 MB"):
        read_model_data(path)
