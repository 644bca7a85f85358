"""One policy for all tasks or one for each, and what a run says about them before it starts."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import robospa
from run_fakes import SPEC, FakePolicy

from robospa.harness.running.policy_probe import (
    ProbedPolicy,
    check_fit,
    combine_replicas,
    over_budget,
    probe_policies,
    read_map,
    warnings_of,
)
from robospa.harness.running.worker import WorkerConfig
from robospa.observation import CameraSpec
from robospa.protocol.server import ServerThread
from robospa.results.lint import lint_run
from robospa.results.records.manifest import RunError
from robospa.results.records.runs import read_run
from robospa.trial import TrialKey

pytestmark = pytest.mark.usefixtures("world_asked_here")

KNOWN = {"Pick_A", "Pick_B", "Pick_C", "Pick_D", "Pick_E"}
KEYS = [TrialKey("Pick_A", 1, 1), TrialKey("Pick_B", 1, 1), TrialKey("Pick_A", 2, 1)]


def write(folder: Path, value: Any) -> Path:
    path = folder / "map.json"
    path.write_text(value if isinstance(value, str) else json.dumps(value))
    return path


def test_a_map_is_cut_to_the_tasks_of_the_run(tmp_path: Path) -> None:
    path = write(tmp_path, {"Pick_B": "ws://b", "Pick_A": "ws://a", "Pick_C": "ws://c"})
    assert read_map(path, ["Pick_A", "Pick_B"], KNOWN) == {"Pick_A": "ws://a", "Pick_B": "ws://b"}


@pytest.mark.parametrize(
    ("value", "reason"),
    [
        ("{", "cannot be read"),
        ('{"Pick_A": "ws://a", "Pick_A": "ws://b"}', "'Pick_A' is there twice"),
        ([], "no map from tasks to URLs"),
        ({"Pick_A": 3}, "no map from tasks to URLs"),
        ({"Pick_A": ""}, "no map from tasks to URLs"),
        ({"Pick_A": "ws://a", "Pick_Z": "ws://z"}, "tasks that do not exist: Pick_Z"),
        ({}, "no policy for Pick_A, Pick_B, Pick_C and 1 more; add them"),
    ],
)
def test_maps_that_cannot_be(tmp_path: Path, value: Any, reason: str) -> None:
    with pytest.raises(RunError, match=reason):
        read_map(write(tmp_path, value), ["Pick_A", "Pick_B", "Pick_C", "Pick_D"], KNOWN)


def test_a_policy_for_another_robot() -> None:
    def probed(**spec: Any) -> ProbedPolicy:
        return ProbedPolicy("ws://a", replace(SPEC, **spec), {"options": {"embodiment": "x"}})

    with pytest.raises(RunError, match="camera 'wrist_left'; there are head, left_wrist"):
        check_fit(probed(cameras=(CameraSpec("wrist_left"),)), KEYS)
    with pytest.raises(RunError, match=r"drives franka, not aloha-agilex; .*\?embodiment=aloha"):
        check_fit(probed(embodiments=("franka",)), KEYS)
    franka = [replace(key, embodiment="franka-panda") for key in KEYS]
    with pytest.raises(RunError, match=r"14 numbers per action, but .* of franka-panda has 16"):
        check_fit(probed(action_dim=14), franka)
    for fits in (probed(action_dim=16), probed(), probed(action="ee", action_dim=16)):
        check_fit(fits, franka)
    mixed = [replace(key, embodiment="piper+franka-panda:0.6") for key in KEYS]
    check_fit(probed(action_dim=15, embodiments=("piper+franka-panda:0.6",)), mixed)


def greeting(checkpoint: str = "step 1000", **more: Any) -> ProbedPolicy:
    return ProbedPolicy("ws://a", replace(SPEC, checkpoint=checkpoint), {"dialect": "test", **more})


def test_a_server_that_names_no_checkpoint_is_warned_about_once() -> None:
    silent = greeting("")
    (text,) = warnings_of({"Pick_A": silent, "Pick_B": silent}, {}, 1.0)
    assert text.startswith("ws://a does not say which checkpoint it serves")
    named = greeting("", metadata={"model": {"ckpt_path": "run/2000"}})
    assert warnings_of({"Pick_A": named}, {}, 1.0) == []
    here = replace(silent, target="module:Policy")
    assert warnings_of({"Pick_A": here}, {}, 1.0) == [], "the policy is in this process"


def test_other_step_limits_are_warned_about() -> None:
    (text,) = warnings_of({"Pick_A": greeting()}, {}, 3.0)
    assert "3 times the official ones" in text


def test_instructions_over_the_budget_are_warned_about() -> None:
    reads = replace(SPEC, text_budget=6, checkpoint="step 1000")
    policies = {name: ProbedPolicy("ws://a", reads, {}) for name in ("Pick_A", "Pick_B")}
    told = {"Pick_A": "pick it", "Pick_B": "pick the red, the small block"}
    (text,) = warnings_of(policies, told, 1.0)
    assert text.startswith("the model reads 6 tokens of an instruction, and those of 1 of 2 tasks")
    assert "Pick_B: at least 9" in text


def test_a_record_keeps_that_its_instruction_was_cut() -> None:
    assert over_budget(replace(SPEC, text_budget=4), "pick the red block") == {
        "instruction_tokens": 6,
        "text_budget": 4,
    }
    assert over_budget(replace(SPEC, text_budget=6), "pick the red block") is None
    assert over_budget(SPEC, "pick the red block") is None


# ---------------------------------------------------------------- from the outside


class Named(FakePolicy):
    """Names itself, and never succeeds if its name says so."""

    def __init__(self, name: str) -> None:
        super().__init__(replace(SPEC, name=name))

    def infer(self, observation: Any) -> Any:
        chunk = super().infer(observation)
        return chunk * 0 if self.spec.name == "lazy" else chunk


def evaluate(out: Path, *words: str) -> tuple[int, str]:
    fakes = ["--world", "run_fakes:FakeWorld", "--parts", "run_fakes:parts", "--workers", "1"]
    what = ["--levels", "1", "--trials", "2", "--seeds", "100000-100001", "--out", str(out)]
    done = robospa("eval", *words, *what, *fakes)
    return done.code, done.err


def test_a_checkpoint_for_every_task(tmp_path: Path) -> None:
    tasks = "Pick_Blocks_Size,Pick_Blocks_Height"
    with (
        ServerThread(policy_factory=lambda: Named("busy")) as first,
        ServerThread(policy_factory=lambda: Named("lazy")) as second,
    ):
        path = write(tmp_path, {"Pick_Blocks_Size": first.url, "Pick_Blocks_Height": second.url})
        words = ["--policy-map", str(path), "--tasks", tasks]
        code, err = evaluate(tmp_path / "run", *words)
        assert code == 0, err
        other = write(tmp_path, {"Pick_Blocks_Size": first.url, "Pick_Blocks_Height": first.url})
        code, err = evaluate(tmp_path / "run", "--policy-map", str(other), "--tasks", tasks,
                             "--resume")  # fmt: skip
        assert code == 1
        assert "policies.Pick_Blocks_Height.spec.name: 'lazy' -> 'busy'" in err
    run = read_run(tmp_path / "run")
    assert {r.key.task: r.success for r in run.records.values()} == {
        "Pick_Blocks_Size": True,
        "Pick_Blocks_Height": False,
    }
    settings, about = run.manifest.settings, run.manifest.about
    assert settings.policies["Pick_Blocks_Height"].stated.name == "lazy"
    assert about.policies["Pick_Blocks_Size"].target == first.url


def test_warnings_and_options_are_printed_and_kept(tmp_path: Path) -> None:
    with ServerThread(policy_factory=lambda: Named("busy")) as server:
        url = server.url.replace("ws://", "openpi://") + "?text_budget=4"
        words = [url, "--tasks", "Pick_Blocks_Size", "--step-scale", "3"]
        code, err = evaluate(tmp_path / "run", *words)
        assert code == 0, err
        again = [url, "--tasks", "Pick_Blocks_Size", "--resume"]
        code, refusal = evaluate(tmp_path / "run", *again)
        assert code == 1
        assert "step_scale: 3.0 -> 1.0" in refusal
    assert err.count("warning: adapt_to_pi is invisible") == 1
    assert err.count("warning: step limits are 3 times the official ones") == 1
    assert err.count("warning: the model reads 4 tokens of an instruction") == 1
    run = read_run(tmp_path / "run")
    kept = run.manifest.about.warnings
    assert sum("adapt_to_pi" in text for text in kept) == 1
    assert run.manifest.settings.policy.options["text_budget"] == 4
    assert run.manifest.settings.step_scale == 3
    assert all(r.diagnostics["text_budget"] == 4 for r in run.records.values())
    assert "step-limits" in {finding.rule for finding in lint_run(run)}


class InMetres(FakePolicy):
    """Answers openings of its grippers in metres."""

    def infer(self, observation: Any) -> Any:
        rows = np.repeat(observation["state"][None], 2, axis=0)
        rows[:, [6, 13]] *= 0.08
        return rows


def test_first_actions_are_looked_at_before_the_trials() -> None:
    with ServerThread(policy_factory=InMetres) as server:
        config = WorkerConfig(Path("run"), server.url)
        found = probe_policies(config, KEYS, look=True)
        assert probe_policies(config, KEYS)["Pick_A"].hints == ()
    (said,) = [w for w in warnings_of(found, {}, 1.0) if "metres" in w]
    assert said.startswith(server.url)


def test_servers_of_two_checkpoints_are_not_one_policy_in_any_dialect() -> None:
    one, other, silent = (
        ProbedPolicy(f"openpi://{name}", SPEC, {"dialect": "openpi", "metadata": said})
        for name, said in [("a", {"ckpt": "1", "pid": 1}), ("b", {"ckpt": "2"}), ("c", {})]
    )
    same = replace(one, target="openpi://d", hello={**one.hello, "metadata": {"ckpt": "1"}})
    assert combine_replicas([one, same]).replicas == (same,)
    with pytest.raises(RunError, match=r"metadata\.ckpt is '1' and '2'"):
        combine_replicas([one, other])
    with pytest.raises(RunError, match=r"metadata\.ckpt is '1' and 'unset'"):
        combine_replicas([one, silent])
