"""`robospa plan`: how many of the selected trials are enough, and what they cost, before a run."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

from robospa.harness.cli.json_output import AsJson, print_json
from robospa.harness.cli.settings_flags import MoreServers, Token, given_flags, with_flags
from robospa.harness.settings import GROUPS, EvaluationSettings, Selection, updated
from robospa.text import duration_text

if TYPE_CHECKING:
    from robospa.harness.running.cost_probe import Cost

BUDGETS = (560, 1400, 2800)
"""Numbers of trials whose half width is shown, beside that of all."""


@with_flags(
    [Selection, *(GROUPS[name] for name in ("simulation", "timing", "connection", "compute"))],
    hidden=["parts"],
)
def plan(
    context: typer.Context,
    policy: Annotated[
        str | None,
        typer.Argument(
            help="a server's URL, or a local policy's name or module:Class: a sample of the trials "
            "is run, and says what all of them will cost"
        ),
    ] = None,
    more: MoreServers = None,
    seconds: Annotated[
        float, typer.Option(min=1.0, help="with a policy: for so long the sample takes up trials")
    ] = 60.0,
    token: Token = None,
    as_json: AsJson = False,
    **given: object,
) -> None:
    """Say how many of the selected trials are enough, if rates are like the published models', and,
    with a policy, what all of them will cost: time, queries, processor and server hours.

    Nothing is kept of the sample; `robospa eval` with the same flags runs the trials.
    """
    from robospa.harness.selection import list_trials
    from robospa.tasks.catalog import task

    changes = {name: value for name, value in given_flags(context).items() if name in given}
    settings = updated(EvaluationSettings(), changes)
    keys = list_trials(settings.selection)
    actions = sum(task(key.task).levels[key.level].steps for key in keys)
    told = what_trials_tell([key.variant for key in keys])
    cost = None
    if servers := ([] if policy is None else [policy]) + list(more or ()):
        cost = _probed(updated(settings, {"policy": servers}), seconds, token)
    if as_json:
        costs = {} if cost is None else {"cost": asdict(cost)}
        print_json({"trials": len(keys), "most_actions": actions, **told, **costs})
        return
    print(f"{len(keys):,} trials, {actions:,} actions at most")
    for line in _lines(told):
        print(line)
    if cost is not None:
        for line in cost_lines(cost):
            print(line)


def _probed(settings: EvaluationSettings, seconds: float, token: str | None) -> Cost:
    """The cost by a sample of the trials; what happens meanwhile is said on standard error."""
    from robospa.harness.running.cost_probe import probe_cost
    from robospa.harness.running.request import make_request

    def note(text: str) -> None:
        print(text, file=sys.stderr)

    note(f"running a sample for {seconds:g} s, and until its last trials have ended")
    return probe_cost(make_request(settings, token=token), seconds, note)


def cost_lines(cost: Cost) -> list[str]:
    """A cost in words."""
    hours = [f"{duration_text(3600 * cost.core_hours)} of one core here"]
    if cost.server_hours:
        hours.append(f"{duration_text(3600 * cost.server_hours)} of policy servers")
    lines = [
        f"All {cost.trials:,} trials will take {duration_text(cost.seconds)} "
        f"({duration_text(cost.least)} to {duration_text(cost.most)}, "
        f"by a sample of {cost.sampled}): {cost.calls:,} queries, " + ", ".join(hours)
    ]
    if cost.bottleneck:
        lines.append(
            f"At the end of the sample there were {cost.workers} workers; {cost.bottleneck}"
        )
    return lines


def what_trials_tell(variants: Sequence[tuple[str, int]]) -> dict[str, Any]:
    """Half widths by budget and published model, the budget that is enough for each half width,
    and trials a side for differences; JSON values, rates as fractions.

    `variants` are those of all trials, one for each.
    """
    from robospa.results.paper.planning import (
        HALVES,
        enough,
        half_width,
        published_variances,
        told_apart,
    )

    listed, least = len(variants), len(set(variants))
    variances = published_variances(list(dict.fromkeys(variants)))
    budgets = sorted({n for n in (*BUDGETS, listed) if least <= n <= listed})
    needed = {half: max(least, enough(variances, half)) for half in HALVES if variances}
    return {
        "least": least,
        "half_widths": {
            str(n): {model: half_width(v, n) for model, v in variances.items()} for n in budgets
        },
        "enough": {str(half): trials for half, trials in needed.items() if trials <= listed},
        "differences": [asdict(needed) for needed in told_apart()],
    }


def _lines(told: dict[str, Any]) -> list[str]:
    lines = [
        f"{int(n):,} trials tell the overall success rate to within "
        + ", ".join(f"{100 * half:.1f} ({model})" for model, half in by_model.items())
        for n, by_model in told["half_widths"].items()
        if by_model
    ]
    lines += [
        f"For {100 * float(half):g} points either way --budget {trials} is enough"
        for half, trials in told["enough"].items()
    ]
    lines += [
        f"To tell {100 * gap['gap']:.0f} points apart: {gap['unpaired']:,} trials a side on "
        f"unrelated seeds, {gap['paired']:,} on equal ones (phi 0.5)"
        for gap in told["differences"]
    ]
    return [*lines, f"Least budget: {told['least']:,}, one trial of each variant"]
