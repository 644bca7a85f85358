"""`robospa check URL`: is this policy server fit to be evaluated?

Four parts: the protocol (`robospa.protocol.conformance`), the first actions
(`robospa.harness.convention_check.initial_actions`), a real trial run twice
(`robospa.harness.conformance_rollout`), and with --demo the replay of a demonstration
(`robospa.harness.convention_check.check`). Exit code 1 if a check of the protocol or a real trial
failed, or if the replay names a mistake; hints, and a replay that does not fit, are only reported.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from rich.console import Console

    from robospa.harness.convention_check.check import Findings
    from robospa.harness.convention_check.episodes import Episode
    from robospa.protocol.client import RemotePolicy
    from robospa.protocol.conformance import CheckResult
    from robospa.protocol.transport import Timeouts

    Connect = Callable[[], RemotePolicy]

MARKS = {True: "[green]ok[/]", False: "[red]FAILED[/]", None: "[dim]n/a[/]"}
SHOWN = 6
"""Mistakes in the table of the replay, beside the policy as it is."""


def check(
    url: Annotated[str, typer.Argument(help="Policy server, such as ws://localhost:8000.")],
    token: Annotated[
        str | None, typer.Option(envvar="ROBOSPA_TOKEN", help="Bearer token of the server.")
    ] = None,
    wait: Annotated[float, typer.Option(help="Seconds to wait until it listens.")] = 0.0,
    timeout: Annotated[float, typer.Option(help="Seconds that any one answer may take.")] = 120.0,
    client: Annotated[
        Path | None,
        typer.Option(help="JSON file with options of the server's dialect; those in the URL win."),
    ] = None,
    demo: Annotated[
        Path | None,
        typer.Option(help="Recorded demonstration (HDF5) to compare its answers with."),
    ] = None,
    instruction: Annotated[
        str | None, typer.Option(help="What to tell it in the demonstration, if the file does not.")
    ] = None,
    points: Annotated[int, typer.Option(help="Frames of the demonstration to ask it at.")] = 8,
    trials: Annotated[
        int, typer.Option(min=0, help="How often to run a real trial, if there is a simulator.")
    ] = 2,
) -> None:
    """Talk to a policy server in every way that an evaluation will, and say what it gets wrong."""
    from rich.console import Console
    from rich.markup import escape

    from robospa.protocol.transport import Timeouts

    limits = Timeouts(wait=wait, hello=timeout, reset=timeout, first_infer=timeout, infer=timeout)
    target = _target(url, token, limits, client)
    episode = None if demo is None else _episode(demo, instruction)  # before the server is asked
    console = Console()
    results = _run_checks(console, target, trials)
    failed = [result.name for result in results if result.passed is False]
    if "handshake" not in failed:
        for warning in _warnings(target.connect):
            console.print(f"[yellow]note[/] {escape(warning)}")
    if failed:
        console.print(f"{escape(url)} failed {len(failed)} of {len(results)} checks.", style="red")
        raise typer.Exit(1)
    if episode is not None and not _replay(console, target, episode, points):
        raise typer.Exit(1)
    console.print(f"{escape(url)} can be evaluated.", style="green")


@dataclass(frozen=True)
class _Target:
    """The server under test: its URL without options, and how to connect in its dialect."""

    url: str
    token: str | None
    timeouts: Timeouts
    connect: Connect
    deciding_options: Mapping[str, str]
    """Mistakes that a demonstration may show, to the option of the dialect that decides them."""


def _target(url: str, token: str | None, timeouts: Timeouts, client: Path | None) -> _Target:
    """Raises BadParameter for a URL that is none, SettingsError for options that do not fit."""
    from robospa.clients import connect, find_endpoint
    from robospa.harness.running.request import client_options

    try:
        dialect = find_endpoint(url).dialect
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error
    options = client_options(url, client)
    connector = partial(connect, url, token, timeouts, options=options)
    return _Target(url.partition("?")[0], token, timeouts, connector, dialect.deciding_options)


def _episode(demo: Path, instruction: str | None) -> Episode:
    from robospa.harness.convention_check.episodes import EpisodeError, read_episode

    episode = read_episode(demo, instruction)
    if not episode.instruction:
        raise EpisodeError(f"{demo} has no instruction; add --instruction TEXT")
    return episode


def _run_checks(console: Console, target: _Target, trials: int) -> list[CheckResult]:
    """Check protocol, first actions and, if all is well, real trials; print them in one table."""
    from rich.markup import escape
    from rich.table import Table

    from robospa.harness.conformance_rollout import rollouts
    from robospa.protocol.conformance import check as check_protocol

    results = check_protocol(
        target.url,
        target.token,
        timeouts=target.timeouts,
        connector=target.connect,
    )
    failed = {result.name for result in results if result.passed is False}
    table = Table("check", "", "seen", box=None)
    for result in results:
        table.add_row(result.name, MARKS[result.passed], escape(result.detail))
    if not failed & {"handshake", "actions"}:
        table.add_row("first actions", *_first_actions(target.connect))
    if not failed and trials:
        for result in rollouts(target.connect, trials):
            results.append(result)
            table.add_row(result.name, MARKS[result.passed], escape(result.detail))
    console.print(table)
    return results


def _first_actions(connect: Connect) -> tuple[str, str]:
    """Mark and text of the row about the first actions."""
    from rich.markup import escape

    from robospa.harness.convention_check.initial_actions import hints
    from robospa.protocol.errors import WireError

    try:
        with connect() as policy:
            found, seen = hints(policy)
    except WireError as error:
        found, seen = [str(error)], ""
    if found:
        return "[yellow]look[/]", escape("; ".join(found))
    return "[green]ok[/]", escape(seen)


def _warnings(connect: Connect) -> list[str]:
    """What cannot be seen on the wire of this dialect, in sentences; none if the server is gone."""
    from robospa.protocol.errors import WireError

    try:
        with connect() as policy:
            return [str(text) for text in policy.hello.get("warnings", ())]
    except WireError:
        return []


def _replay(console: Console, target: _Target, episode: Episode, points: int) -> bool:
    """Compare the policy's answers with a demonstration; False if a mistake was found."""
    from robospa.harness.convention_check.check import replay

    with target.connect() as policy:
        findings = replay(policy, episode, points)
        chosen = policy.hello.get("options", {})  # a robospa.v1 server leaves nothing to choose
    options = {m: name for m, name in target.deciding_options.items() if name in chosen}
    show(console, findings, episode.name, options)
    return findings.kind != "mistaken"


def show(console: Console, findings: Findings, name: str, options: Mapping[str, str]) -> None:
    """The table of the replay, its sentence and, by mistake, the option that decides it."""
    from rich.markup import escape
    from rich.table import Table

    asked = ", ".join(str(t) for t in findings.frames)
    console.print(f"\nReplay of {escape(name)}, asked at frames {asked}; mean errors:")
    table = Table("if undone", *findings.groups, "error", "helps at", box=None)
    rows = [findings.base, *findings.guesses[:SHOWN]]
    if findings.best is not None and findings.best not in rows:
        rows.insert(1, findings.best)
    for guess in [*rows, findings.still]:
        label = "(a policy that holds still)" if guess is findings.still else guess.label
        share = f"{guess.helped:.0%}" if guess.names else ""
        style = "bold" if guess is findings.best else ""
        table.add_row(
            escape(label), *findings.describe(guess), f"{guess.score:.2f}", share, style=style
        )
    console.print(table)
    for text in findings.untried:
        console.print(f"Not tried: {escape(text)}.", style="dim")
    color = {"fits": "green", "mistaken": "red", "unclear": "yellow"}[findings.kind]
    console.print(escape(findings.sentence), style=color)
    if findings.best is not None:
        names = [options[mistake] for mistake in findings.best.names if mistake in options]
        if names:
            console.print(f"See option {' and '.join(dict.fromkeys(names))} of its dialect.")
