"""`robospa check`: can this machine simulate and render? `robospa check URL`: is this policy server
fit to be evaluated?

Of a server there are four parts: the protocol (`robospa.protocol.conformance`), the first actions
(`robospa.harness.convention_check.initial_actions`), a real trial run twice
(`robospa.harness.server_checks`), and with --demo the replay of a demonstration
(`robospa.harness.convention_check.check`). Exit code 1 if a check of the protocol or a real trial
failed, or if the replay names a mistake; hints, and a replay that does not fit, are only reported.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from robospa.harness.cli.options import DAYS, SECONDS, TRIALS, AsJson, Token, print_json
from robospa.harness.clock.policy_clock import latency_json
from robospa.text import plain_console

if TYPE_CHECKING:
    from rich.console import Console

    from robospa.clients.dialect import Dialect
    from robospa.harness.convention_check.check import Findings
    from robospa.harness.convention_check.episodes import Episode
    from robospa.harness.official.recordings import RecordingReplay
    from robospa.harness.server_checks import Load
    from robospa.protocol.client import RemotePolicy
    from robospa.protocol.conformance import CheckResult
    from robospa.protocol.transport import Timeouts

    Connect = Callable[[], RemotePolicy]

MARKS = {True: ("ok", "green"), False: ("FAILED", "red"), None: ("n/a", "dim")}
"""Mark of a check that passed, failed or does not apply, and its style."""
HINT = ("look", "yellow")
FIRST_ACTIONS = "first actions"
ANSWER_SECONDS = 120.0
LOAD_SECONDS = 5.0
SHOWN = 6
"""Mistakes in the table of the replay, beside the policy as it is."""


def check(
    url: Annotated[
        str | None,
        typer.Argument(
            help="a policy server, such as ws://localhost:8000; without it, this machine"
        ),
    ] = None,
    token: Token = None,
    wait: Annotated[
        float, typer.Option(callback=DAYS, help="seconds to wait until it listens")
    ] = 0.0,
    timeout: Annotated[
        float, typer.Option(callback=SECONDS, help="seconds that any one answer may take")
    ] = ANSWER_SECONDS,
    client: Annotated[
        Path | None,
        typer.Option(help="TOML or JSON file with options of its dialect; those in the URL win"),
    ] = None,
    demo: Annotated[
        Path | None,
        typer.Option(help="recorded demonstration (HDF5) to compare its answers with"),
    ] = None,
    instruction: Annotated[
        str | None, typer.Option(help="what to tell it in the demonstration, if the file does not")
    ] = None,
    points: Annotated[
        int,
        typer.Option(callback=TRIALS, help="frames of the demonstration at which it is queried"),
    ] = 8,
    trials: Annotated[
        int, typer.Option(min=0, help="how often to run a real trial, if there is a simulator")
    ] = 2,
    load_seconds: Annotated[
        float,
        typer.Option(
            callback=DAYS,
            help="seconds of load with 1, 4 and 8 clients each, to measure latency; 0 for none",
        ),
    ] = LOAD_SECONDS,
    as_json: AsJson = False,
) -> None:
    """Test a policy server: protocol, shapes, timing, first actions, real trials, and latency.

    Without a URL, check this machine: the simulator, the Vulkan device, a picture and a second of
    physics, with a fix for each failure.
    """
    console = plain_console(quiet=as_json)
    if url is None and (demo is not None or client is not None or instruction is not None):
        raise typer.BadParameter("--demo, --instruction and --client go with a server's URL")
    if url is None:
        _check_machine(console, as_json)
        return
    episode = None if demo is None else _episode(demo, instruction)  # before the server is asked
    target = target_of(url, token, timeout, wait, client)
    found = examine(console, target, trials, episode, points)
    if demo is not None and episode is not None and trials:
        found = replace(found, again=_again(console, demo, episode))
    if found.passed and load_seconds > 0.0:
        found = replace(found, loads=measured(console, target, load_seconds))
    if as_json:
        print_json(found.to_json())
    if not found.passed:
        raise typer.Exit(1)


def _check_machine(console: Console, as_json: bool) -> None:
    from rich.table import Table
    from rich.text import Text

    from robospa.harness.machine_check import run_checks

    found = list(run_checks())
    table = Table("", "check", "found", "what to do", box=None, pad_edge=False)
    for one in found:
        mark = Text("ok", "green") if one.ok else Text("no", "red")
        table.add_row(mark, one.name, one.detail, one.fix)
    console.print(table)
    if as_json:
        print_json({"checks": found})
    if not all(one.ok for one in found):
        raise typer.Exit(1)


@dataclass(frozen=True)
class ServerReport:
    """What was found out about a server; `replay` is None unless a demonstration was replayed."""

    url: str
    checks: Sequence[CheckResult]
    notes: Sequence[str]
    replay: Findings | None = None
    again: RecordingReplay | None = None
    """What came of the demonstration itself, played again in its scene."""
    loads: Sequence[Load] = ()
    """Its latency under load."""

    @property
    def failed(self) -> list[str]:
        """Names of the checks that failed."""
        return [result.name for result in self.checks if result.passed is False]

    @property
    def passed(self) -> bool:
        """Whether it can be evaluated: no check failed, and no mistake shows in the replay."""
        return not self.failed and (self.replay is None or self.replay.kind != "mistaken")

    def to_json(self) -> dict[str, object]:
        """Plain values; a check that does not apply, or only hints, has `passed` null."""
        data: dict[str, object] = {"url": self.url, "passed": self.passed}
        data |= {"checks": [asdict(result) for result in self.checks], "notes": list(self.notes)}
        if self.replay is not None:
            data["replay"] = {"kind": self.replay.kind, "sentence": self.replay.sentence}
        if self.again is not None:
            data["demonstration"] = {"success": self.again.success, "reason": self.again.reason}
        if self.loads:
            data["latency"] = [
                {"clients": load.clients, "per_second": load.per_second, "clock": load.clock}
                | latency_json(load.latency)
                for load in self.loads
            ]
        return data


def examine(
    console: Console, target: Target, trials: int, episode: Episode | None = None, points: int = 8
) -> ServerReport:
    """Run all checks of `target` and print what they find.

    Real trials are run if nothing failed before; `episode` is replayed if nothing failed at all.
    """
    from rich.text import Text

    found = ServerReport(target.url, _run_checks(console, target, trials), ())
    if "handshake" not in found.failed:
        found = replace(found, notes=_warnings(target.connect))
    for warning in found.notes:
        console.print(Text.assemble(("note", "yellow"), " ", warning))
    url = target.url
    if found.failed:
        text = f"{url} failed {len(found.failed)} of {len(found.checks)} checks."
        console.print(text, style="red")
        return found
    if episode is not None:
        found = replace(found, replay=_replay(console, target, episode, points))
    if found.passed and (hints := [one.name for one in found.checks if one.hint]):
        text = f"{url} can be evaluated, but look at its {' and '.join(hints)} before."
        console.print(text, style="yellow")
    elif found.passed:
        console.print(f"{url} can be evaluated.", style="green")
    return found


def measured(console: Console, target: Target, seconds: float) -> list[Load]:
    """The latency of `target` under load, printed with the `--clock` that stands for it; none of a
    policy that only a simulator can ask."""
    from rich.table import Table

    from robospa.harness.server_checks import CLIENTS, measure
    from robospa.protocol.policy import SKILL

    with target.connect() as policy:
        if policy.spec.privileged:
            return []
    loads = measure(
        target.connect, seconds, CLIENTS[:1] if target.dialect.shared_state else CLIENTS
    )
    table = Table("clients", "answers/s", "p5", "p50", "p95", "most [ms]", box=None)
    for load in loads:
        shown = [f"{load.latency.at(share):.1f}" for share in (0.05, 0.5, 0.95, 1.0)]
        table.add_row(str(load.clients), f"{load.per_second:.1f}", *shown)
    console.print("\nLatency of an answer, as its clients see it:")
    console.print(table)
    if policy.spec.action == SKILL:
        return loads
    console.print("In real time a robot alone at this server has")
    console.print(f"  --clock {loads[0].clock}", soft_wrap=True, highlight=False)
    for load in loads[1:]:
        console.print(f"one of {load.clients} robots")
        console.print(f"  --clock {load.clock}", soft_wrap=True, highlight=False)
    return loads


@dataclass(frozen=True)
class Target:
    """The server under test: its URL without options, and how to connect in its dialect."""

    url: str
    token: str | None
    timeouts: Timeouts
    connect: Connect
    dialect: Dialect


def target_of(
    url: str,
    token: str | None = None,
    timeout: float = ANSWER_SECONDS,
    wait: float = 0.0,
    client: Path | None = None,
) -> Target:
    """The server at `url`, with `timeout` seconds for an answer and `wait` until it listens.

    Raises BadParameter for a URL that is none, SettingsError for options that do not fit.
    """
    from robospa.clients import connect, find_endpoint
    from robospa.harness.running.request import client_options
    from robospa.protocol.transport import Timeouts

    limits = Timeouts(wait=wait, hello=timeout, reset=timeout, first_infer=timeout, infer=timeout)
    try:
        dialect = find_endpoint(url).dialect
    except ValueError as error:
        raise typer.BadParameter(str(error)) from error
    options = client_options(url, client)
    connector = partial(connect, url, token, limits, options=options)
    return Target(url.partition("?")[0], token, limits, connector, dialect)


def _episode(demo: Path, instruction: str | None) -> Episode:
    from robospa.harness.convention_check.episodes import EpisodeError, read_episode

    episode = read_episode(demo, instruction)
    if not episode.instruction:
        raise EpisodeError(f"{demo} has no instruction; add --instruction TEXT")
    return episode


def _run_checks(console: Console, target: Target, trials: int) -> list[CheckResult]:
    from rich.table import Table
    from rich.text import Text

    from robospa.clients.dialect import dialects
    from robospa.harness.server_checks import rollouts
    from robospa.protocol.conformance import OURS
    from robospa.protocol.conformance import check as check_protocol

    spoken = {OURS if one.scheme == "ws" else one.scheme: one for one in dialects()}
    results = check_protocol(
        target.url,
        target.token,
        timeouts=target.timeouts,
        connector=target.connect,
        shared_state=target.dialect.shared_state,
        sign=lambda name: spoken.get(name, target.dialect).sign,
    )
    failed = {result.name for result in results if result.passed is False}
    if not failed & {"handshake", "actions"}:
        results.append(_first_actions(target.connect))
    if not failed and trials:
        results += rollouts(target.connect, trials)
    table = Table("check", "", "seen", box=None)
    for result in results:
        mark = Text(*(HINT if result.hint else MARKS[result.passed]))
        table.add_row(result.name, mark, result.detail)
    console.print(table)
    return results


def _first_actions(connect: Connect) -> CheckResult:
    """The check of the first actions; passed, or None with what looks suspicious."""
    from robospa.harness.convention_check.initial_actions import hints
    from robospa.protocol.conformance import CheckResult
    from robospa.protocol.errors import WireError

    try:
        with connect() as policy:
            found, seen = hints(policy)
    except WireError as error:
        found, seen = [str(error)], ""
    text = "; ".join(found) or seen
    return CheckResult(FIRST_ACTIONS, None if found else True, text, hint=bool(found))


def _warnings(connect: Connect) -> list[str]:
    """What cannot be seen on the wire of this dialect, in sentences; none if the server is gone."""
    from robospa.protocol.errors import WireError

    try:
        with connect() as policy:
            found = policy.hello.get("warnings")
            return list(map(str, found)) if isinstance(found, list) else []
    except WireError:
        return []


def _replay(console: Console, target: Target, episode: Episode, points: int) -> Findings:
    from robospa.harness.convention_check.check import check_conventions

    with target.connect() as policy:
        findings = check_conventions(policy, episode, points)
        chosen = policy.hello.get("options")  # a robospa.v1 server leaves nothing to choose
    known = chosen if isinstance(chosen, Mapping) else {}
    options = {m: name for m, name in target.dialect.deciding_options.items() if name in known}
    show(console, findings, episode.name, options)
    return findings


def _again(console: Console, demo: Path, episode: Episode) -> RecordingReplay | None:
    from robospa.harness.official.recordings import recording_of, replay_recording

    try:
        from robospa.harness.sim.sapien_world import SapienWorld

        found = replay_recording(recording_of(demo), SapienWorld(render=False), episode)
    except ImportError:
        return None
    if found.success is None:
        text = f"The demonstration was not played again: {found.reason}."
    elif found.success:
        text = "Played again in its scene, the demonstration meets its goal."
    else:
        text = f"Played again in its scene, the demonstration misses its goal ({found.reason})."
    console.print(text, style="dim" if found.success is None else "")
    return found


def show(console: Console, findings: Findings, name: str, options: Mapping[str, str]) -> None:
    """The table of the replay, its sentence and, by mistake, the option that decides it."""
    from rich.table import Table

    asked = ", ".join(str(t) for t in findings.frames)
    console.print(f"\nReplay of {name}, asked at frames {asked}; mean errors:")
    table = Table("if undone", *findings.groups, "error", "helps at", box=None)
    rows = [findings.base, *findings.guesses[:SHOWN]]
    if findings.best is not None and findings.best not in rows:
        rows.insert(1, findings.best)
    for guess in [*rows, findings.still]:
        label = "(a policy that holds still)" if guess is findings.still else guess.label
        share = f"{guess.helped:.0%}" if guess.names else ""
        style = "bold" if guess is findings.best else ""
        table.add_row(label, *findings.describe(guess), f"{guess.score:.2f}", share, style=style)
    console.print(table)
    for text in findings.untried:
        console.print(f"Not tried: {text}.", style="dim")
    color = {"fits": "green", "mistaken": "red", "unclear": "yellow"}[findings.kind]
    console.print(findings.sentence, style=color)
    if findings.best is not None:
        names = [options[mistake] for mistake in findings.best.names if mistake in options]
        if names:
            console.print(f"See option {' and '.join(dict.fromkeys(names))} of its dialect.")
