"""The documentation's pages: every page has its place, every relative link leads somewhere."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted((ROOT / "docs").rglob("*.md"))
TEXTS = [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md"]


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


@pytest.mark.parametrize("page", TEXTS, ids=lambda page: str(page.relative_to(ROOT)))
def test_relative_links_lead_somewhere(page: Path) -> None:
    targets = re.findall(r"\]\((?!https?:|#|mailto:)([^)#\s]+)", page.read_text())
    assert [t for t in targets if not (page.parent / t).exists()] == []


def test_the_version_is_the_same_everywhere() -> None:
    version = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    assert f"version: {version}\n" in (ROOT / "CITATION.cff").read_text()
