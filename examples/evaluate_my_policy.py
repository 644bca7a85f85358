"""Evaluate a policy that is a class of this file: no server, no package, from model to table.

    python examples/evaluate_my_policy.py --tasks Pick_Blocks_Size --levels 1 --trials 5

Put your model in place of the few lines of `infer`. The policy stays in this process; robospa runs
its trials in others and asks over loopback, so a model is loaded once and nothing is pickled.
"""

from __future__ import annotations

import argparse

import numpy as np
from numpy.typing import NDArray

import robospa


class MyPolicy:
    """Moves both arms a little at every query, and opens and closes the grippers."""

    spec = robospa.PolicySpec(
        name="my-policy",
        cameras=(robospa.CameraSpec("head", 224, 224),),  # only this is rendered
        action="joint",  # left arm 6 [rad], left gripper 0..1 (1 is open), right arm 6, gripper
        horizon=25,  # at most so many actions a chunk
        checkpoint="no weights",
    )

    def reset(self, trial: robospa.TrialInfo) -> None:
        """A new trial begins."""
        self.random = np.random.default_rng(trial.policy_seed)

    def infer(self, observation: robospa.Observation) -> NDArray[np.float32]:
        """The next actions, float32 (T, 14), from pictures, joints and the sentence."""
        assert observation["images"]["head"].shape == (224, 224, 3)
        goal = observation["state"] + self.random.normal(0.0, 0.05, 14)
        goal[[6, 13]] = self.random.uniform(0.0, 1.0, 2)
        return np.linspace(observation["state"], goal, 25).astype(np.float32)


def main() -> None:
    """Evaluate, and print scores, failures and where the run is."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tasks", default="Pick_Blocks_Size")
    parser.add_argument("--levels", default="1")
    parser.add_argument("--trials", type=int, default=5)
    parser.add_argument("--workers", type=int, default=0)
    parser.add_argument("--out", default=None, help="folder of the run")
    words = parser.parse_args()
    run = robospa.evaluate(
        MyPolicy,
        tasks=words.tasks,
        levels=words.levels,
        trials=words.trials,
        workers=words.workers,
        out=words.out,
    )
    print(run.table())
    for failure in run.failures():
        print(f"{failure.task} L{failure.level} seed {failure.seed}: {failure.evidence}")
    print(f"{run.folder}: robospa report {run.folder} writes a page with every trial")


main()
