"""The documentation's pages: every page has its place, every relative link leads somewhere."""

from __future__ import annotations

import pkgutil
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import robospa
from robospa import registry

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted((ROOT / "docs").rglob("*.md"))
TEXTS = [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "CHANGELOG.md"]
PACKAGES = sorted(path.parent for path in ROOT.glob("[a-z]*/__init__.py"))
FOLDERS = [path.name for path in PACKAGES] + ["benchmarks", "docs", "scripts", "tests", "tools"]
THEIRS = {"scripts/serve_policy.py", "scripts/encode_lang.py"}
"""Files in the repositories of openpi and RDT."""
DATASETS = {"robospa/NAME", "robospa/Pick_Blocks_Size"}
"""Names of data sets, which LeRobot looks up by."""
MODULES = {f"robospa.{path.stem}" for path in (ROOT / "robospa").glob("[!_]*.py")}
"""The public modules."""
GROUPS = {str(v) for k, v in vars(registry).items() if k.isupper()}
"""Groups of entry points: names with a dot that are no module, as is the wire's version."""


def named(nav: Any) -> Iterator[str]:
    """Every page in a (part of the) navigation."""
    if isinstance(nav, str):
        yield nav
    else:
        for item in nav.values() if isinstance(nav, dict) else nav:
            yield from named(item)


def test_the_navigation_has_every_page_of_docs() -> None:
    nav = list(named(tomllib.loads((ROOT / "zensical.toml").read_text())["project"]["nav"]))
    pages = [str(page.relative_to(ROOT / "docs")) for page in PAGES]
    assert sorted(nav) == sorted(pages)


def anchors(page: Path) -> set[str]:
    """The ids of a page's headings, as the site makes them."""
    text = page.read_text()
    heads = [re.sub(r"[^a-z0-9_ -]", "", h.lower()) for h in re.findall(r"^#+ (.+)$", text, re.M)]
    return {h.strip().replace(" ", "-") for h in heads} | set(
        re.findall(r'<a id="([\w-]+)">', text)
    )


@pytest.mark.parametrize("page", TEXTS, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_to_a_section_find_its_heading(page: Path) -> None:
    found = re.findall(r"\]\((?!https?:)([\w./-]*)#([\w-]+)\)", page.read_text())
    targets = [((page.parent / target) if target else page, anchor) for target, anchor in found]
    assert [(t.name, anchor) for t, anchor in targets if anchor not in anchors(t)] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_headings_have_one_address_on_the_site_and_in_the_repository(page: Path) -> None:
    """The site joins the hyphens that a character left out, such as `&`, leaves side by side."""
    assert [anchor for anchor in anchors(page) if "--" in anchor] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_of_the_site_stay_within_it(page: Path) -> None:
    targets = re.findall(r"\]\((?!https?:|#|mailto:)([^)#\s]+)", page.read_text())
    inside = ROOT / "docs"
    assert [t for t in targets if not (page.parent / t).resolve().is_relative_to(inside)] == []


@pytest.mark.parametrize("page", TEXTS, ids=lambda page: str(page.relative_to(ROOT)))
def test_relative_links_lead_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\((?!https?:|#|mailto:)([^)#\s]+)", page.read_text())
    assert [t for t in targets if not (page.parent / t).exists()] == []


def test_the_api_page_has_every_public_name() -> None:
    listed = re.findall(r"^::: robospa\.(\w+)$", (ROOT / "docs" / "api.md").read_text(), re.M)
    assert sorted(listed) == sorted(set(robospa.__all__) - {"__version__"})


def test_the_version_is_the_same_everywhere() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert f"version: {version}\n" in (ROOT / "CITATION.cff").read_text()


def without_code(text: str) -> str:
    """The page without its blocks of code."""
    return re.sub(r"^```.*?^```$", "", text, flags=re.M | re.S)


@pytest.mark.parametrize("page", TEXTS, ids=lambda page: str(page.relative_to(ROOT)))
def test_paths_in_the_text_exist(page: Path) -> None:
    text = without_code(page.read_text())
    named = set(re.findall(rf"`((?:{'|'.join(FOLDERS)})/[^`\s]*)`", text))
    named -= {"clients/<vendor>/", "leaderboard/submissions/NAME/", *THEIRS, *DATASETS}
    assert [name for name in sorted(named) if not list(ROOT.glob(name))] == []


@pytest.mark.parametrize("page", TEXTS, ids=lambda page: str(page.relative_to(ROOT)))
def test_python_names_in_the_text_exist(page: Path) -> None:
    named = set(re.findall(r"(?<![\w./\"-])robospa(?:\.[a-zA-Z_]\w*)+", page.read_text()))
    named -= {*GROUPS, "robospa.v1"}
    assert [name for name in sorted(named) if not can_be_found(name)] == []


def can_be_found(name: str) -> bool:
    """Whether `name` is a module, if need be of an extra, or something in one."""
    try:
        pkgutil.resolve_name(name)
    except (ImportError, AttributeError):
        return name in MODULES
    return True


def test_the_architecture_names_every_folder() -> None:
    page = (ROOT / "docs" / "architecture.md").read_text()
    rooms = [path.parent for package in PACKAGES for path in package.glob("*/__init__.py")]
    folders = [path.relative_to(ROOT) for path in [*PACKAGES, *rooms] if not path.is_symlink()]
    assert [str(name) for name in folders if f"`{name}/`" not in page] == []
