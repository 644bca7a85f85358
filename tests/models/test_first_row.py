"""docs/examples/first_row.sh from demonstrations to its report, with tiny random models: only their
size, the steps and the trials differ from a row on a GPU. `make test-models` runs it."""

import subprocess
import sys
from pathlib import Path

import pytest
from outside import HERE, PYTHON, ROOT, SMALL_ACT, environment, ran

from robospa.results.records.runs import read_run

CAMERAS = {
    "smolvla": ["camera1", "camera2", "camera3"],
    "xvla": ["image", "image2", "image3"],
}
"""As the published bases call them."""
WORDS = {
    "act": SMALL_ACT,
    "smolvla": {},
    "xvla": {},
    "pi05": {
        "image_resolution": "[56,56]",
        "chunk_size": 50,
        "n_action_steps": 50,
        "num_inference_steps": 2,
    },
}
PROGRAM = """#!{python}
import sys
sys.path.insert(0, "{here}")
import tiny
tiny.shrink_pi05()
from {module} import main
main()
"""
MODULES = {
    "lerobot-train": "lerobot.scripts.lerobot_train",
    "robospa": "robospa.harness.cli.main",
}

pytestmark = [pytest.mark.models, pytest.mark.timeout(1800)]


@pytest.mark.parametrize("model", WORDS)
def test_a_row_is_made_to_its_report(model: str, tmp_path: Path) -> None:
    base, lerobot, out = (tmp_path / name for name in ("base", "lerobot", "row"))
    if model != "act":
        ran(HERE / "tiny.py", "make", model, base, *CAMERAS.get(model, ()))
    else:
        base.mkdir()
    (lerobot / "bin").mkdir(parents=True)
    for name, module in MODULES.items():  # what LeRobot's environment has, with a smaller pi0.5
        path = lerobot / "bin" / name
        path.write_text(PROGRAM.format(python=PYTHON, here=HERE, module=module))
        path.chmod(0o755)
    small = {
        "EPISODES": "1",
        "STEPS": "2",
        "BATCH": "2",
        "TRIALS": "1",
        "DEVICE": "cpu",
        "VIDEO": "none",
    }
    places = {"BASE": base, "LEROBOT": lerobot, "ROBOSPA": Path(sys.executable).parent / "robospa"}
    command = ["bash", str(ROOT / "docs/examples/first_row.sh"), model, "Pick_Blocks_Size", out]
    words = [f"--policy.{name}={value}" for name, value in WORDS[model].items()]
    done = subprocess.run(
        [*map(str, command), "--num_workers=0", *words],
        capture_output=True,
        text=True,
        timeout=1700,
        cwd=base,  # pi0.5's tokenizer is looked for there
        env=environment(tmp_path / "home")
        | small
        | {"PORT": "8917"}
        | {name: str(path) for name, path in places.items()},
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert (out / "run" / "report" / "report.html").exists()
    records = read_run(out / "run").records.values()
    assert sorted(record.key.level for record in records) == [1, 2, 3, 4, 5]
    assert {record.end for record in records} <= {"step_limit", "success"}
