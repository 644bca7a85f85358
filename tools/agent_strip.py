"""A trial of an agent as a film strip: what it saw, its calls, and what came of them.

`python tools/agent_strip.py FOLDER/TRIAL.jsonl OUT.png` draws what `robospa serve agent --option
log=FOLDER` has noted down. Points are marked in the picture that they refer to.
"""

from __future__ import annotations

import json
import sys
import textwrap
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot
from matplotlib.axes import Axes

WIDTH, LETTERS = 3.4, 44
"""Of a picture [inches], and how many letters of text fit below it."""


def draw(axes: Axes, path: Path, line: dict[str, object], feedback: dict[int, str]) -> None:
    """A picture, the calls that were made at it, and their `feedback` by number."""
    first = int(str(line["calls"]))
    picture = pyplot.imread(path.parent / f"{path.stem}-{first}-head.png")
    height, width = picture.shape[:2]
    axes.imshow(picture)
    axes.set_axis_off()
    text = str(line["answer"])
    calls = json.loads(text[text.rindex('{"note"') :])["calls"]
    rows = []
    for number, call in enumerate(calls):
        for name in {"at", "to"} & call.keys():
            u, v = call[name]
            axes.plot(u * width, v * height, "o", ms=9, mew=3, mec="black", mfc="none")
            axes.plot(u * width, v * height, "o", ms=9, mew=1.5, mec="white", mfc="none")
            side, away = ("left", 16) if number % 2 and u < 0.8 else ("right", -16)
            name = f"{first + number + 1} {call['skill']}"
            axes.text(u * width + away, v * height, name, ha=side, weight="bold", fontsize=8)
        said = ", ".join(f"{key} {value}" for key, value in call.items() if key != "skill")
        came = feedback.get(first + number, "the trial ends")
        rows += textwrap.wrap(f"{first + number + 1}. {call['skill']} {said}: {came}", LETTERS)
    axes.text(0, 1.03 * height, "\n".join(rows), va="top", fontsize=8, family="monospace")


def main(source: str, out: str) -> None:
    """Draw the trial noted down in `source` as the picture `out`."""
    path = Path(source)
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    lines = [line for line in lines if not line["error"]]  # those whose answers were used
    if not lines:
        sys.exit(f"{source} notes down no answer that was used: draw another trial")
    texts = "\n".join(map(str, lines[-1]["question"]))
    known = [row.partition(". ")[2] for row in texts.splitlines() if row[:1].isdigit()]
    feedback = {n: str(json.loads(row)["feedback"]) for n, row in enumerate(known)}
    figure, grid = pyplot.subplots(1, len(lines), figsize=(WIDTH * len(lines), 0.92 * WIDTH))
    for axes, line in zip([grid] if len(lines) == 1 else grid, lines, strict=True):
        draw(axes, path, line, feedback)
    figure.suptitle(str(lines[0]["question"][0]), x=0.01, ha="left", fontsize=10)
    figure.subplots_adjust(0.01, 0.13, 0.99, 0.93, 0.03)
    figure.savefig(out, dpi=110)


if __name__ == "__main__":
    if len(sys.argv) != 3 or not Path(sys.argv[1]).is_file():
        sys.exit("name a trial that was noted down, and a picture: FOLDER/TRIAL.jsonl OUT.png")
    main(*sys.argv[1:])
