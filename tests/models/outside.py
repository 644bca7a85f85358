"""The models' Python, which `make test-models` makes: programs and policy servers in it."""

import contextlib
import os
import subprocess
from collections.abc import Iterator
from pathlib import Path

from robospa.protocol.transport import Timeouts

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
PYTHON = os.environ.get("ROBOSPA_MODELS_PYTHON", str(ROOT / ".venv-models" / "bin" / "python"))
SMALL_ACT = {
    "dim_model": 32,
    "n_heads": 2,
    "dim_feedforward": 32,
    "n_encoder_layers": 1,
    "n_vae_encoder_layers": 1,
    "pretrained_backbone_weights": "null",
}
PATIENT = Timeouts(wait=60, hello=60, reset=300, first_infer=300, infer=300)


def environment(home: Path | None = None, *paths: Path) -> dict[str, str]:
    """Variables with which that Python finds this source tree and `paths`, and nothing online."""
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join(map(str, (ROOT, *paths))),
        "PYTHONDONTWRITEBYTECODE": "1",
        "HF_HUB_OFFLINE": "1",
        **({"HF_HOME": str(home)} if home else {}),
        "CUDA_VISIBLE_DEVICES": "",
    }


def ran(
    *words: object, given: dict[str, str] | None = None, cwd: Path | None = None, limit: int = 600
) -> subprocess.CompletedProcess[str]:
    """`python WORDS...`, which has ended well within `limit` seconds."""
    done = subprocess.run(
        [PYTHON, *map(str, words)],
        capture_output=True,
        text=True,
        timeout=limit,
        env=given or environment(),
        cwd=cwd,
    )
    assert done.returncode == 0, done.stderr[-4000:]
    return done


@contextlib.contextmanager
def served(*words: object, cwd: Path | None = None) -> Iterator[str]:
    """The URL of `robospa serve WORDS...`, which ends with the block."""
    command = [PYTHON, "-m", "robospa.harness.cli.main", "serve", *map(str, words), "--port=0"]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, text=True, env=environment(), cwd=cwd
    ) as server:
        assert server.stdout is not None
        try:
            line = next((text for text in server.stdout if text.startswith("serving ")), "")
            assert " at ws://" in line, "the server did not start; see its messages above"
            yield line.split(" at ")[1].split()[0]
        finally:
            server.terminate()
            with contextlib.suppress(subprocess.TimeoutExpired):
                server.wait(20)
            server.kill()
