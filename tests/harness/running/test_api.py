"""`robospa.evaluate`: every kind of policy that it takes, in a fake world and in the real one."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from run_fakes import FAKES, FakePolicy

import robospa
from robospa.harness.settings import FILE, SettingsError
from robospa.protocol.server import ServerThread
from robospa.results.lint import lint_run
from robospa.results.records.runs import Run

pytestmark = pytest.mark.usefixtures("world_asked_here")

FOUR = {"tasks": "Pick_Blocks_Size", "levels": [1, 2], "seeds": "100000-100001", "trials": 2}
RUN: dict[str, Any] = {**FAKES, **FOUR}


class Batched(FakePolicy):
    """One object for all connections."""

    def infer_batch(
        self, observations: Sequence[Mapping[str, Any]], sessions: Sequence[int]
    ) -> list[NDArray[np.float32]]:
        return [np.ones((2, 14), np.float32) for _ in observations]


def check(run: Run, folder: Path) -> None:
    assert len(run.records) == 4 and not run.missing
    assert all(record.success for record in run.records.values())
    assert robospa.load_run(str(folder)).records == run.records


def test_a_server(tmp_path: Path) -> None:
    with ServerThread(policy_factory=FakePolicy, token="secret") as server:
        run = robospa.evaluate(server.url, token="secret", workers=2, out=tmp_path, **RUN)
    check(run, tmp_path)
    assert "secret" not in (tmp_path / FILE).read_text() + (tmp_path / "run.json").read_text()


def test_several_servers(tmp_path: Path) -> None:
    with ServerThread(policy_factory=FakePolicy) as a, ServerThread(policy_factory=FakePolicy) as b:
        run = robospa.evaluate([a.url, b.url], workers=2, out=tmp_path, **RUN)
    check(run, tmp_path)
    assert run.manifest.about.arguments["policy"] == [a.url, b.url]


def test_a_map_of_policies_in_place_of_those_of_a_file(tmp_path: Path) -> None:
    (tmp_path / "map.json").write_text('{"Pick_Blocks_Size": "run_fakes:FakePolicy"}')
    (tmp_path / "run.toml").write_text('policy = ["ws://nobody:1"]')
    places = {"config": tmp_path / "run.toml", "policy_map": tmp_path / "map.json"}
    check(robospa.evaluate(out=tmp_path / "run", workers=1, **places, **RUN), tmp_path / "run")


@pytest.mark.parametrize("policy", [FakePolicy, lambda: FakePolicy(), Batched()])
def test_what_serves_several_workers(policy: Any, tmp_path: Path) -> None:
    check(robospa.evaluate(policy, workers=2, out=tmp_path, **RUN), tmp_path)


def test_an_object_serves_one_worker_and_stays_in_this_process(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    policy = FakePolicy()
    run = robospa.evaluate(policy, out=tmp_path, **RUN)
    check(run, tmp_path)
    assert policy.trial is not None and policy.trial.task == "Pick_Blocks_Size"
    said = " ".join(capfd.readouterr())
    assert "checkpoint" not in said, "the address that it is served at for now is nobody's server"
    assert run.manifest.about.policy.target == "robospa.evaluate"
    assert "unknown-checkpoint" not in {finding.rule for finding in lint_run(run)}
    assert robospa.evaluate(policy, out=tmp_path, resume=True, **RUN).records == run.records


def test_a_module_and_class_and_its_settings_again(tmp_path: Path) -> None:
    first = robospa.evaluate("run_fakes:FakePolicy", workers=1, out=tmp_path / "a", **RUN)
    check(first, tmp_path / "a")
    again = robospa.evaluate(config=tmp_path / "a" / FILE, out=tmp_path / "b", resume="auto")
    assert again.keys == first.keys
    known = robospa.evaluate(config=tmp_path / "b" / FILE, resume="auto")
    assert known.records == again.records
    resumed = robospa.evaluate(config=tmp_path / "a" / FILE, resume=True)
    assert resumed.records == first.records


@pytest.mark.parametrize(
    ("policy", "more", "reason"),
    [
        (3, {}, "a int is no policy"),
        (FakePolicy(), {"workers": 2}, "state of one trial"),
        (FakePolicy, {"executor": "ray"}, "executor must be local"),
        (FakePolicy, {"token": "secret"}, "token goes with policy servers"),
        ("hold", {"trails": 3}, "no setting 'trails'; did you mean trials"),
        (FakePolicy, {"policy_map": "map.json"}, "not both"),
    ],
)
def test_what_cannot_be_is_refused_before_anything_is_written(
    policy: Any, more: dict[str, Any], reason: str, tmp_path: Path
) -> None:
    with pytest.raises(SettingsError, match=reason):
        robospa.evaluate(policy, out=tmp_path / "run", **RUN, **more)
    assert not (tmp_path / "run").exists()


@pytest.mark.sim
def test_a_policy_of_this_process_in_the_real_world(tmp_path: Path) -> None:
    from robospa.baselines.hold import Hold

    run = robospa.evaluate(Hold, tasks="Pick_Blocks_Size", levels=1, trials=1, out=tmp_path)
    (record,) = run.records.values()
    assert record.end == "step_limit" and record.physics_steps > 0
