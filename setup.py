"""The source archive is the repository, and PyPI's page its README; all else is in pyproject.toml.

`robospa/` links to the folders beside it. Left alone, setuptools would follow the links and pack
copies, and Makefile, tests and documentation would not find the folders that they name.
"""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from pathlib import Path

from setuptools import setup
from setuptools.command.sdist import sdist


class SourceArchive(sdist):
    """Packs the links of `robospa/` as links; MANIFEST.in leaves out what is behind them."""

    def make_release_tree(self, base_dir: str, files: Sequence[str]) -> None:
        super().make_release_tree(base_dir, files)
        for link in Path("robospa").iterdir():
            if link.is_symlink():
                (Path(base_dir) / link).symlink_to(os.readlink(link))


def page() -> str:
    """README.md for PyPI, whose links to files of the repository would lead nowhere: they lead to
    the release's tag once a workflow on GitHub names repository and tag."""
    text = Path("README.md").read_text()
    repository, tag = os.environ.get("GITHUB_REPOSITORY"), os.environ.get("GITHUB_REF_NAME")
    if not (repository and tag):
        return text
    at = f"https://github.com/{repository}"
    text = re.sub(r"(!\[[^]]*\]\()(?!http)", rf"\1{at}/raw/{tag}/", text)
    return re.sub(r"((?<!!)\[[^]]*\]\()(?!http)(?=[^)#])", rf"\1{at}/blob/{tag}/", text)


setup(
    cmdclass={"sdist": SourceArchive},
    long_description=page(),
    long_description_content_type="text/markdown",
)
