"""One policy for all tasks or one for each, and what a run says about them before it starts; that
it goes on with the policy that it began with, and with no other behind the same URL."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import msgpack
import numpy as np
import pytest
from command_line import eval_words, robospa
from run_fakes import SPEC, FakePolicy, request
from standins import OpenPi

from robospa.harness.running import policy_probe
from robospa.harness.running.evaluate import evaluate
from robospa.harness.running.executor import RunAborted
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

pytestmark = pytest.mark.usefixtures("world_asked_here", "no_second")

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
    found = [over_budget(replace(SPEC, text_budget=n), "pick the red block") for n in (4, 6, None)]
    assert found == [{"instruction_tokens": 6, "text_budget": 4}, None, None]


# ---------------------------------------------------------------- from the outside


class Named(FakePolicy):
    """Names itself, and never succeeds if its name says so."""

    def __init__(self, name: str) -> None:
        super().__init__(replace(SPEC, name=name))

    def infer(self, observation: Any) -> Any:
        chunk = super().infer(observation)
        return chunk * 0 if self.spec.name == "lazy" else chunk


def run(out: Path, *words: object) -> tuple[int, str]:
    done = robospa(*eval_words(out, "--levels", "1", "--workers", "1", *words, trials=2))
    return done.code, done.err


def test_a_checkpoint_for_every_task(tmp_path: Path) -> None:
    tasks = "Pick_Blocks_Size,Pick_Blocks_Height"
    with (
        ServerThread(policy_factory=lambda: Named("busy")) as first,
        ServerThread(policy_factory=lambda: Named("lazy")) as second,
    ):
        path = write(tmp_path, {"Pick_Blocks_Size": first.url, "Pick_Blocks_Height": second.url})
        code, err = run(tmp_path / "run", "--policy-map", path, "--tasks", tasks)
        assert code == 0, err
        other = write(tmp_path, {"Pick_Blocks_Size": first.url, "Pick_Blocks_Height": first.url})
        code, err = run(tmp_path / "run", "--policy-map", other, "--tasks", tasks, "--resume")
        assert code == 1
        assert "policies.Pick_Blocks_Height.spec.name: 'lazy' -> 'busy'" in err
    found = read_run(tmp_path / "run")
    assert {r.key.task: r.success for r in found.records.values()} == {
        "Pick_Blocks_Size": True,
        "Pick_Blocks_Height": False,
    }
    settings, about = found.manifest.settings, found.manifest.about
    assert settings.policies["Pick_Blocks_Height"].stated.name == "lazy"
    assert about.policies["Pick_Blocks_Size"].target == first.url


def test_warnings_and_options_are_printed_and_kept(tmp_path: Path) -> None:
    with ServerThread(policy_factory=lambda: Named("busy")) as server:
        url = server.url.replace("ws://", "openpi://") + "?text_budget=4"
        code, err = run(tmp_path / "run", url, "--step-scale", "3")
        assert code == 0, err
        code, refusal = run(tmp_path / "run", url, "--resume")
        assert code == 1
        assert "step_scale: 3.0 -> 1.0" in refusal
    found = read_run(tmp_path / "run")
    for text in ("adapt_to_pi is", "step limits are 3 times the", "the model reads 4 tokens of an"):
        assert err.count(f"warning: {text}") == 1
        assert sum(text in kept for kept in found.manifest.about.warnings) == 1
    assert found.manifest.settings.policy.options["text_budget"] == 4
    assert found.manifest.settings.step_scale == 3
    assert all(r.diagnostics["text_budget"] == 4 for r in found.records.values())
    assert "step-limits" in {finding.rule for finding in lint_run(found)}


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
    with pytest.raises(RunError, match="checkpoint is 'step 1000' and 'step 2000'"):
        combine_replicas([greeting("step 1000"), greeting("step 2000")])


# --- another checkpoint


@pytest.fixture
def no_second(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(policy_probe, "SECOND_LOOK", 0.0)


@contextmanager
def served(checkpoint: str, port: int = 0) -> Iterator[ServerThread]:
    spec = replace(SPEC, checkpoint=checkpoint)
    with ServerThread(policy_factory=lambda: FakePolicy(spec), port=port) as server:
        yield server


def test_resuming_with_another_checkpoint_is_refused_and_with_the_same_goes_on(
    tmp_path: Path,
) -> None:
    with served("step 1000") as server:
        port = int(server.url.rpartition(":")[2])
        evaluate(request(server.url, tmp_path))
    about = read_run(tmp_path).manifest.about.policy.identity
    assert about.checkpoint == "step 1000" and len(about.hash) == 16
    refused = pytest.raises(RunError, match=r"'step 1000' -> 'step 2000'.*another --out")
    for place in (port, 0):  # where it was, and elsewhere
        with served("step 2000", place) as server, refused:
            evaluate(request(server.url, tmp_path, resume=True))
        with served("step 1000", place) as server:
            evaluate(request(server.url, tmp_path, resume=True))


class Described(OpenPi):
    """openpi's server with metadata of its own; some of it changes with every connection."""

    def __init__(self, **metadata: Any) -> None:
        super().__init__()
        self.metadata, self.greetings = metadata, 0

    def talk(self, socket: Any) -> None:
        self.greetings += 1
        socket.send(msgpack.packb({**self.metadata, "served": self.greetings}))
        while True:
            socket.recv()


def test_metadata_of_other_dialects_tells_checkpoints_apart(tmp_path: Path) -> None:
    def probed(url: str) -> Any:
        asked = request(url, tmp_path)
        found = policy_probe.probe_policies(asked.config, asked.keys)
        return next(iter(found.values()))

    with Described(checkpoint="a", uptime=3) as url:
        first, later = probed(url), probed(url)
    assert first.identity.volatile == {"metadata.served"}
    assert first.identity.changes(later.identity) == []
    with Described(checkpoint="b", uptime=3) as url:
        assert first.identity.changes(probed(url).identity) == [
            "metadata.checkpoint was 'a' and is 'b'"
        ]


class Swapped(FakePolicy):
    """Fails in its second trial; from then on its server greets with another checkpoint."""

    checkpoint = "step 1000"
    trials = 0

    def reset(self, trial: Any) -> None:
        Swapped.trials += 1
        if Swapped.trials == 2:
            Swapped.server._policies.spec = replace(SPEC, checkpoint="step 2000")  # type: ignore[attr-defined]
            raise RuntimeError("restarting with the new weights")
        super().reset(trial)


def test_another_checkpoint_in_the_middle_stops_the_run(tmp_path: Path) -> None:
    spec = replace(SPEC, checkpoint="step 1000")
    with ServerThread(policy_factory=lambda: Swapped(spec)) as server:
        Swapped.server = server  # type: ignore[attr-defined]
        with pytest.raises(RunAborted, match="checkpoint was 'step 1000' and is 'step 2000'"):
            evaluate(request(server.url, tmp_path, trials=4))
    ends = [record.end for record in read_run(tmp_path).records.values()]
    assert sorted(ends) == ["policy_error", "success"]


def test_lint_notes_that_nothing_says_which_checkpoint_was_served(tmp_path: Path) -> None:
    for name, checkpoint in (("silent", ""), ("named", "step 1000")):
        with served(checkpoint) as server:
            evaluate(request(server.url, tmp_path / name))
        found = {f.rule: f for f in lint_run(read_run(tmp_path / name))}
        assert ("unknown-checkpoint" in found) == (not checkpoint)
        warnings = read_run(tmp_path / name).manifest.about.warnings
        assert ("which checkpoint" in " ".join(warnings)) == (not checkpoint)
    assert found.get("unknown-checkpoint") is None
