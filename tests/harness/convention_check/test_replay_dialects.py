"""A wrong option of a dialect is named by the replay, and with the right one the policy fits."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import standins
from replay_fakes import CHUNK, FRAMES, Learned, episode

from robospa.clients.state_encoding import poses_to_ee6d
from robospa.harness.cli.main import main
from robospa.harness.convention_check.episodes import write_episode

MADE = episode()
KNOWS = Learned(MADE)
FLIP = np.where(np.isin(np.arange(14), [1, 2, 8, 9]), -1.0, 1.0)


def stand_in(name: str) -> Any:
    """A stand-in server of the clients' tests."""
    return getattr(standins, name)


def ahead(head: Any, left: Any, right: Any) -> Any:
    """The next frames' numbers and this one's, or None if the images make no sense."""
    t = KNOWS.time({"head": head, "left_wrist": left, "right_wrist": right})
    return None if t is None else np.arange(t, min(t + CHUNK + 1, FRAMES))


def go1(seen: Any) -> Any:
    """Trained by RoboTwin's client, which has the wrists swapped."""
    rows = ahead(seen["top"], seen["right"], seen["left"])
    if rows is None:
        return np.tile(seen["state"][0], (CHUNK, 1))
    return MADE.commanded[rows[1:]] - MADE.commanded[rows[0]] + seen["state"][0]


def pi05(seen: Any) -> Any:
    """Right, but behind a configuration with adapt_to_pi on."""
    images = [
        np.moveaxis(seen["images"][n], 0, -1)
        for n in ("cam_high", "cam_left_wrist", "cam_right_wrist")
    ]
    shown, rows = FLIP * seen["state"], ahead(*images)
    if rows is None:
        return np.tile(seen["state"], (CHUNK, 1))
    return FLIP * (MADE.commanded[rows[1:]] - MADE.commanded[rows[0]] + shown)


def xvla(seen: Any) -> Any:
    """A fine-tune with the right order of quaternions."""
    rows = ahead(seen["image0"], seen["image1"], seen["image2"])
    rows = np.zeros(CHUNK, int) if rows is None else rows
    chunk = np.stack([poses_to_ee6d(MADE.ee[t], "wxyz", "interleaved") for t in rows[1:]])
    chunk[:, [9, 19]] = 1 - MADE.ee[rows[1:], :, 7]
    return chunk


def check(url: str, demo: Path, capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    with pytest.raises(SystemExit) as end:
        main(["check", url, "--trials", "0", "--load-seconds", "0", "--demo", str(demo)])
    return int(end.value.code or 0), " ".join(capsys.readouterr().out.split())


@pytest.fixture
def demo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("COLUMNS", "240")
    write_episode(tmp_path / "demo.hdf5", MADE)
    return tmp_path / "demo.hdf5"


@pytest.mark.parametrize(
    ("server", "model", "told", "option", "right"),
    [
        ("Go1", go1, "wrist images are swapped", "option wrists", "?wrists=swapped"),
        ("XVla", xvla, "its quaternions", "option quaternions", "?quaternions=wxyz"),
        ("OpenPi", pi05, "adapt_to_pi", "", None),
    ],
)
def test_the_replay_names_the_option(
    server: str,
    model: Callable[[Any], Any],
    told: str,
    option: str,
    right: str | None,
    demo: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    with stand_in(server)(model) as url:
        code, out = check(url, demo, capsys)
        assert code == 1 and told in out and option in out, out
        if right is not None:
            code, out = check(url + right, demo, capsys)
            assert code == 0 and "It fits the demonstration" in out, out
