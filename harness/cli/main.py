"""The `robospa` command. Imports only what the chosen subcommand needs, so that help is instant.

Every error is one sentence on stderr and a non-zero exit code; `--debug` anywhere shows where it
came from.
"""

import importlib
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

SECTIONS = {
    "Evaluate a policy": {
        "demo": "Run a small evaluation from server to report.",
        "serve": "Serve a policy by name or module:function.",
        "check": "Test this machine, or a policy server against the protocol.",
        "eval": "Evaluate a policy on a fixed list of trials.",
    },
    "Read the results": {
        "report": "Write tables, figures and a page; list failures or what is implausible.",
        "view": "Show a run in the browser, live while it goes on; or a trial in 3-D.",
        "compare": "Compare two runs, or a run and published numbers; plan sample sizes.",
        "paper": "Recompute the paper's tables and list their inconsistencies.",
    },
    "Publish": {
        "submit": "Pack a run as a bundle; verify or reproduce a bundle.",
        "leaderboard": "Collect verified bundles; build the leaderboard's pages.",
    },
    "Train": {
        "collect": "Collect demonstrations to train with; record one; verify a data set.",
        "learn": "Train the learned reference, a policy of our own, anew.",
    },
    "The benchmark": {
        "tasks": "List the tasks; show, draw or collect their scenes.",
        "official": "Use the official assets or sentences of your own copy.",
        "seeds": "Generate the lists of accepted seeds, or measure the expert.",
    },
}
"""Subcommands by the sections of `robospa --help`."""
COMMANDS = {name: text for part in SECTIONS.values() for name, text in part.items()}
"""Subcommand -> summary; each is a function, or a group of commands, of that name in
`robospa.harness.cli.<name>`, but for those of PLACES."""
PLACES = {
    "eval": "robospa.harness.cli.eval:evaluate",
    "submit": "robospa.leaderboard.commands:submit",
    "leaderboard": "robospa.leaderboard.commands:leaderboard",
}
"""`module:function` of subcommands that lie elsewhere."""
CONTEXT = {"max_content_width": 120}
"""Settings of every command; without them help ends at 80 columns on any terminal."""
COMPLETION = "_ROBOSPA_COMPLETE"
"""Set by the shell's completion script while a line is being typed."""


class TooOld(Exception):
    """This Python runs only a part of the commands."""


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
        print(f"robospa: {misused(error) or sentence(error)}", file=sys.stderr)
        sys.exit(getattr(error, "exit_code", 1))


def _run(words: list[str]) -> None:
    line = os.environ.get("_TYPER_COMPLETE_ARGS") or os.environ.get("COMP_WORDS", "")
    typed = line.split()[1:] if COMPLETION in os.environ else words
    chosen = next((w for w in typed if not w.startswith("-")), "")
    if strange := next((w for w in words if any("\ud800" <= c <= "\udfff" for c in w)), ""):
        raise ValueError(f"{strange!a} is not UTF-8, in which names of files and folders are kept")
    if "--version" in words[:1]:
        from importlib.metadata import version

        print(f"robospa {version('robospa')}")
        return
    if sys.version_info < (3, 11) and chosen in COMMANDS and chosen != "serve":
        raise TooOld(
            f"robospa {chosen} needs Python 3.11 or later; on this one only robospa serve runs"
        )
    if words[:1] == ["submit"] and len(words) > 1 and Path(words[1]).exists():
        words.insert(1, "pack" if Path(words[1]).is_dir() else "verify")
    app = typer.Typer(
        name="robospa",
        cls=SectionedGroup,
        help="Evaluate robot policies on the RoboSPA benchmark.",
        no_args_is_help=True,
        context_settings=CONTEXT,
        pretty_exceptions_enable=False,
        rich_markup_mode=None,  # plain help: importing the fancy one takes longer than all the rest
        epilog="--version prints the version, --debug shows where an error came from.",
    )
    for name, summary in COMMANDS.items():
        if name != chosen:
            app.command(name, short_help=summary)(lambda: None)
            continue
        found = command_of(name)
        if isinstance(found, typer.Typer):
            app.add_typer(found, name=name)
        else:
            app.command(name, cls=SectionedCommand, context_settings=CONTEXT)(found)
    command = typer.main.get_command(app)
    sys.exit(command.main(words, prog_name="robospa", standalone_mode=False) or 0)


def command_of(name: str) -> Any:
    """The function, or the group of commands, of a subcommand."""
    module, _, function = PLACES.get(name, f"robospa.harness.cli.{name}:{name}").partition(":")
    return getattr(importlib.import_module(module), function)


def misused(error: Exception) -> str:
    """What is wrong with the words of a command line, and where its help is; "" for others."""
    text = getattr(error, "format_message", str)()
    context = getattr(error, "ctx", None)
    where = "" if context is None else f" (see {context.command_path} --help)"
    text = text.replace("Value error, ", "")
    return text and text[0].lower() + " ".join(text[1:].split()).rstrip(".") + where


def sentence(error: BaseException) -> str:
    """`error` in one line; its class only where the text was not written for users."""
    words = error.args[0] if isinstance(error, KeyError) and error.args else error
    if isinstance(error, OSError) and error.filename and error.strerror:
        words = f"{error.filename}: {error.strerror}"
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


# -- help ---------------------------------------------------------------------------------------


class SectionedCommand(TyperCommand):
    """A command whose options stand under the titles that they were given as `rich_help_panel`,
    once all of them are shown."""

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write a section for the arguments and for every title, in their order."""
        sections: dict[str, list[tuple[str, str]]] = {}
        complete = not any(getattr(one, "hidden", False) for one in self.params)
        for parameter in self.get_params(ctx):
            argument = parameter.param_type_name == "argument"
            title = getattr(parameter, "rich_help_panel", None) if complete else None
            title = title or ("Arguments" if argument else "Options")
            if record := parameter.get_help_record(ctx):
                sections.setdefault(title, []).append(record)
        for title, records in sections.items():
            with formatter.section(title):
                formatter.write_dl(records)


class SectionedGroup(TyperGroup):
    """The list of commands, in sections."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write a section for every title, in their order."""
        for title, names in SECTIONS.items():
            rows = [
                (name, command.get_short_help_str(limit=300))
                for name in names
                if (command := self.get_command(ctx, name)) is not None
            ]
            with formatter.section(title):
                formatter.write_dl(rows)


if __name__ == "__main__":
    main()
