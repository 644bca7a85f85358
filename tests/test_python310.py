"""Models live in environments with Python 3.10, so what serves them must run there."""

import ast
import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SERVING = sorted(
    [
        *(ROOT / "protocol").glob("*.py"),
        *(ROOT / "robospa").glob("*.py"),
        *(ROOT / "clients").rglob("*.py"),
        *(ROOT / "baselines").rglob("*.py"),
        *(ROOT / "harness").glob("__init__.py"),
        *(ROOT / "harness" / "cli").glob("__init__.py"),
        ROOT / "harness" / "factory.py",
        ROOT / "harness" / "cli" / "main.py",
        ROOT / "harness" / "cli" / "serve.py",
    ]
)
LATER = {
    "asyncio": {"timeout", "TaskGroup", "Runner"},
    "typing": {"Self", "Never", "LiteralString", "assert_never", "reveal_type"},
    "enum": {"StrEnum"},
    "datetime": {"UTC"},
    "tomllib": {"tomllib"},
}
"""Names that Python 3.10 does not have."""


def later_names(source: str) -> list[str]:
    """What `source` takes from newer standard libraries, and newer syntax (SyntaxError)."""
    found = []
    for node in ast.walk(ast.parse(source, feature_version=(3, 10))):
        if isinstance(node, ast.ImportFrom) and node.module in LATER:
            found += [a.name for a in node.names if a.name in LATER[node.module]]
        if isinstance(node, ast.Import):
            found += [a.name for a in node.names if a.name == "tomllib"]
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            found += [node.attr] if node.attr in LATER.get(node.value.id, ()) else []
    return found


@pytest.mark.parametrize("path", SERVING, ids=lambda path: str(path.relative_to(ROOT)))
def test_serving_needs_nothing_newer(path: Path) -> None:
    assert later_names(path.read_text()) == []


def test_the_check_sees_newer_names() -> None:
    assert later_names("from typing import Self") == ["Self"]
    assert later_names("import asyncio\nasyncio.timeout(1)") == ["timeout"]


def test_it_imports_on_python_310_where_there_is_one() -> None:
    python = os.environ.get("ROBOSPA_PYTHON310") or shutil.which("python3.10")
    needs = "numpy, msgpack, msgspec, websockets, typer"
    check = f"import sys, {needs}; sys.exit(sys.version_info[:2] != (3, 10))"
    if python is None or subprocess.run([python, "-c", check], capture_output=True).returncode:
        pytest.skip(f"no Python 3.10 with {needs} (ROBOSPA_PYTHON310)")
    code = (
        "from robospa.clients import go1, lerobot, rdt, xvla\n"
        "from robospa.clients import openpi\n"
        "from robospa.baselines import random, hold\n"
        "from robospa.harness.cli import main, serve\n"
        "from robospa.protocol.server import ServerThread\n"
        "from robospa.protocol.client import connect\n"
        "from robospa.protocol.policy import TrialInfo\n"
        "import numpy as np\n"
        "with ServerThread(policy_factory=hold.Hold) as server, connect(server.url) as policy:\n"
        "    policy.reset(TrialInfo('t', 'aloha-agilex', 'x'))\n"
        "    seen = {'step': 0, 'instruction': 'x', 'images': {}}\n"
        "    print(policy.infer({**seen, 'state': np.zeros(14, np.float32)}).shape)\n"
    )
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run(
        [python, "-c", code], capture_output=True, text=True, timeout=60, env=environment
    )
    assert done.stdout.strip() == "(10, 14)", done.stderr
