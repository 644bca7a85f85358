"""Real LeRobot policies with tiny random weights, one full trial each, through the wire.

Not part of the default tests: `make test-models` makes their environment (Python 3.12) and runs
this. ROBOSPA_MODELS_PYTHON names its interpreter.
"""

from __future__ import annotations

import contextlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robospa.clients import connect
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.protocol.transport import Timeouts

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
PYTHON = os.environ.get("ROBOSPA_MODELS_PYTHON", str(ROOT / ".venv-models" / "bin" / "python"))
SERVED = {
    "act": "robospa.clients.lerobot:create",
    "diffusion": "robospa.clients.lerobot:create",
    "xvla": "robospa.clients.lerobot:create",
    "pi05": "tiny:serve_pi05",
}
SIZES = {"xvla": 856_344, "pi05": 455_520}
"""Parameters, where they are known: another number is another model."""
PATIENT = Timeouts(wait=60, hello=60, reset=300, first_infer=300, infer=300)

pytestmark = [pytest.mark.models, pytest.mark.timeout(1500)]


@pytest.fixture(scope="module")
def environment() -> dict[str, str]:
    """Variables with which the models' Python finds this source tree, and nothing online."""
    return {
        **os.environ,
        "PYTHONPATH": str(ROOT),
        "PYTHONDONTWRITEBYTECODE": "1",
        "HF_HUB_OFFLINE": "1",
        "CUDA_VISIBLE_DEVICES": "",
    }


def tiny(environment: dict[str, str], *words: str) -> Any:
    """What `tiny.py` prints last."""
    done = subprocess.run(
        [PYTHON, str(HERE / "tiny.py"), *words],
        capture_output=True,
        text=True,
        timeout=600,
        env=environment,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout.splitlines()[-1])


@pytest.fixture(scope="module", params=list(SERVED))
def model(
    request: pytest.FixtureRequest,
    environment: dict[str, str],
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[str, Path]:
    """Name and checkpoint of each tiny policy."""
    name = str(request.param)
    folder = tmp_path_factory.mktemp(name)
    made = tiny(environment, "make", name, str(folder))
    assert made["parameters"] == SIZES.get(name, made["parameters"])
    return name, folder


@pytest.fixture(scope="module")
def url(model: tuple[str, Path], environment: dict[str, str]) -> Iterator[str]:
    """A server of the policy, in its own environment."""
    name, folder = model
    words = [f"--option=path={folder}", "--option=device=cpu", "--port=0"]
    if name in ("xvla", "pi05"):
        words.append(f"--option=tokenizer={folder / 'tokenizer'}")
    if name == "xvla":
        words.append("--option=domain_id=6")
    command = [PYTHON, "-m", "robospa.harness.cli.main", "serve", SERVED[name], *words]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, env=environment, cwd=HERE
    ) as server:
        assert server.stdout is not None
        line = next((text for text in server.stdout if text.startswith("serving ")), "")
        try:
            assert " at ws://" in line, "the server did not start; see its messages above"
            yield line.split(" at ")[1].split()[0]
        finally:
            server.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                server.wait(20)
            server.kill()


def trial(policy_seed: int) -> TrialInfo:
    return TrialInfo("Pick_Blocks_Size", "aloha-agilex", "lift it", policy_seed)


def seen(spec: PolicySpec) -> dict[str, Any]:
    random = np.random.default_rng(0)
    images = {
        c.name: random.integers(0, 255, (c.height, c.width, 3), dtype=np.uint8)
        for c in spec.cameras
    }
    state = random.uniform(-0.3, 0.3, 14).astype(np.float32)
    ee = np.tile(np.array([0.2, 0.0, 1.0, 1, 0, 0, 0, 1], np.float32), (2, 1))
    past = {"images": images, "state": state}
    return {
        "images": images,
        "state": state,
        "ee": ee,
        "instruction": "lift it",
        "step": 0,
        "history": {offset: past for offset in spec.history},
    }


def test_torchs_random_functions_follow_the_seeds_by_row(environment: dict[str, str]) -> None:
    found = tiny(environment, "noise")
    assert [name for name, right in found.items() if not right] == []


def test_seeds_are_honoured_through_the_wire(model: tuple[str, Path], url: str) -> None:
    chunks = []
    for seed in (1, 1, 2):
        with connect(url, timeouts=PATIENT) as policy:
            policy.reset(trial(seed))
            chunks.append(policy.infer(seen(policy.spec)))
    assert np.isfinite(chunks[0]).all()
    assert np.array_equal(chunks[0], chunks[1])
    assert np.array_equal(chunks[0], chunks[2]) == (model[0] == "act")  # ACT draws nothing


def test_a_batch_is_its_singles(model: tuple[str, Path], environment: dict[str, str]) -> None:
    found = tiny(environment, "batch", model[0], str(model[1]))
    assert found["finite"] and found["repeated"] == 0
    assert found["batch_against_singles"] < 1e-4  # rounding of larger matrix products
    assert (found["another_seed"] > 1e-2) == (model[0] != "act")


def test_both_sides_of_pi05s_state_prompt(
    model: tuple[str, Path], environment: dict[str, str]
) -> None:
    if model[0] != "pi05":
        pytest.skip("only pi0.5 prints its state")
    found = tiny(environment, "prompt", model[0], str(model[1]))
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
    files = sorted((out / "trials").iterdir())
    records = [json.loads(line) for f in files for line in f.read_text().splitlines()]
    assert len(records) == 1
    print(model[0], {k: records[0].get(k) for k in ("end", "steps", "policy_calls", "wall_time")})
    assert records[0]["end"] in ("step_limit", "success")
    (trace,) = (out / "actions").glob("*.npz")
    with np.load(trace) as data:
        assert np.isfinite(data["actions"]).all() and len(data["actions"]) > 50
