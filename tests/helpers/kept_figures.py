"""Figures of the same values, drawn once in a process and then copied.

A set of figures costs one to three seconds, and the same values make the same bytes in all formats
(`tests/results/figures/test_figures.py` holds that), so tests of the pages around them need no new
ones, and only those that the page shows: the files that it links to for papers are empty.
"""

import hashlib
import pickle
import shutil
from collections.abc import Sequence
from pathlib import Path

import pytest

from robospa.results.figures.draw import draw
from robospa.results.figures.series import FORMATS, DrawnFigure, Series

PLACES = ("robospa.leaderboard.site.draw", "robospa.results.report.report.draw")


def keep_figures(monkeypatch: pytest.MonkeyPatch, home: Path) -> None:
    """Until the test ends, pages take what `home` holds; what is missing is drawn into it."""

    def kept(
        all_series: Sequence[Series],
        folder: Path,
        formats: Sequence[str] = FORMATS,
        beside: Sequence[Series] = (),
    ) -> list[DrawnFigure]:
        values = pickle.dumps((list(all_series), tuple(formats), list(beside)))
        drawn = home / hashlib.sha256(values).hexdigest()
        if not (drawn / "drawings").exists():
            drawn.mkdir(parents=True, exist_ok=True)
            made = draw(all_series, drawn, ("svg",), beside)
            for ending in set(formats) - {"svg"}:
                for drawing in made:
                    (drawn / f"{drawing.name}.{ending}").touch()
            (drawn / "drawings").write_bytes(pickle.dumps(made))
        for path in drawn.iterdir():
            if path.name != "drawings":
                shutil.copyfile(path, folder / path.name)
        found: list[DrawnFigure] = pickle.loads((drawn / "drawings").read_bytes())
        return found

    for place in PLACES:
        monkeypatch.setattr(place, kept)
