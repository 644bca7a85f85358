"""Real LeRobot policies with tiny random weights, one full trial each, through the wire.

Not part of the default tests: `make test-models` makes their environment (Python 3.12) and runs
this. ROBOSPA_MODELS_PYTHON names its interpreter.
"""

import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from outside import HERE, PATIENT, ran, served

from robospa.clients import connect
from robospa.protocol.conformance import synthetic_observation
from robospa.protocol.policy import TrialInfo
from robospa.results.records.runs import read_run

SERVED = {
    "act": "robospa.clients.lerobot:create",
    "diffusion": "robospa.clients.lerobot:create",
    "xvla": "robospa.clients.lerobot:create",
    "pi05": "tiny:serve_pi05",
    "smolvla": "robospa.clients.lerobot:create",
}
SIZES = {"xvla": 856_344, "pi05": 455_520, "smolvla": 376_928}
"""Parameters, where they are known: another number is another model."""

pytestmark = [pytest.mark.models, pytest.mark.timeout(1500)]


def tiny(*words: object) -> Any:
    """What `tiny.py` prints last."""
    return json.loads(ran(HERE / "tiny.py", *words).stdout.splitlines()[-1])


@pytest.fixture(scope="module", params=list(SERVED))
def model(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[str, Path]:
    """Name and checkpoint of each tiny policy."""
    name = str(request.param)
    folder = tmp_path_factory.mktemp(name)
    made = tiny("make", name, folder)
    assert made["parameters"] == SIZES.get(name, made["parameters"])
    return name, folder


@pytest.fixture(scope="module")
def url(model: tuple[str, Path]) -> Iterator[str]:
    """A server of the policy, in its own environment."""
    name, folder = model
    words = [f"--option=path={folder}", "--option=device=cpu"]
    if name in ("xvla", "pi05"):
        words.append(f"--option=tokenizer={folder / 'tokenizer'}")
    if name == "xvla":
        words.append("--option=domain_id=6")
    with served(SERVED[name], *words, cwd=HERE) as found:
        yield found


def test_torchs_random_functions_follow_the_seeds_by_row() -> None:
    found = tiny("noise")
    assert [name for name, right in found.items() if not right] == []


def test_seeds_are_honoured_through_the_wire(model: tuple[str, Path], url: str) -> None:
    chunks = []
    for seed in (1, 1, 2):
        with connect(url, timeouts=PATIENT) as policy:
            policy.reset(TrialInfo("Pick_Blocks_Size", "aloha-agilex", "lift it", seed))
            chunks.append(policy.infer(synthetic_observation(policy.spec)))
    assert np.isfinite(chunks[0]).all()
    assert np.array_equal(chunks[0], chunks[1])
    assert np.array_equal(chunks[0], chunks[2]) == (model[0] == "act")  # ACT draws nothing


def test_a_batch_is_its_singles(model: tuple[str, Path]) -> None:
    found = tiny("batch", *model)
    assert found["finite"] and found["repeated"] == 0
    assert found["batch_against_singles"] < 1e-4  # rounding of larger matrix products
    assert (found["another_seed"] > 1e-2) == (model[0] != "act")


def test_both_sides_of_pi05s_state_prompt(model: tuple[str, Path]) -> None:
    if model[0] != "pi05":
        pytest.skip("only pi0.5 prints its state")
    found = tiny("prompt", *model)
    assert (found["None"], found["14"], found["32"]) == (14, 14, 32)


def test_one_full_trial_in_the_simulator(model: tuple[str, Path], url: str, tmp_path: Path) -> None:
    out = tmp_path / "run"
    done = subprocess.run(
        [
            *(sys.executable, "-m", "robospa.harness.cli.main", "eval", url),
            *("--tasks", "Pick_Blocks_Size", "--levels", "1", "--trials", "1", "--workers", "1"),
            *("--out", str(out), "--timeout", "300", "--trial-timeout", "1200"),
        ],
        capture_output=True,
        text=True,
        timeout=1400,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    (record,) = read_run(out).records.values()
    print(model[0], record.end, record.steps, record.policy_calls, record.wall_time)
    assert record.end in ("step_limit", "success")
    (trace,) = (out / "actions").glob("*.npz")
    with np.load(trace) as data:
        assert np.isfinite(data["actions"]).all() and len(data["actions"]) > 50
