"""The command line, called in this process: a Python of its own (`printed`) costs a second each."""

import io
import os
import subprocess
import sys
from contextlib import redirect_stderr, redirect_stdout
from typing import NamedTuple
from unittest import mock

from robospa.harness.cli.main import main

ROBOSPA = [sys.executable, "-m", "robospa.harness.cli.main"]
"""The same in a process of its own."""


class Done(NamedTuple):
    """How a command ended: exit code, standard output, standard error."""

    code: int
    out: str
    err: str


def robospa(*words: object, columns: int = 300) -> Done:
    """Run `robospa WORDS` with a terminal `columns` wide and without colours."""
    out, err, code = io.StringIO(), io.StringIO(), 0
    wide = mock.patch.dict(os.environ, {"NO_COLOR": "1", "COLUMNS": str(columns)})
    with wide, redirect_stdout(out), redirect_stderr(err):
        try:
            main([str(word) for word in words])
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
    return Done(code, out.getvalue(), err.getvalue())


def printed(code: str, **environment: str) -> str:
    """What a Python of its own prints that runs `code`."""
    words = [sys.executable, "-W", "ignore", "-c", code]
    env = {**os.environ, **environment}
    done = subprocess.run(words, env=env, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    return done.stdout


def start(words: list[str]) -> subprocess.Popen[str]:
    """A process group of its own, so that Ctrl-C can reach all of it as in a terminal."""
    return subprocess.Popen(
        [*ROBOSPA, *words],
        env={**os.environ, "NO_COLOR": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )


def eval_words(out: object, *words: object, trials: int = 4) -> list[str]:
    """Words that evaluate so many trials of two variants in the fake world, as far as `words` do
    not say otherwise."""
    fakes = ["--world", "run_fakes:FakeWorld", "--parts", "run_fakes:parts"]
    what = ["--tasks", "Pick_Blocks_Size", "--levels", "1-2", "--trials", str(trials)]
    seeds = ["--seeds", f"100000-{99_999 + trials}", "--backoff", "0.05"]
    rest = ["--workers", str(min(2, trials)), "--out", str(out), *map(str, words)]
    return ["eval", *fakes, *what, *seeds, *rest]
