"""`robospa doctor`: can this machine simulate and render, and if not, what is to be done?"""

from __future__ import annotations

import typer


def doctor() -> None:
    """Check the simulator, the Vulkan device, a frame and a second of physics."""
    from rich.console import Console
    from rich.table import Table

    from robospa.harness.doctor import run_checks

    table = Table("", "check", "found", "what to do", box=None, pad_edge=False)
    failed = False
    for check in run_checks():
        failed = failed or not check.ok
        mark = "[green]ok[/]" if check.ok else "[red]no[/]"
        table.add_row(mark, check.name, check.detail, check.fix)
    Console().print(table)
    raise typer.Exit(1 if failed else 0)
