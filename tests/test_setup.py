"""The set-up script's decisions, made by its own functions; nothing is installed."""

import os
import subprocess
from pathlib import Path

import pytest

SCRIPT = Path(__file__).resolve().parents[1] / "scripts" / "setup.sh"

DEBIAN_12 = 'ID=debian\nVERSION_ID="12"\n'
DEBIAN_13 = 'ID=debian\nVERSION_ID="13"\n'
UBUNTU_2404 = 'ID=ubuntu\nVERSION_ID="24.04"\n'
ARCH = "ID=arch\n"


def setup(folder: Path, body: str, os_release: str = DEBIAN_12) -> str:
    """What `body` prints when run after the script's functions are defined."""
    (folder / "os-release").write_text(os_release)
    head = (
        f"source {SCRIPT}; dry_run=1; venv={folder}/venv; apt_sources={folder}/sources.list.d\n"
        "vulkan_usable() { return 1; }; root_prefix() { echo; }\n"
        'apt-get() { if [ "$1" = indextargets ]; then echo http://mirror.example/debian; fi; }\n'
    )
    done = subprocess.run(
        ["bash", "-c", head + body],
        capture_output=True,
        text=True,
        timeout=30,
        env={**os.environ, "ROBOSPA_OS_RELEASE": str(folder / "os-release")},
    )
    return done.stdout + done.stderr


@pytest.mark.parametrize(
    ("os_release", "source"),
    [
        (DEBIAN_12, "backports"),
        (DEBIAN_13, "archive"),
        (UBUNTU_2404, "archive"),
        ('ID=ubuntu\nVERSION_ID="22.04"\n', "unknown"),
        (ARCH, "unknown"),
        ("", "unknown"),
    ],
)
def test_where_mesa_comes_from(tmp_path: Path, os_release: str, source: str) -> None:
    assert setup(tmp_path, "vulkan_source", os_release).strip() == source


NO_ROOT = "root_prefix() { return 1; }; dry_run=0; ensure_vulkan"
FAILING = "env() { echo 'E: Unable to locate package x'; return 100; }; dry_run=0; apt_install x"
NEEDED = "because SAPIEN finds no Vulkan device"


@pytest.mark.parametrize(
    ("os_release", "body", "words"),
    [
        (DEBIAN_12, "ensure_vulkan", ["adding the package source bookworm-backports", NEEDED]),
        (DEBIAN_12, "ensure_vulkan", ["recommends -t bookworm-backports mesa-vulkan-drivers"]),
        (DEBIAN_13, "ensure_vulkan", ["--no-install-recommends mesa-vulkan-drivers", NEEDED]),
        (UBUNTU_2404, "ensure_vulkan", ["--no-install-recommends mesa-vulkan-drivers"]),
        (DEBIAN_13, NO_ROOT, ["please run: sudo apt-get update && ", "only physics will run"]),
        (DEBIAN_12, NO_ROOT, ["bookworm-backports main' | sudo tee", "-y -t bookworm-backports "]),
        (DEBIAN_12, FAILING, ["apt-get could not install x: E: Unable to locate package x\n"]),
        (
            ARCH,
            "can_make_venv() { return 1; }; ensure_venv",
            ["-venv with apt, because", "--clear"],
        ),
        (ARCH, "python_ok() { return 1; }; ensure_venv", ["set PYTHON to a newer one"]),
        (ARCH, "main --fast", ["unknown option --fast"]),
    ],
)
def test_what_is_done_or_said(tmp_path: Path, os_release: str, body: str, words: list[str]) -> None:
    said = setup(tmp_path, body, os_release)
    assert [word for word in words if word not in said] == []


def test_what_is_there_is_not_brought_again(tmp_path: Path) -> None:
    assert setup(tmp_path, "vulkan_usable() { return 0; }; ensure_vulkan") == ""
    sources = tmp_path / "sources.list.d"
    sources.mkdir()
    (sources / "mine.sources").write_text("Suites: bookworm-backports\n")
    assert "adding the package source" not in setup(tmp_path, "ensure_vulkan")
    (tmp_path / "venv").mkdir()
    body = f"cd {SCRIPT.parents[1]}; pip_install() {{ echo pip; }}; ensure_packages; dry_run=0; "
    body += "lock=requirements-dev.lock; ensure_packages; lock=requirements.lock; ensure_packages"
    # The dry run leaves no stamp, the first real one does: the development lock has the other's.
    assert setup(tmp_path, body).count("installing the packages") == 2
