"""The user's copy of the official assets: where it is, which of its files belong to a model, and
what was made of them, kept in this user's cache by their content.

Nothing of it is in this package, and nothing is ever written into it. A file that lies outside,
however its path is written, is refused. Entries of the cache are whole or not there: they are
written under another name and then moved.
"""

import contextlib
import hashlib
import json
import os
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from robospa.extras import user_cache
from robospa.tasks.official import OfficialModel
from robospa.tasks.packs import PackError

Arrays = Mapping[str, NDArray[Any]]
VARIABLE = "ROBOSPA_ASSETS"
"""Environment variable that names the folder."""
PARTS = ("objects", "embodiments", "background_texture")
"""Its folders, each unpacked from one of the official archives; any may be missing."""
ADVICE = "unpack objects.zip, embodiments.zip or background_texture.zip of the official data there"


class ArchiveError(PackError):
    """Something of the archive cannot be used; the message is one sentence for its owner."""


@dataclass(frozen=True)
class ModelFiles:
    """The files of a model: `urdf` if it has joints, else `visual` and `collision` meshes (the
    visual one twice where there is no other), and the JSON of its points."""

    data: Path
    visual: Path | None = None
    collision: Path | None = None
    urdf: Path | None = None


@dataclass(frozen=True)
class Archive:
    """The folder `root` that holds `PARTS`."""

    root: Path

    def inside(self, path: Path) -> Path:
        """`path` without links; ArchiveError unless it lies in one of the parts."""
        try:
            found = path.resolve()
            roots = [(self.root / part).resolve() for part in PARTS]
        except (OSError, RuntimeError, ValueError) as error:  # links that lead to each other
            raise ArchiveError(f"{str(path)!r} cannot be followed: {error}") from None
        if any(found.is_relative_to(root) for root in roots):
            return found
        raise ArchiveError(f"{str(path)!r} leads out of the assets' folder and is not read")

    def files(self, model: OfficialModel) -> ModelFiles:
        """The model's files. ArchiveError, naming the first that is missing or closed to us."""
        folder, name = self.root / "objects" / model.folder, f"base{model.model}.glb"
        meshes = folder / "visual" / name, folder / name, folder / f"textured{model.model}.obj"
        collision = folder / "collision" / name
        try:
            if model.jointed:
                return ModelFiles(
                    data=self._existing(folder / model.model / "model_data.json"),
                    urdf=self._existing(folder / model.model / "mobility.urdf"),
                )
            visual = self._existing(next((path for path in meshes if path.is_file()), meshes[0]))
            return ModelFiles(
                data=self._existing(folder / f"model_data{model.model}.json"),
                visual=visual,
                collision=self.inside(collision) if collision.is_file() else visual,
            )
        except OSError as error:
            raise ArchiveError(f"{str(error.filename)!r}: {error.strerror}") from None

    def _existing(self, path: Path) -> Path:
        if not path.is_file():
            raise ArchiveError(
                f"{str(path.relative_to(self.root))!r} is missing in the assets' folder "
                f"{str(self.root)!r}; {ADVICE}"
            )
        return self.inside(path)


def read_json(path: Path, most: int) -> Any:
    """The JSON in a file of the archive; ArchiveError if it is none or has more bytes."""
    try:
        if path.stat().st_size > most:
            raise ArchiveError(f"{str(path)!r} is larger than {most >> 20} MB")
        return json.loads(path.read_bytes())
    except ArchiveError:
        raise
    except (OSError, ValueError, RecursionError) as error:
        raise ArchiveError(f"{str(path)!r} is no readable JSON file: {error}") from error


def noted() -> Path:
    """The file in which `robospa official assets --add` notes the folder."""
    return user_cache() / "assets_folder"


def open_archive(path: Path | str | None = None) -> Archive:
    """The archive at `path`, or in ROBOSPA_ASSETS, or as `robospa official assets --add` noted it.
    A folder whose `assets` folder holds the parts, such as a RoboTwin checkout, will do as well.
    ArchiveError, saying what to do, if none is named or it holds none of the parts."""
    named = path or os.environ.get(VARIABLE) or _note()
    if not named:
        raise ArchiveError(
            "no folder of official assets is known; name it with `robospa official assets DIR "
            f"--add` or {VARIABLE}"
        )
    folder = Path(named).expanduser()
    try:
        for root in (folder, folder / "assets"):
            if any((root / part).is_dir() for part in PARTS):
                return Archive(root.absolute())
        state = f"holds none of {', '.join(PARTS)}" if folder.is_dir() else "does not exist"
        state = "is a file, not a folder" if folder.is_file() else state
    except (OSError, ValueError) as error:  # no right to look into it, or a name that none can have
        raise ArchiveError(f"the folder of official assets {str(folder)!r}: {error}") from None
    raise ArchiveError(f"the folder of official assets {str(folder)!r} {state}; {ADVICE}")


def _note() -> str:
    try:
        return noted().read_text("utf-8").strip()
    except OSError:
        return ""


def note(archive: Archive) -> None:
    """Use `archive` from now on, where nothing else is named."""
    noted().parent.mkdir(parents=True, exist_ok=True)
    noted().write_text(f"{archive.root}\n", "utf-8")


CACHE_VERSION = 2
"""Raised whenever the same file gives something else."""


def cache_folder() -> Path:
    """Where entries are."""
    return user_cache() / "packs"


def content_hash(path: Path) -> str:
    """SHA-256 of the file, taken once as long as its size and time of change stay the same."""
    state = path.stat()
    seen = f"{path}\n{state.st_size}\n{state.st_mtime_ns}".encode()
    noted_hash = cache_folder() / "hashes" / hashlib.sha256(seen).hexdigest()[:32]
    with contextlib.suppress(OSError):
        if len(kept := noted_hash.read_text("ascii")) == 64:
            return kept
    with path.open("rb") as file:
        found = hashlib.file_digest(file, "sha256").hexdigest()
    _write(noted_hash, lambda file: file.write(found.encode()))
    return found


def cached(files: tuple[Path, ...], how: str, make: Callable[[], Arrays]) -> Path:
    """The .npz file of the arrays that `make` makes of `files`; `how` says in which way."""
    text = "\n".join([str(CACHE_VERSION), how, *map(content_hash, files)])
    entry = cache_folder() / f"{hashlib.sha256(text.encode()).hexdigest()[:40]}.npz"
    if not entry.exists():
        made = make()
        _write(entry, lambda file: np.savez(file, **made))  # type: ignore[arg-type]
    return entry


def load_arrays(entry: Path, *names: str) -> Arrays:
    """The arrays of an entry, or those called `names`.

    ValueError, after throwing it away, if it is damaged."""
    try:
        with np.load(entry, allow_pickle=False) as file:
            return {name: file[name] for name in names or file.files}
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile) as error:
        entry.unlink(missing_ok=True)
        raise ValueError(f"the cache entry {str(entry)!r} was damaged: start again") from error


def _write(path: Path, fill: Callable[[BinaryIO], object]) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f"{path.name}.{os.getpid()}.part")
    with partial.open("wb") as file:
        fill(file)
    partial.replace(path)
