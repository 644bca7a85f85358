"""The JSON of a model: scale and points, in new and old files; broken ones."""

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
    ("data", "keyword"),
    [
        ({"scale": [1, 2]}, "scale"),
        ({"scale": [1, 1, "x"]}, "scale"),
        ({"scale": [float("nan")] * 3}, "scale"),
        ({"scale": [10**400] * 3}, "out of range"),
        ({"scale": [0, 0, 0]}, "no model can have"),
        ({"scale": [1e9] * 3}, "no model can have"),
        ({"extents": [1, float("nan"), 1]}, "extents"),
        ({"contact_points_pose": [[1, 2]]}, "contact"),
        ({"contact_points_pose": [FRAME] * 300}, "contact"),
        ({"contact_points_pose": [[[10**400] * 4] * 4]}, "contact"),
        ({"contact_points_pose": [[[float("inf")] * 4] * 4]}, "no object can have"),
        ({"functional_matrix": {"a": 1}}, "functional"),
        ({"functional_matrix": [[[1e300] * 4] * 4]}, "no object can have"),
        ({"mass": -1}, "mass"),
        ({"mass": True}, "mass"),
        ("", "JSON"),
        ("[1, 2]", "map"),
        ("[" * 100_000, "JSON"),
        (" " * (LARGEST_DATA + 1), "larger than 4 MB"),
    ],
)
def test_what_makes_no_sense_is_refused(
    tmp_path: Path, data: str | dict[str, object], keyword: str
) -> None:
    path = tmp_path / "model_data0.json"
    path.write_text(data if isinstance(data, str) else json.dumps(data))
    with pytest.raises(ArchiveError, match=keyword) as refused:
        read_model_data(path)
    assert len(str(refused.value)) < 300 and "model_data0.json" in str(refused.value)
