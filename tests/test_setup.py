"""The set-up script's decisions, made by its own functions; nothing is installed."""

from __future__ import annotations

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


def test_a_usable_device_is_left_alone(tmp_path: Path) -> None:
    assert setup(tmp_path, "vulkan_usable() { return 0; }; ensure_vulkan") == ""


def test_debian_12_takes_the_driver_from_backports(tmp_path: Path) -> None:
    said = setup(tmp_path, "ensure_vulkan")
    assert "adding the package source bookworm-backports" in said
    assert "install -y --no-install-recommends -t bookworm-backports mesa-vulkan-drivers" in said


def test_a_known_backports_source_is_not_added_again(tmp_path: Path) -> None:
    sources = tmp_path / "sources.list.d"
    sources.mkdir()
    (sources / "mine.sources").write_text("Suites: bookworm-backports\n")
    assert "adding the package source" not in setup(tmp_path, "ensure_vulkan")


@pytest.mark.parametrize("os_release", [DEBIAN_13, UBUNTU_2404])
def test_newer_systems_take_the_driver_from_their_archive(tmp_path: Path, os_release: str) -> None:
    said = setup(tmp_path, "ensure_vulkan", os_release)
    assert "install -y --no-install-recommends mesa-vulkan-drivers" in said
    assert "backports" not in said


def test_the_driver_is_announced_with_its_reason(tmp_path: Path) -> None:
    first = setup(tmp_path, "ensure_vulkan", DEBIAN_13).splitlines()[0]
    assert "software Vulkan driver" in first and "because SAPIEN finds no Vulkan device" in first


def test_without_root_the_command_to_run_is_printed(tmp_path: Path) -> None:
    said = setup(tmp_path, "root_prefix() { return 1; }; dry_run=0; ensure_vulkan", DEBIAN_13)
    assert "please run: sudo apt-get update && sudo apt-get install -y mesa-vulkan-drivers" in said
    assert "only physics will run" in said


def test_without_root_debian_12_is_told_how_to_add_backports(tmp_path: Path) -> None:
    said = setup(tmp_path, "root_prefix() { return 1; }; dry_run=0; ensure_vulkan")
    assert "bookworm-backports main' | sudo tee" in said
    assert "apt-get install -y -t bookworm-backports mesa-vulkan-drivers" in said


def test_a_failing_apt_gives_one_sentence(tmp_path: Path) -> None:
    fake = "env() { echo 'E: Unable to locate package nonsense'; return 100; }"
    said = setup(tmp_path, f"{fake}; dry_run=0; apt_install nonsense || echo refused")
    assert said.splitlines() == [
        "setup: apt-get could not install nonsense: E: Unable to locate package nonsense",
        "refused",
    ]


def test_a_missing_venv_module_is_installed_for_that_python(tmp_path: Path) -> None:
    said = setup(tmp_path, "can_make_venv() { return 1; }; ensure_venv")
    assert "-venv with apt, because" in said
    assert "-m venv --clear" in said


def test_an_old_python_is_refused(tmp_path: Path) -> None:
    said = setup(tmp_path, "python_ok() { return 1; }; ensure_venv")
    assert "installing python3 and python3-venv with apt" in said
    assert "set PYTHON to a newer one" in said


def test_locked_packages_are_installed_once(tmp_path: Path) -> None:
    (tmp_path / "venv").mkdir()
    body = f"cd {SCRIPT.parents[1]}; pip_install() {{ echo pip; }}; ensure_packages; dry_run=0; "
    said = setup(tmp_path, body + "ensure_packages; ensure_packages")
    assert said.count("pip\n") == 2  # the dry run leaves no stamp, the first real one does


def test_the_development_lock_covers_the_other_one(tmp_path: Path) -> None:
    (tmp_path / "venv").mkdir()
    body = f"cd {SCRIPT.parents[1]}; dry_run=0; pip_install() {{ echo pip; }}; "
    said = setup(
        tmp_path,
        body
        + "lock=requirements-dev.lock; ensure_packages; lock=requirements.lock; ensure_packages",
    )
    assert said.count("installing the packages") == 1


def test_unknown_options_are_refused(tmp_path: Path) -> None:
    assert "unknown option --fast" in setup(tmp_path, "main --fast")
