"""Imports point one way, packaging lists what exists, and starting up stays light."""

import ast
import os
import runpy
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import robospa

ROOT = Path(__file__).resolve().parents[1]

ALLOWED = {
    "protocol": (),
    "tasks": (),
    "results": (),
    "clients": ("protocol",),
    # A world answers what the policy's spec asks for, so the harness knows the protocol's types.
    "harness": ("protocol", "clients", "tasks", "results"),
    "baselines": (
        "protocol",
        "tasks",
        "harness.skills",
        "harness.sim",
        "harness.robots",
        "harness.demonstrations",
        "harness.datasets",
        "harness.clock",
        "harness.pool",
        "action_space",
        "harness.running.atomic_file",
        "clients.model_policy",
        "results.figures",
    ),
    "leaderboard": ("results", "harness", "tasks"),
}
"""What each folder may import besides itself and the shared words of `robospa/`. The command line
reaches `baselines` through entry points."""

HEAVY = ("sapien", "matplotlib", "scipy", "av", "jinja2", "torch", "cv2", "PIL", "pyarrow")
"""Modules that cost a good part of a second, or are not part of the base install."""


def imported_modules(source: str) -> Iterator[str]:
    """Every `robospa...` name that `source` imports, `from` imports with the imported name."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"relative import in line {node.lineno}: write robospa.<folder>"
            names = [f"{node.module}.{alias.name}" for alias in node.names]
        else:
            continue
        yield from (name for name in names if name.split(".")[0] == "robospa")


def shared_modules() -> list[str]:
    """The modules of the folder `robospa/` itself: the words that all folders share."""
    return sorted(path.stem for path in (ROOT / "robospa").glob("[!_]*.py"))


def violations(folder: str, source: str) -> list[str]:
    """The imports of `source`, a module of `folder`, that ALLOWED does not list."""
    allowed = [f"robospa.{name}." for name in (folder, *ALLOWED[folder], *shared_modules())]
    return [m for m in imported_modules(source) if not (m + ".").startswith(tuple(allowed))]


def loaded_after(statement: str, top: bool = True) -> set[str]:
    """Modules (their first names) that a fresh interpreter has loaded after `statement`."""
    name = "m.split('.')[0]" if top else "m"
    code = f"import sys\n{statement}\nprint('\\nloaded', *{{{name} for m in sys.modules}})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return set(done.stdout.splitlines()[-1].split()[1:])


def python_files(folder: str) -> list[Path]:
    return sorted((ROOT / folder).rglob("*.py"))


@pytest.mark.parametrize("folder", ALLOWED)
def test_imports_point_one_way(folder: str) -> None:
    wrong = [
        f"{path.relative_to(ROOT)} imports {name}"
        for path in python_files(folder)
        for name in violations(folder, path.read_text())
    ]
    assert wrong == []


@pytest.mark.parametrize(
    ("folder", "line", "wrong"),
    [
        ("tasks", "import robospa.harness.world", ["robospa.harness.world"]),
        ("baselines", "from robospa.harness import cli", ["robospa.harness.cli"]),
        ("baselines", "from robospa.harness.skills import run", []),
        (
            "harness",
            "def f():\n    from robospa.baselines import oracle",
            ["robospa.baselines.oracle"],
        ),
        ("protocol", "import numpy", []),
    ],
)
def test_the_rule_sees_a_violation(folder: str, line: str, wrong: list[str]) -> None:
    assert violations(folder, line) == wrong


def test_every_folder_with_code_has_a_rule() -> None:
    folders = {path.parent.name for path in ROOT.glob("*/__init__.py")}
    assert folders - {"robospa"} == set(ALLOWED)


def test_the_shared_words_import_no_folder() -> None:
    wrong = [
        f"{name}.py imports {found}"
        for name in shared_modules()
        for found in imported_modules((ROOT / "robospa" / f"{name}.py").read_text())
        if found.split(".")[1] not in shared_modules()
    ]
    assert wrong == []


def test_every_folder_with_code_is_linked_into_the_package() -> None:
    links = {path.name for path in (ROOT / "robospa").iterdir() if path.is_symlink()}
    assert links == set(ALLOWED)


def test_every_subfolder_with_code_is_a_package() -> None:
    folders = {path.parent for folder in ALLOWED for path in python_files(folder)}
    assert [str(folder) for folder in folders if not (folder / "__init__.py").exists()] == []


@pytest.mark.parametrize("name", robospa.__all__)
def test_public_names_exist(name: str) -> None:
    assert getattr(robospa, name) is not None


def test_the_public_names_are_listed_where_they_are_found() -> None:
    assert set(robospa.__all__) <= set(dir(robospa))


def test_an_unknown_public_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="has no attribute 'nothing'"):
        robospa.nothing  # noqa: B018


def test_importing_robospa_loads_no_folder_of_it() -> None:
    loaded = loaded_after("import robospa", top=False)
    assert {name for name in loaded if name.split(".")[0] == "robospa"} == {"robospa"}


def test_protocol_loads_only_its_four_dependencies() -> None:
    statement = (
        "import importlib, pkgutil, robospa.protocol as p\n"
        "for m in pkgutil.iter_modules(p.__path__): importlib.import_module(p.__name__+'.'+m.name)"
    )
    loaded = loaded_after(statement)
    assert loaded.isdisjoint((*HEAVY, "typer", "rich"))


@pytest.mark.parametrize("module", ["robospa.tasks.catalog", "robospa.results"])
def test_tasks_and_results_load_no_simulator(module: str) -> None:
    assert loaded_after(f"import {module}").isdisjoint(HEAVY)


def test_help_loads_nothing_heavy() -> None:
    statement = (
        "from robospa.harness.cli.main import main\n"
        "sys.argv = ['robospa', '--help']\n"
        "try: main()\n"
        "except SystemExit as stop: assert not stop.code, stop.code"
    )
    loaded = loaded_after(statement, top=False)
    assert loaded.isdisjoint((*HEAVY, "numpy", "websockets", "rich.console"))


def test_no_private_package_index_in_the_lock_files() -> None:
    lines = [
        line
        for name in ("requirements.lock", "requirements-dev.lock")
        for line in (ROOT / name).read_text().splitlines()
        if not line.lstrip().startswith("#")
    ]
    assert [line for line in lines if "://" in line or line.startswith(("-", "torch"))] == []


SCRIPTS = [
    path for folder in ("benchmarks", "tools", "scripts") for path in (ROOT / folder).glob("*.py")
]


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_what_a_script_imports_is_there(script: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(script.parent))
    assert runpy.run_path(str(script), run_name="imported")["__doc__"]


# --- models live in environments with Python 3.10, so what serves them must run there


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
