"""Which Python the environments with torch are made with; nothing is installed."""

import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[1] / "scripts" / "models.sh"
SHIM = "echo 'pyenv: python3.12: command not found' >&2; exit 127"


def put(path: Path, body: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"#!/bin/sh\n{body}\n")
    path.chmod(0o755)
    return path


def find_python(folder: Path, **more: str) -> subprocess.CompletedProcess[str]:
    """What the script says of a machine whose PATH begins with the folder `bin`."""
    for name in ("python3.12", "python3"):
        if not (folder / "bin" / name).exists():
            put(folder / "bin" / name, SHIM)
    return subprocess.run(
        ["bash", "-c", f"source {SCRIPT}; find_python"],
        capture_output=True,
        text=True,
        timeout=30,
        cwd=folder,
        env={"PATH": f"{folder / 'bin'}:/usr/bin:/bin", "HOME": str(folder / "home"), **more},
    )


@pytest.mark.parametrize("told", ["PYENV_ROOT", "pyenv root", "home"])
def test_a_shim_that_does_not_run_is_no_python(tmp_path: Path, told: str) -> None:
    root = tmp_path / "home" / ".pyenv" if told == "home" else tmp_path / "pyenv"
    put(root / "versions/3.12.9/bin/python3.12", "exit 0")
    good = put(root / "versions/3.12.10/bin/python3.12", "exit 0")
    put(root / "versions/3.12.11/bin/python3.12", "exit 1")
    put(tmp_path / "bin" / "pyenv", f"echo {root}" if told == "pyenv root" else "exit 1")
    done = find_python(tmp_path, **({"PYENV_ROOT": str(root)} if told == "PYENV_ROOT" else {}))
    assert (done.stdout.strip(), done.stderr) == (str(good), "")


def test_the_one_that_is_named_comes_first_and_then_the_one_on_path(tmp_path: Path) -> None:
    put(tmp_path / "home/.pyenv/versions/3.12.1/bin/python3.12", "exit 0")
    on_path = put(tmp_path / "bin" / "python3.12", "exit 0")
    assert find_python(tmp_path).stdout.strip() == str(on_path)
    named = put(tmp_path / "my python", "exit 0")
    assert find_python(tmp_path, MODELS_PYTHON=str(named)).stdout.strip() == str(named)


def test_without_one_a_sentence_says_what_to_do(tmp_path: Path) -> None:
    put(tmp_path / "bin" / "pyenv", "exit 1")
    done = find_python(tmp_path)
    assert done.returncode == 1
    assert done.stderr.splitlines() == [
        "models: .venv-models needs Python 3.12, and none that runs is on PATH or among "
        "pyenv's versions: install one (such as with `pyenv install 3.12`) or set MODELS_PYTHON to "
        "its path."
    ]
