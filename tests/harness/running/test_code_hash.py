"""The hash of the code changes with every file that can change an outcome, and with no other."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

import robospa
from robospa.harness.running import code_hash as module
from robospa.harness.running.code_hash import FOLDERS, LEFT_OUT, code_hash, files_of

ROOT = Path(robospa.__path__[0])


def test_files_are_found_by_folder(tmp_path: Path) -> None:
    names = [
        "a.py",
        "tasks/b.py",
        "tasks/in/c.toml",
        "tasks/seeds/d.json",
        "tasks/__pycache__/x.py",
    ]
    names += ["tasks/README.md", "tasks/.e.swp", "tasks/f.py~", "harness/g.py", "harness/in/h.py"]
    for name in names:
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name)
    folders = ("robospa/", "tasks/", "harness/*")
    counted = ["a.py", "tasks/b.py", "tasks/in/c.toml", "harness/g.py"]
    assert files_of(tmp_path, folders, LEFT_OUT) == counted
    with pytest.raises(FileNotFoundError, match="gone"):
        files_of(tmp_path, ("gone/",))


def test_the_hash_is_of_names_and_contents(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        module, "import_module", lambda name: type("M", (), {"__path__": [tmp_path]})
    )
    found = set()
    for name, text in (("a.py", "1"), ("a.py", "2"), ("b.py", "2")):
        (tmp_path / name).write_text(text)
        code_hash.cache_clear()
        found.add(code_hash(("robospa/",)))
    code_hash.cache_clear()
    assert len(found) == 3 and {len(one) for one in found} == {16}


def test_it_covers_every_module_that_scenes_goals_and_a_world_load() -> None:
    pytest.importorskip("sapien")
    code = """
import sys
import robospa.clients
import robospa.harness.sim.sapien_world
from robospa.harness.trial import task_parts
from robospa.tasks.catalog import tasks
from robospa.trial import TrialKey
of_each_family = {task.draw.__module__: name for name, task in tasks().items()}
for task in of_each_family.values():
    task_parts(TrialKey(task, 1, 100000))
for name in sorted(sys.modules):
    if name.startswith("robospa."):
        print(sys.modules[name].__file__)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    counted = {(ROOT / name).resolve() for name in files_of(ROOT, FOLDERS, LEFT_OUT)}
    loaded = {Path(line).resolve() for line in done.stdout.split()}
    beside = {path for path in loaded - counted if path.name != "__init__.py"}
    kept = ("results/records/", "tasks/seeds/")
    assert [p for p in beside if not any(name in p.as_posix() for name in kept)] == []
