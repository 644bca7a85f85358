"""Packages that not everybody needs: where one is missing, what brings it; and the user's cache.

`pip install robospa` stays small; everything else is an extra of pyproject.toml.
"""

import json
import os
import sys
from importlib import import_module, metadata
from pathlib import Path
from types import ModuleType

EXTRAS = {
    "jinja2": "report",
    "matplotlib": "report",
    "scipy": "report",
    "sapien": "sim",
    "av": "sim",
    "ray": "ray",
    "h5py": "demos",
    "PIL": "demos",
    "pandas": "notebook",
    "pyarrow": "notebook",
    "trimesh": "assets",
    "torch": "learn",
    "gymnasium": "gym",
    "wandb": "wandb",
    "openai": "agent",
    "viser": "view",
}
"""Module -> the extra that brings it."""
OTHERWISE = {"torch": "torch --index-url https://download.pytorch.org/whl/cpu"}
"""Module -> what pip is told: PyPI's own builds bring several GB for CUDA, and ours need a CPU."""


class MissingPackage(ModuleNotFoundError):
    """A package of an extra is not installed; the message says what installs it."""


def need(module: str, extra: str = "") -> ModuleType:
    """The `module` of an extra, imported; raises MissingPackage if its package is not installed.

    `extra` is named then in place of the one in EXTRAS: a larger one that brings more.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        top = module.partition(".")[0]
        if error.name is None or error.name.partition(".")[0] != top:
            raise
        raise MissingPackage(f"{top} is not installed; {remedy(top, extra)}", name=top) from error


def remedy(module: str, extra: str = "") -> str:
    """What installs `module`, as the end of a sentence."""
    wanted = extra or EXTRAS.get(module)
    if not wanted or module in OTHERWISE:
        return f"install it with: pip install {OTHERWISE.get(module, module)}"
    return f"install it with: pip install '{source()}[{wanted}]'"


def source() -> str:
    """What pip installed robospa from: the folder of a clone, else its name in an index."""
    try:
        text = metadata.distribution("robospa").read_text("direct_url.json") or "{}"
        url = str(json.loads(text).get("url", ""))
    except (metadata.PackageNotFoundError, ValueError):
        return "robospa"
    return url.removeprefix("file://") if url.startswith("file://") else "robospa"


VARIABLE = "ROBOSPA_CACHE"
"""Environment variable that names another folder."""


def user_cache() -> Path:
    """The folder of all caches: $ROBOSPA_CACHE, or `robospa` where the platform keeps caches.

    That is $XDG_CACHE_HOME or ~/.cache; ~/Library/Caches on macOS; %LOCALAPPDATA% on Windows.
    """
    if named := os.environ.get(VARIABLE):
        return Path(named)
    home = Path(os.path.expanduser("~"))
    if sys.platform == "darwin":
        return home / "Library" / "Caches" / "robospa"
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or home / "AppData" / "Local") / "robospa"
    return Path(os.environ.get("XDG_CACHE_HOME") or home / ".cache") / "robospa"
