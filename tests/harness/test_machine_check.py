"""What a machine lacks, with healthy and with broken checks."""

from __future__ import annotations

import pytest

from robospa.harness import machine_check
from robospa.harness.sim.vulkan import Device


def test_a_passing_check_needs_nothing_done(capsys: pytest.CaptureFixture[str]) -> None:
    machine_check.report(lambda: "fine")
    assert capsys.readouterr().out == '{"ok": true, "detail": "fine"}\n'


def test_a_failing_check_says_why(capsys: pytest.CaptureFixture[str]) -> None:
    def broken() -> str:
        raise RuntimeError("no device")

    machine_check.report(broken)
    assert '"detail": "RuntimeError: no device"' in capsys.readouterr().out


def test_a_check_whose_process_dies_is_a_finding() -> None:
    check = machine_check._run("driver", "no_such_check", "install one")
    assert not check.ok
    assert check.fix == "install one"
    assert "AttributeError" in check.detail


@pytest.mark.parametrize(
    ("version", "too_old"),
    [
        ("Mesa 22.3.6", True),
        ("Mesa 24.2.8", True),
        ("Mesa 24.3.0", False),
        ("Mesa 25.0.7-2", False),
    ],
)
def test_an_old_software_driver_is_recognised(version: str, too_old: bool) -> None:
    assert Device("llvmpipe (LLVM 15)", "llvmpipe", version).too_old is too_old


def test_a_gpu_driver_is_never_too_old() -> None:
    assert not Device("GeForce", "NVIDIA", "535.1").too_old


@pytest.mark.sim
def test_all_checks_of_this_machine_are_named_and_have_a_fix_if_they_fail() -> None:
    checks = list(machine_check.run_checks())
    names = [c.name for c in checks]
    assert names[:4] == ["processor", "simulator", "physics", "vulkan device"]
    assert all(bool(c.fix) is not c.ok for c in checks)
