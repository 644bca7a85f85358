"""The `robospa` command. Imports only what the chosen subcommand needs, so that help is instant.

Every error is one sentence on stderr and a non-zero exit code; `--debug` anywhere shows where it
came from.
"""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Mapping, Sequence

SECTIONS = {
    "Evaluate a policy": {
        "demo": "Run a small evaluation from server to report.",
        "doctor": "Check that this machine can simulate and render.",
        "serve": "Serve a policy by name or module:function.",
        "check": "Test a policy server against the protocol.",
        "eval": "Evaluate a policy on a fixed list of trials.",
        "latency": "Evaluate a policy in real time: success against latency.",
    },
    "Read the results": {
        "report": "Write tables, figures and a page with every trial and its video.",
        "view": "Show a run in the browser, live while it goes on; or a trial in 3-D.",
        "failures": "List the type of every failed trial, with its evidence.",
        "compare": "Compare two runs, or a run and published numbers; plan sample sizes.",
        "lint": "Flag implausible results, in runs or in the paper.",
        "paper": "Recompute the paper's tables and list their inconsistencies.",
    },
    "Publish": {
        "submit": "Pack a run as a bundle; verify or reproduce a bundle.",
        "audit": "Look for reasons to doubt a run, for maintainers.",
        "leaderboard": "Collect verified bundles; build the leaderboard's pages.",
        "push": "Upload a run or a data set to the Hugging Face hub.",
    },
    "Train": {
        "collect": "Collect a data set of demonstrations to train with; verify one.",
        "learn": "Train a policy of our own on such a data set.",
        "record": "Record a demonstration of the oracle, to check servers with.",
    },
    "The benchmark": {
        "tasks": "List the tasks; show, draw or collect their scenes.",
        "instructions": "Check the sentences of a RoboSPA checkout: which fit, which are trained "
        "on.",
        "assets": "Name a folder of official assets; list what it holds.",
        "seeds": "Generate the lists of accepted seeds, or measure the expert.",
        "checkout": "Check a RoboSPA checkout as a world; find its valid seeds.",
    },
}
"""Subcommands by the sections of `robospa --help`."""

COMMANDS = {name: text for part in SECTIONS.values() for name, text in part.items()}
"""Subcommand -> summary; each is a function, or a group of commands, of that name in
`robospa.harness.cli.<name>`."""

NAMES = {"eval": "evaluate"}
"""Functions that cannot be called like their subcommand."""


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; ends in SystemExit."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in words
    words = [w for w in words if w != "--debug"]
    try:
        _run(words)
    except KeyboardInterrupt:
        print("robospa: interrupted", file=sys.stderr)
        sys.exit(130)
    except Exception as error:
        if debug:
            raise
        print(f"robospa: {sentence(error)}", file=sys.stderr)
        sys.exit(1)


COMPLETION = "_ROBOSPA_COMPLETE"
"""Set by the shell's completion script while a line is being typed."""


class TooOld(Exception):
    """This Python runs only a part of the commands."""


def _run(words: list[str]) -> None:
    import typer

    from robospa.harness.cli.defaults import PREFIX, command_defaults, taken_file
    from robospa.harness.cli.help import (
        CONTEXT,
        SectionedCommand,
        SectionedGroup,
        name_variables,
    )

    words, file = taken_file(words, os.environ)
    typed = completed_line(os.environ) if COMPLETION in os.environ else words
    chosen = next((w for w in typed if not w.startswith("-")), "")
    if "--version" in words[:1]:
        from importlib.metadata import version

        print(f"robospa {version('robospa')}")
        return
    if sys.version_info < (3, 11) and chosen in COMMANDS and chosen != "serve":
        raise TooOld(
            f"robospa {chosen} needs Python 3.11 or later; on this one only robospa serve runs"
        )
    app = typer.Typer(
        name="robospa",
        cls=SectionedGroup,
        help="Evaluate robot policies on the RoboSPA benchmark.",
        no_args_is_help=True,
        context_settings=CONTEXT,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,  # plain help: importing the fancy one takes longer than all the rest
        epilog="--version prints the version, --debug shows where an error came from. Every flag "
        "has a variable, such as ROBOSPA_EVAL_TRIALS, and --config FILE before the command, or "
        "ROBOSPA_CONFIG, names a file of defaults: docs/runs.md.",
    )
    for name, summary in COMMANDS.items():
        if name == chosen:
            module = importlib.import_module(f"robospa.harness.cli.{name}")
            found = getattr(module, NAMES.get(name, name))
            if isinstance(found, typer.Typer):
                app.add_typer(found, name=name)
            else:
                app.command(name, cls=SectionedCommand, context_settings=CONTEXT)(found)
        else:
            app.command(name, short_help=summary)(_unloaded)
    command = typer.main.get_command(app)
    if (found := command.commands.get(chosen)) is not None:  # type: ignore[attr-defined]
        name_variables(found, f"{PREFIX}_{chosen.upper()}")
    defaults = {} if file is None or found is None else {chosen: command_defaults(file, found)}
    command.main(words, prog_name="robospa", default_map=defaults)


def completed_line(environment: Mapping[str, str]) -> list[str]:
    """The words after `robospa` on the line that a shell asks to complete."""
    line = environment.get("_TYPER_COMPLETE_ARGS") or environment.get("COMP_WORDS", "")
    return line.split()[1:]


def _unloaded() -> None:
    """Stands for a subcommand that was not chosen."""


def sentence(error: BaseException) -> str:
    """`error` in one line; its class only where the text was not written for users."""
    words = error.args[0] if isinstance(error, KeyError) and error.args else error
    from robospa.extras import remedy
    from robospa.protocol.errors import without_secrets

    text = "".join(c for c in " ".join(str(words).split()) if c.isprintable())
    text = without_secrets(text)
    ours = type(error).__module__.startswith("robospa.")
    if isinstance(error, ModuleNotFoundError) and not ours:
        return f"{text}; {remedy(str(error.name))}"
    if text and (ours or isinstance(error, (KeyError, ValueError, OSError))):
        return text
    return f"{type(error).__name__}: {text} (add --debug to see where)"


if __name__ == "__main__":
    main()
