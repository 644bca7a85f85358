"""The source archive is complete, and what is installed from it is the whole package."""

import os
import re
import shutil
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
SKIPPED = shutil.ignore_patterns(
    ".git", ".venv*", ".cache", ".*_cache", ".hypothesis", "__pycache__", "*.egg-info",
    "build", "dist", "runs", "site",
)  # fmt: skip
HOST = re.compile(r"(?:https?|file)://(?!127\.0\.0\.1|localhost)[^\s\"']+")


def _build(folder: Path, kind: str, out: Path) -> Path:
    """The archive of `kind` that setuptools makes of the sources in `folder`, as a release."""
    call = f"from setuptools import build_meta as b; print(b.build_{kind}({str(out)!r}))"
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", call],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=120,
        env={**os.environ, "PYTHONPATH": "", "GITHUB_REPOSITORY": "a/b", "GITHUB_REF_NAME": "v1"},
    )
    assert done.returncode == 0, done.stderr
    return out / done.stdout.splitlines()[-1]


@pytest.fixture(scope="module")
def unpacked(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The source archive, built from a copy of this tree and unpacked."""
    folder = tmp_path_factory.mktemp("packaging")
    shutil.copytree(ROOT, folder / "tree", symlinks=True, ignore=SKIPPED)
    with tarfile.open(_build(folder / "tree", "sdist", folder)) as archive:
        archive.extractall(folder / "unpacked", filter="data")
    (found,) = (folder / "unpacked").iterdir()
    return found


def _files(folder: Path) -> set[str]:
    """Paths of all files below `folder`; links to folders are not followed."""
    names = {
        str((Path(at) / name).relative_to(folder))
        for at, _, names in os.walk(folder)
        for name in names
    }
    return {name for name in names if "__pycache__" not in name and ".egg-info" not in name}


def test_the_source_archive_is_the_repository(unpacked: Path) -> None:
    made = {"PKG-INFO", "setup.cfg"}
    assert _files(unpacked) - made == _files(unpacked.parents[1] / "tree")
    for name in ("docs/runs.md", "tests/harness/test_settings.py", "scripts/setup.sh", "Makefile"):
        assert (unpacked / name).is_file(), name
    links = {link.name for link in (ROOT / "robospa").iterdir() if link.is_symlink()}
    assert {link.name for link in (unpacked / "robospa").iterdir() if link.is_symlink()} == links


def test_a_wheel_of_the_source_archive_has_every_file_of_the_package(unpacked: Path) -> None:
    folders = [link.name for link in (ROOT / "robospa").iterdir() if link.is_symlink()]
    expected = {
        f"robospa/{name}/{path}" for name in folders for path in _files(unpacked / name)
    } | {f"robospa/{path.name}" for path in (unpacked / "robospa").iterdir() if path.is_file()}
    expected = {name for name in expected if "/submissions/" not in name}  # data of the site
    with zipfile.ZipFile(_build(unpacked, "wheel", unpacked.parents[1])) as wheel:
        packed = {name for name in wheel.namelist() if ".dist-info/" not in name}
        (about,) = (name for name in wheel.namelist() if name.endswith("/METADATA"))
        page = wheel.read(about).decode()
    assert packed == expected
    links = re.findall(r"(!?)\[[^]]*\]\(([^)]+)\)", page)
    assert [link for _, link in links if not link.startswith("https://")] == []
    assert {link.split("/")[5] for image, link in links if image} == {"raw"}


@pytest.mark.parametrize("name", ["Makefile", "scripts/setup.sh", "scripts/models.sh"])
def test_set_up_names_no_package_index(name: str) -> None:
    """pip and apt use what the machine is configured for."""
    assert HOST.findall((ROOT / name).read_text()) == []


def test_a_release_is_of_the_version_that_its_tag_names() -> None:
    """The workflow compares lines of these files with the tag; they have to look like that."""
    version = re.search(r'^version = "([\d.]+)"$', (ROOT / "pyproject.toml").read_text(), re.M)
    assert version is not None
    assert f"\n## [{version[1]}]" in (ROOT / "CHANGELOG.md").read_text()
    workflow = (ROOT / ".github" / "workflows" / "release.yml").read_text()
    assert "id-token: write" in workflow and "vars.PUBLISH_TO_PYPI == 'yes'" in workflow
    assert not re.search(r"secrets\.|password:|PYPI_TOKEN", workflow), "no stored password"
