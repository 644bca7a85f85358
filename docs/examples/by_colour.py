"""A policy of the action space "skill" in twenty lines: picks what has the colour in the sentence.

cd docs/examples
robospa eval by_colour:ByColour --tasks Basic_Color_Blocks --trials 2 --out runs/by-colour
"""

from __future__ import annotations

import colorsys
import re

import numpy as np

from robospa import CameraSpec, Observation, PolicySpec, TrialInfo

HUES = {"red": 0, "orange": 28, "yellow": 52, "green": 125, "cyan": 185, "blue": 225, "purple": 280}


class ByColour:
    """Finds the pixels of a hue [degrees] and points into their middle."""

    spec = PolicySpec("by-colour", cameras=(CameraSpec("head"),), state="none", action="skill")

    def reset(self, trial: TrialInfo) -> None:
        """Remember the hue that the sentence names."""
        words = re.findall("[a-z]+", trial.instruction.lower())
        self.hue = next((hue for name, hue in HUES.items() if name in words), 0)

    def infer(self, observation: Observation) -> list[dict[str, object]]:
        """The next calls: one pick, until the goal is met or three were in vain."""
        if len(observation["calls"]) == 3:  # each has "feedback": "done" or a sentence
            return [{"skill": "done"}]
        image = observation["images"]["head"]  # uint8 (240, 320, 3)
        hsv = np.array([colorsys.rgb_to_hsv(*pixel) for pixel in image.reshape(-1, 3) / 255])
        away = np.abs((360 * hsv[:, 0] - self.hue + 180) % 360 - 180)
        own = (away < 15) & (hsv[:, 1] > 0.5) & (hsv[:, 2] > 0.2)
        rows, columns = np.nonzero(own.reshape(240, 320))
        if not len(rows):
            return [{"skill": "done"}]
        at = [(np.median(columns) + 0.5) / 320, (np.median(rows) + 0.5) / 240]
        return [{"skill": "pick", "at": at}]
