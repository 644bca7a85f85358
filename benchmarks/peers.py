"""The peers that we measure beside us, each from PyPI in a virtual environment of its own.

    python benchmarks/peers.py            install what is missing into .venv-peers/, print versions

A peer that cannot be installed is not skipped: its rows say why it was not measured.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1] / ".venv-peers"

REQUIREMENTS: Mapping[str, tuple[str, ...]] = {
    "vla-eval": ("vla-eval",),
    "openpi-client": ("openpi-client", "typing_extensions"),  # imports it, does not ask for it
    "xpolicylab": ("xpolicylab",),
    "xpolicylab's wire": ("msgpack-numpy", "msgpack", "websockets", "numpy"),
}
"""What pip is asked for. XPolicyLab's own code is not on PyPI; pip says so every time."""


@dataclass(frozen=True)
class Peer:
    """An environment: its interpreter and version, or why there is none."""

    name: str
    python: Path | None
    version: str = ""
    problem: str = ""


@cache
def environment(name: str) -> Peer:
    """The peer's environment, made if it is missing."""
    folder = ROOT / name.replace(" ", "_").replace("'", "")
    python = folder / "bin" / "python"
    requirements = REQUIREMENTS[name]
    mark = folder / "installed.txt"
    if not (mark.exists() and mark.read_text(encoding="utf-8") == " ".join(requirements)):
        problem = _install(folder, python, requirements)
        if problem:
            shutil.rmtree(folder, ignore_errors=True)
            return Peer(name, None, problem=problem)
        mark.write_text(" ".join(requirements), encoding="utf-8")
    return Peer(name, python, _version(python, requirements[0]))


def _install(folder: Path, python: Path, requirements: tuple[str, ...]) -> str:
    """Make the environment; what went wrong, or ""."""
    for command in (
        [sys.executable, "-m", "venv", "--clear", str(folder)],
        [
            str(python),
            "-m",
            "pip",
            "install",
            "--quiet",
            "--disable-pip-version-check",
            *requirements,
        ],
    ):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            lines = [x for x in done.stderr.splitlines() if x.startswith("ERROR")]
            return f"pip install {requirements[0]}: {(lines or [done.stderr.strip()])[-1]}"
    return ""


def _version(python: Path, package: str) -> str:
    code = f"from importlib.metadata import version; print(version({package!r}))"
    return subprocess.run(
        [str(python), "-c", code], capture_output=True, text=True, check=True
    ).stdout.strip()


def main() -> None:
    """Install and say what there is."""
    for name in REQUIREMENTS:
        peer = environment(name)
        print(f"{name}: {peer.version or peer.problem}")


if __name__ == "__main__":
    main()
