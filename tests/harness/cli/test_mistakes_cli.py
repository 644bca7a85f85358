"""What a user who got something wrong is told: one sentence that says what to do."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest
from command_line import robospa
from run_fakes import FakePolicy

from robospa import extras
from robospa.protocol.server import ServerThread

EVAL = ("--tasks", "Pick_Blocks_Size", "--levels", "1", "--trials", "1", "--out")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("eval", "localhost:8000", *EVAL), "of a server write ws://localhost:8000"),
        (("eval", "http://localhost:8000", *EVAL), "no address of a policy server"),
        (("submit", "verify"), "is a folder: a bundle is a .zip"),
        (("official", "checkout"), "has no folder envs"),
    ],
)
def test_what_is_no_server_bundle_or_checkout(
    tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    done = robospa(*words, tmp_path)
    assert (done.code, done.out) == (1, "") and said in done.err


def test_a_forgotten_token(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("ROBOSPA_TOKEN", raising=False)
    with ServerThread(policy_factory=FakePolicy, token="a secret of theirs") as server:
        done = robospa("eval", server.url, *EVAL, tmp_path / "run")
    assert "refused the token: missing or wrong token; give the server's token with" in done.err


def test_a_port_that_is_taken() -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        done = robospa("serve", "hold", "--port", port)
    said = f"robospa: port {port} of 127.0.0.1 is in use: choose another --port"
    assert done.code == 1 and done.err.startswith(said)


def test_a_collection_names_its_extra_before_it_makes_anything(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def missing(module: str) -> None:
        raise ModuleNotFoundError(f"No module named {module!r}", name=module)

    monkeypatch.setattr(extras, "import_module", missing)
    out = tmp_path / "data"
    done = robospa("collect", "--tasks", "Pick_Blocks_Size", "--episodes", "1", "--out", out)
    assert done.code == 1 and "pyarrow is not installed; install it with" in done.err
    assert done.err.endswith("[demos]'\n") and not out.exists()
