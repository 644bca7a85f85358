"""A bundle that lies in the repository, in its submission's folder, so that a clone can verify it.

Only a small one, and only of a model whose weights a recipe of this repository remakes: all others
stay at an address of their own. It is held to more than those: all of its trials are replayed,
since whoever hands it in may also make the commit that would choose a sample.
"""

from __future__ import annotations

from pathlib import Path

from robospa.leaderboard import bundle as layout
from robospa.leaderboard.archive import Archive
from robospa.leaderboard.bundle import MEGA, BundleError, Limits, Manifest
from robospa.leaderboard.card import Card, recipe_of

FILE = "bundle.zip"
"""Its name, and what `bundle.txt` says instead of an address."""
MOST = 8 * MEGA
"""The most bytes that it may have: a repository never becomes smaller again."""


def size_of(folder: Path) -> int:
    """Bytes of the bundle in `folder`; BundleError unless it is a plain file and small enough."""
    path = folder / FILE
    if path.is_symlink() or not path.is_file():
        raise BundleError(f"{path} is missing or no plain file")
    size = path.stat().st_size
    if size > MOST:
        raise BundleError(
            f"{path} has {size} bytes; a bundle in the repository has at most {MOST}, a larger one "
            "is downloaded from a https address"
        )
    return size


def check_weights(card: Card, where: str) -> None:
    """BundleError unless all weights of `card` are remade by a recipe of this repository."""
    if strange := [p.reference for p in card.checkpoints.values() if not recipe_of(p.reference)]:
        raise BundleError(
            f"{where}: a bundle lies in the repository only if a recipe there remakes the weights, "
            f"which are at {strange[0][:80]}; give the bundle a https address"
        )


def check_recipes(card: Card, clone: Path) -> None:
    """BundleError unless every recipe that `card` names is a script in `clone`."""
    for source in (card.link, *(point.reference for point in card.checkpoints.values())):
        script = recipe_of(source)
        if script and not (clone / script).is_file():
            raise BundleError(f"the model card names {script}, which this repository does not have")


def check_contents(folder: Path, manifest: Manifest, where: str) -> None:
    """BundleError unless the bundle in `folder` holds the files that `manifest` lists."""
    size_of(folder)
    with Archive(folder / FILE, Limits(packed=MOST)) as archive:
        if set(archive.sizes) != {*manifest.files, layout.MANIFEST}:
            raise BundleError(f"{where}: {FILE} has other files than the manifest lists")
        for name, listed in manifest.files.items():
            if layout.sha256(archive.read(name)) != listed.sha256:
                raise BundleError(f"{where}: {name} in {FILE} is not the manifest's")
