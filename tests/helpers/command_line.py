"""The command line, called in this process: a Python of its own costs a second each time."""

import io
import os
from contextlib import redirect_stderr, redirect_stdout
from typing import NamedTuple
from unittest import mock

from robospa.harness.cli.main import main


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
