"""What must go right and wrong in the same way in every dialect."""

import socket
from collections.abc import Callable
from http.server import HTTPServer, SimpleHTTPRequestHandler
from typing import Any

import numpy as np
import pytest
from run_fakes import FakePolicy
from standins import DIALECTS, QUICK, answered, talking
from standins_http import TRIAL, joint_chunk, observation
from wire_helpers import serving

from robospa.clients import connect, dialect
from robospa.clients.dialect import dialects
from robospa.harness.cli.check import target_of
from robospa.protocol.conformance import check
from robospa.protocol.connection_limits import ServerOptions
from robospa.protocol.errors import (
    ConnectFailed,
    HandshakeError,
    PolicyAnswerError,
    TransportError,
)
from robospa.protocol.server import ServerThread
from robospa.protocol.transport import Timeouts

every_dialect = pytest.mark.parametrize("name", DIALECTS)


def served(name: str, *args: Any) -> tuple[Any, str]:
    """A stand-in server, and the query that it needs."""
    make, _, query = DIALECTS[name]
    return make(*args), query


def ask(name: str, model: Callable[[Any], Any], **options: object) -> Any:
    """The chunk that `name`'s client makes of what `model` answers."""
    return answered(*served(name, model), **options)


@every_dialect
@pytest.mark.parametrize("shape", [(2, 13), (2, 15), (0, 14), (10_001, 14), (1, 2, 14)])
def test_a_chunk_of_another_shape_is_the_policys_error(name: str, shape: Any) -> None:
    with pytest.raises(PolicyAnswerError, match="the policy answered"):
        ask(name, lambda seen: np.zeros(shape))


@every_dialect
@pytest.mark.parametrize("length", [1, 31, 65, 101])
def test_a_length_that_the_server_did_not_declare_is_taken_as_sent(name: str, length: int) -> None:
    chunk = ask(name, lambda seen: joint_chunk(length))
    assert np.array_equal(chunk, joint_chunk(length).astype(np.float32))


@every_dialect
def test_a_declared_length_is_checked_and_its_option_named(name: str) -> None:
    assert len(ask(name, lambda seen: joint_chunk(4), horizon=4)) == 4
    with pytest.raises(PolicyAnswerError, match=r"\?horizon=5 .* with execute=4") as caught:
        ask(name, lambda seen: joint_chunk(5), horizon=4)
    assert "T from 1 to its horizon 4" in str(caught.value)


@pytest.mark.parametrize("name", [name for name in DIALECTS if name not in ("go1", "gr00t", "oft")])
def test_what_the_model_reads_of_an_instruction_is_declared(name: str) -> None:
    with talking(*served(name), text_budget=7) as policy:
        assert policy.spec.text_budget == 7


@pytest.mark.parametrize("name", ["xpolicylab", "vla-eval", "robotwin"])
def test_poses_in_joint_space_name_the_option(name: str) -> None:
    with pytest.raises(PolicyAnswerError, match=r"\?space=ee"):
        ask(name, lambda seen: np.zeros((2, 16)))


MAPS = ("gr00t", "openpi", "xpolicylab", "vla-eval", "xvla", "robotwin")
"""Servers that answer a map, in which other things may stand."""


def ask_with(name: str, **extra: Any) -> Any:
    server, query = served(name)
    server.extra = extra
    return answered(server, query)


@pytest.mark.parametrize("name", MAPS)
@pytest.mark.parametrize("value", [[[0.5], [0.5]], {"left": [1.0]}, [[[[[[[[["x"]]]]]]]]]])
def test_numbers_under_a_name_that_nobody_reads_are_refused(name: str, value: Any) -> None:
    with pytest.raises(PolicyAnswerError, match=r"'gripper_actions', which nobody reads"):
        ask_with(name, gripper_actions=value)


@pytest.mark.parametrize("name", MAPS)
def test_remarks_beside_the_actions_are_harmless(name: str) -> None:
    remarks = {"model": "x", "confidence": 0.5, "done": False, "notes": ["a"], "nothing": None}
    assert ask_with(name, **remarks).shape == joint_chunk().shape


@pytest.mark.parametrize("scheme", [dialect.scheme for dialect in dialects()])
def test_a_server_that_is_down(scheme: str) -> None:
    with socket.create_server(("127.0.0.1", 0)) as closed:
        port = closed.getsockname()[1]
    with pytest.raises(ConnectFailed, match=f"cannot connect to .*{port}.*: nothing listens there"):
        connect(f"{scheme}://127.0.0.1:{port}", timeouts=QUICK)


@pytest.mark.parametrize("name", [name for name in DIALECTS if name != "vla-eval"])
def test_greetings_hold_what_a_run_keeps(name: str) -> None:
    with talking(*served(name)) as policy:
        hello = policy.hello
    assert hello["spec"] == policy.spec.to_json()
    assert hello["warnings"]
    assert "horizon" in hello["options"] and "execute" in hello["options"]


# ---------------------------------------------------------------- the wrong dialect


LOOKS = {dialect.scheme: dialect.server for dialect in dialects()}
SPOKEN = {
    "go1": "go1+http",
    "gr00t": "gr00t",
    "oft": "oft+http",
    "xvla": "xvla+http",
    "openpi": "openpi",
    "xpolicylab": "xpolicylab",
    "vla-eval": "vla-eval",
    "robotwin": "robotwin+tcp",
    "ours": "ws",
}
HASTY = Timeouts(connect=0.3, hello=0.3, reset=0.3, first_infer=0.3, infer=0.3, end=1, close=0.2)
"""However a call to the wrong server ends, the server is asked what it is."""
SILENT = ("robotwin", "gr00t")
"""Servers that leave a question over HTTP without answer."""
WRONG = [
    (server, spoken)
    for server in DIALECTS
    for spoken in (SPOKEN if server not in SILENT else ("go1", "vla-eval", "ours"))
    if server != spoken and (server, spoken) != ("openpi", "ours")
]
"""One of each wire, where a question takes its time."""


def use(url: str, timeouts: Timeouts = HASTY) -> None:
    """Begin a trial and ask once."""
    with connect(url, timeouts=timeouts) as policy:
        policy.reset(TRIAL)
        policy.infer(observation())


@pytest.mark.parametrize(("server", "spoken"), WRONG)
def test_the_wrong_dialect_is_told_which_it_looks_like(
    server: str, spoken: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """When connecting or at the first question; a HandshakeError, so the run stops at once."""
    monkeypatch.setattr(dialect, "SECONDS", 1.0 if server in SILENT else 20.0)
    with DIALECTS[server][0]() as url, pytest.raises(HandshakeError) as caught:
        use(url.replace(SPOKEN[server], SPOKEN[spoken]))
    advice = f"looks like {LOOKS[SPOKEN[server]]}; try {SPOKEN[server]}://127.0.0.1:"
    assert advice in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("spoken", SPOKEN)
def test_something_that_never_answers_is_not_guessed_at(
    spoken: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(dialect, "SECONDS", 0.05)
    with socket.create_server(("127.0.0.1", 0)) as silent:
        url = f"{SPOKEN[spoken]}://127.0.0.1:{silent.getsockname()[1]}"
        with pytest.raises(TransportError) as caught:
            use(url, Timeouts(connect=0.1, hello=0.1, reset=0.1, first_infer=0.1, close=0.1))
        assert "looks like" not in str(caught.value)


def test_an_http_server_of_another_kind() -> None:
    class Quiet(SimpleHTTPRequestHandler):
        def log_message(self, *_: object) -> None:
            return None

        def do_GET(self) -> None:
            self.send_error(404)

    server = HTTPServer(("127.0.0.1", 0), Quiet)
    with serving(server):
        for scheme in ("go1+http", "xvla+http", "openpi", "ws", "vla-eval"):
            with pytest.raises(HandshakeError, match="an HTTP server of another kind"):
                connect(f"{scheme}://127.0.0.1:{server.server_port}", timeouts=HASTY)


@pytest.mark.parametrize("scheme", ["ws", "openpi"])
def test_a_full_server_is_not_another_dialect(scheme: str) -> None:
    """It is tried again: a worker that reconnects may be faster than the end of its old one."""
    with ServerThread(FakePolicy(), options=ServerOptions(patience=0.05)) as server:
        url = server.url.replace("ws://", f"{scheme}://")
        with connect(server.url, timeouts=QUICK) as first:
            first.reset(TRIAL)
            with pytest.raises(ConnectFailed, match="taken"):
                connect(url, timeouts=QUICK)


def test_our_own_server_is_recognised() -> None:
    with ServerThread(policy_factory=FakePolicy) as server:
        port = server.url.rpartition(":")[2]
        for scheme in ("go1+http", "xvla+http", "xpolicylab", "vla-eval", "robotwin+tcp"):
            with pytest.raises(HandshakeError, match=r"a robospa\.v1 server; try ws://127"):
                use(f"{scheme}://127.0.0.1:{port}")


@every_dialect
def test_robospa_check_finds_every_dialect_fit(name: str) -> None:
    server, query = served(name)
    with server as url:
        results = check(url, timeouts=QUICK, connector=lambda: connect(url + query, timeouts=QUICK))
    assert [result for result in results if result.passed is False] == []
    assert sum(result.passed is True for result in results) >= 3
    assert results[0].detail.startswith("speaks the dialect ")


def test_which_servers_have_one_state_for_all_connections() -> None:
    shared = {dialect.scheme for dialect in dialects() if dialect.shared_state}
    assert shared == {"lingbot", "xpolicylab", "robotwin+tcp"}


@pytest.mark.parametrize("name", ["xpolicylab", "robotwin"])
def test_check_asks_a_server_with_one_state_one_trial_at_a_time(name: str) -> None:
    """Two trials at once would pass, and be mixed in a run."""
    with DIALECTS[name][0]() as url:
        target = target_of(url)
        assert target.dialect.shared_state
        found = check(url, timeouts=QUICK, connector=target.connect, shared_state=True)
    passed = {result.name: result.passed for result in found}
    assert passed["concurrent sessions"] is None
    assert passed["actions"]
