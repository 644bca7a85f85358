"""`robospa doctor`: can this machine simulate and render, and if not, what is to be done?

With --policy URL the policy's server is checked afterwards, as `robospa check` does.
"""

from __future__ import annotations

from typing import Annotated

import typer


def doctor(
    policy: Annotated[
        str | None,
        typer.Option(help="Policy server to check as well, such as ws://localhost:8000."),
    ] = None,
    token: Annotated[
        str | None, typer.Option(envvar="ROBOSPA_TOKEN", help="Bearer token of that server.")
    ] = None,
) -> None:
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
    console = Console()
    console.print(table)
    if policy is not None:
        from robospa.harness.cli.check import check as check_policy

        console.print()
        check_policy(policy, token, trials=0 if failed else 2)
    raise typer.Exit(1 if failed else 0)
