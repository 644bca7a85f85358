"""Evaluation harness for robot policies on the RoboSPA benchmark.

    import robospa

    run = robospa.evaluate("ws://127.0.0.1:8000", tasks="spatial", trials=10)
    print(run.table())

The names below are public. Each is imported when it is first used, so that a policy server needs
neither the simulator nor the statistics. The modules of this folder (`geometry`, `trial`, ...) are
what all folders share; they import nothing else of ours.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from robospa.clients import connect as connect
    from robospa.geometry import Pose as Pose
    from robospa.harness.datasets.collect import collect as collect
    from robospa.harness.running.api import evaluate as evaluate
    from robospa.harness.settings import EvaluationSettings as EvaluationSettings
    from robospa.observation import CameraSpec as CameraSpec
    from robospa.observation import Observation as Observation
    from robospa.protocol.policy import Policy as Policy
    from robospa.protocol.policy import PolicySpec as PolicySpec
    from robospa.protocol.policy import TrialInfo as TrialInfo
    from robospa.protocol.server import serve as serve
    from robospa.results.comparison.compare import compare as compare
    from robospa.results.records.trial_record import TrialRecord as TrialRecord
    from robospa.results.run import LoadedRun
    from robospa.results.run import load_run as load_run
    from robospa.tasks.catalog import build_scene as build_scene
    from robospa.tasks.scene import Scene as Scene
    from robospa.trial import TrialKey as TrialKey

    Run = LoadedRun

_HOMES = {
    "CameraSpec": "robospa.observation:CameraSpec",
    "EvaluationSettings": "robospa.harness.settings:EvaluationSettings",
    "Observation": "robospa.observation:Observation",
    "Policy": "robospa.protocol.policy:Policy",
    "PolicySpec": "robospa.protocol.policy:PolicySpec",
    "Pose": "robospa.geometry:Pose",
    "Run": "robospa.results.run:LoadedRun",
    "Scene": "robospa.tasks.scene:Scene",
    "TrialInfo": "robospa.protocol.policy:TrialInfo",
    "TrialKey": "robospa.trial:TrialKey",
    "TrialRecord": "robospa.results.records.trial_record:TrialRecord",
    "build_scene": "robospa.tasks.catalog:build_scene",
    "collect": "robospa.harness.datasets.collect:collect",
    "compare": "robospa.results.comparison.compare:compare",
    "connect": "robospa.clients:connect",
    "evaluate": "robospa.harness.running.api:evaluate",
    "load_run": "robospa.results.run:load_run",
    "serve": "robospa.protocol.server:serve",
}
"""Where each public name is defined."""

__all__ = [*_HOMES, "__version__"]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("robospa")
    if name not in _HOMES:
        raise AttributeError(f"module 'robospa' has no attribute {name!r}")
    module, _, found = _HOMES[name].partition(":")
    return getattr(import_module(module), found)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
