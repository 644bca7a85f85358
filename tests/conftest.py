"""What all tests share: processes that they start find the modules of `tests/helpers` too."""

import hashlib
import os
import pickle
import re
import shutil
import socketserver
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from xdist.scheduler import LoadFileScheduling

from robospa.harness.running.status import cores
from robospa.tasks import catalog

# Timing decides no test: a busy machine may be slow at generating examples.
settings.register_profile("busy", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("busy")

TASKS = re.compile("|".join(sorted(catalog.tasks(), key=len, reverse=True)), re.IGNORECASE)

PAGES = ("robospa.leaderboard.site.draw", "robospa.results.report.report.draw")
"""What draws the figures of pages."""
HELPERS = Path(__file__).resolve().parent / "helpers"
LONG = (
    "test_soak",
    "test_every_dialect",
    "test_faults_every_dialect",
    "test_ray",
    "test_pool",
    "test_site",
    "test_eval_cli",
    "test_run_films",
    "test_api",
    "test_server_faults",
    "test_runner",
    "test_client",
    "test_held_trials",
    "test_figures",
    "test_ranking",
    "test_report",
    "test_reproduce_sim",
    "test_oracle_through_adapters",
    "test_colors_rendered",
    "test_docs_extensions",
    "test_run_sim",
    "test_submit_sim",
    "test_demo_sim",
)
"""Modules that take ten seconds or more: begun last, one would keep a core busy alone."""


def pytest_configure(config: pytest.Config) -> None:
    inherited = os.environ.get("PYTHONPATH")
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (str(HELPERS), inherited)))
    config.option.loadscopereorder = False  # the modules with most tests are not the longest
    # Servers look every 10 ms whether they shall end; by default each end takes half a second.
    socketserver.BaseServer.serve_forever.__defaults__ = (0.01,)
    cache = getattr(config, "cache", None)
    if sys.dont_write_bytecode and cache is not None:
        # Else each of the processes that tests start compiles the package anew.
        sys.dont_write_bytecode, sys.pycache_prefix = False, str(cache.mkdir("bytecode"))
        os.environ.update(PYTHONDONTWRITEBYTECODE="", PYTHONPYCACHEPREFIX=sys.pycache_prefix)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: item.path.stem not in LONG)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers(config: pytest.Config) -> int:
    """One more than cores, as some tests wait for deadlines; those of the simulator never do."""
    return cores() if config.getoption("markexpr") == "sim" else cores() + 1


class ByTask(LoadFileScheduling):  # type: ignore[misc]
    """Spreads tests by the task that they look at, others by file.

    A task's first scene of a level costs up to a second (a pool of layouts), those after it 1 ms.
    """

    def _split_scope(self, nodeid: str) -> str:
        path, _, given = nodeid.rstrip("]").partition("[")
        named = TASKS.search(given)
        return named.group().lower() if named else super()._split_scope(path)


def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> ByTask | None:
    return ByTask(config, log) if config.getoption("dist") == "loadfile" else None


@pytest.fixture(scope="session")
def drawn_figures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where this process keeps figures that are drawn."""
    return tmp_path_factory.mktemp("figures")


@pytest.fixture
def same_figures_once(monkeypatch: pytest.MonkeyPatch, drawn_figures: Path) -> None:
    """The test's pages get figures that an earlier one has drawn of the same values, and only those
    that they show: files for papers are empty.

    A set of figures costs one to three seconds, and the same values make the same bytes in all
    formats (`tests/results/figures/test_figures.py` holds that).
    """
    from robospa.results.figures.draw import draw
    from robospa.results.figures.series import FORMATS

    def kept(
        all_series: Sequence[Any],
        folder: Path,
        formats: Sequence[str] = FORMATS,
        beside: Sequence[Any] = (),
    ) -> Any:
        values = pickle.dumps((list(all_series), tuple(formats), list(beside)))
        drawn = drawn_figures / hashlib.sha256(values).hexdigest()
        if not (drawn / "drawings").exists():
            drawn.mkdir(parents=True, exist_ok=True)
            made = draw(all_series, drawn, ("svg",), beside)
            for ending in set(formats) - {"svg"}:
                for drawing in made:
                    (drawn / f"{drawing.name}.{ending}").touch()
            (drawn / "drawings").write_bytes(pickle.dumps(made))
        for path in drawn.iterdir():
            if path.name != "drawings":
                shutil.copyfile(path, folder / path.name)
        return pickle.loads((drawn / "drawings").read_bytes())

    for page in PAGES:
        monkeypatch.setattr(page, kept)


@pytest.fixture
def no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages without pictures."""
    for page in PAGES:
        monkeypatch.setattr(page, lambda *given: [])


@pytest.fixture
def world_asked_here(monkeypatch: pytest.MonkeyPatch) -> None:
    """Evaluations ask their world about itself in this process: one of its own costs a second."""
    from robospa.harness.running import evaluate
    from robospa.harness.worlds import open_world

    monkeypatch.setattr(
        evaluate,
        "probe_world",
        lambda config, render: dict(open_world(config.world, config.world_arguments).info()),
    )


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Any]:
    from devtools import chromium

    with chromium(tmp_path_factory.mktemp("profile")) as page:
        yield page
