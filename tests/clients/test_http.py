"""HTTP answers without an end: refused at their deadline, in one sentence."""

import itertools
import socket
import socketserver
import threading
from collections.abc import Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from standins import QUICK, answered
from standins_http import Go1, Status, joint_chunk, observation
from wire_helpers import port_that

from robospa.action_space import ActionSpace
from robospa.clients import check_options, connect, find_endpoint
from robospa.clients.chunks import (
    as_chunk,
    budget_warning,
    invert_grippers,
    least_tokens,
)
from robospa.clients.dialect import ConnectionParams, Dialect, dialects
from robospa.clients.http import JsonServer
from robospa.clients.robotwin import robotwin_observation
from robospa.clients.xpolicylab import XPolicyLabClientOptions, decode, robot_state
from robospa.protocol.errors import CallTimeout, HandshakeError, TransportError
from robospa.protocol.options import option_table, plain_options, read_options, url_options
from robospa.protocol.transport import Timeouts


@contextmanager
def answering(answer: bytes) -> Iterator[JsonServer]:
    """A client to a server that sends `answer` and never ends the connection."""

    def serve(peer: socket.socket) -> None:
        peer.recv(65536)
        peer.sendall(answer)
        peer.recv(1)

    with port_that(serve) as url:
        endpoint = find_endpoint(url.replace("ws://", "go1+http://"))
        with closing(JsonServer(ConnectionParams(endpoint, Timeouts(connect=10)))) as server:
            yield server


def test_a_whole_answer_without_a_length_whose_end_never_comes_is_late() -> None:
    """Its deadline ends the connection, which would look like the end of the answer."""
    with (
        answering(b"HTTP/1.1 200 OK\r\n\r\n[[0, 1]]") as server,
        pytest.raises(CallTimeout, match="did not answer within"),
    ):
        server.request("GET", "/act", None, 0.2)


def test_a_redirect_is_not_followed_and_named() -> None:
    with (
        answering(
            b"HTTP/1.1 307 Go\r\nLocation: https://evil.org/act\r\nContent-Length: 0\r\n\r\n"
        ) as server,
        pytest.raises(HandshakeError, match=r"redirects to https://evil\.org/act, which is not"),
    ):
        server.request("POST", "/act", b"{}", 10.0)


class Gateway(Go1):
    """Refuses requests with these statuses before any reaches the model."""

    def __init__(self, refusals: Iterable[int]) -> None:
        super().__init__()
        self.refusals = iter(refusals)

    def act(self, body: bytes) -> Any:
        status = next(self.refusals, None)
        if status is not None:
            raise Status(status, b"no upstream")
        return super().act(body)


@pytest.mark.parametrize("status", [429, 502, 503, 504])
def test_an_unavailable_server_is_asked_again_within_the_trial(status: int) -> None:
    server = Gateway([status, status])
    assert np.array_equal(answered(server), joint_chunk().astype(np.float32))
    assert len(server.requests) == 1


def test_a_server_that_stays_unavailable_is_no_error_of_the_policy() -> None:
    limit = replace(QUICK, first_infer=0.1, infer=0.1)
    server = Gateway(itertools.repeat(503))
    late = pytest.raises(TransportError, match=r"answered HTTP 503: no upstream|within 0\.1 s")
    with server as url, connect(url, timeouts=limit) as policy, late:
        policy.infer(observation())


# ---------------------------------------- options from URLs and files, and the page that lists them


DIALECTS = dialects()
ROOT = Path(__file__).resolve().parents[2]


def by_scheme(dialect: Dialect) -> str:
    return dialect.scheme


@pytest.mark.parametrize("dialect", DIALECTS, ids=by_scheme)
def test_every_option_is_explained_and_round_trips(dialect: Dialect) -> None:
    options = dialect.options
    rows = option_table(options)
    assert {"horizon", "execute", "state"} - {row.name for row in rows} in (set(), {"state"})
    assert all(row.help and row.help[0] != " " for row in rows)
    told = plain_options(options())
    assert read_options(options, told) == options()
    assert [row.name for row in rows] == list(told)
    assert set(dialect.deciding_options.values()) <= set(told)


@pytest.mark.parametrize(
    "url",
    [
        "go1+http://h?wrists=left",
        "go1+http://h?ctrl_freq=0",
        "go1+http://h?horizon=0",
        f"go1+http://h?horizon={10**400}",
        "go1+http://h?horizon=30&execute=31",
        "go1+http://h?wrist=swapped",
        "go1+http://h?horizon=1&horizon=2",
        "xvla+http://h?domain_id=30",
        "xvla+http://h?domain_id=six",
        "xvla+http://h?steps=0",
        "xvla+http://h?cameras=front",
        "xvla+http://h?cameras=",
        "xvla+http://h?quaternions=zyxw",
        "xvla+http://h?text_budget=0",
        "openpi://h?names=top",
        "openpi://h?extra=[1]",
        "openpi://h?order=0-12",
        "starvla://h?size=0",
        "lingbot://h?reset=[]",
        "openpi://h?cameras=left",
        "xpolicylab://h?frequency=0",
        "xpolicylab://h?space=delta_ee",
        "vla-eval://h?cameras=head,head",
        "robotwin+tcp://h?history=-1",
        "robotwin+tcp://h?layout=act",
        "ws://h?horizon=x",
    ],
)
def test_options_that_cannot_be(url: str) -> None:
    with pytest.raises(ValueError, match=r"option|URL|must be"):
        check_options(url)


def test_the_url_overrules_the_file() -> None:
    given = {"wrists": "correct", "ctrl_freq": 15}
    endpoint = find_endpoint("go1+http://gpu?wrists=swapped", given)
    assert endpoint.options == {"wrists": "swapped", "ctrl_freq": 15}
    assert (endpoint.host, endpoint.port) == ("gpu", 9000)


def test_none_and_flags_and_numbers_from_a_url() -> None:
    assert url_options("execute=none&ctrl_freq=12.5") == {"execute": "none", "ctrl_freq": "12.5"}
    check_options("go1+http://h?execute=none&ctrl_freq=12.5")
    check_options("xvla+http://h?text_budget=none")


# ---------------------------------------------------------------- the page of options


def table_of(dialect: Dialect) -> list[str]:
    """The rows of one dialect's options."""
    return [
        f"| `{r.name}` | {f'`{r.default}`' if r.default else 'empty'} | {r.values} | {r.help} |"
        for r in option_table(dialect.options)
    ]


PRESETS = ("ws", "starvla", "vllm", "lingbot")
"""Those with the options of openpi; the defaults of presets are in presets.json."""


@pytest.mark.parametrize("dialect", [d for d in DIALECTS if d.scheme not in PRESETS], ids=by_scheme)
def test_a_page_lists_every_option(dialect: Dialect) -> None:
    """Those of nearly all dialects in the first table of clients.md, its own in a table."""
    head = "| option | default | values | meaning |\n|---|---|---|---|\n"
    first = (ROOT / "docs/clients.md").read_text().partition(head)[2].partition("\n\n")[0]
    own = head + "\n".join(row for row in table_of(dialect) if row not in first.splitlines())
    pages = [ROOT / "docs/clients.md", *(ROOT / "docs/policies").glob("*.md")]
    assert any(own in page.read_text() for page in pages), (
        f"no page has the options of {dialect.scheme}; the table must be:\n{own}"
    )


@pytest.mark.parametrize("url", ["grpc://gpu:8080", "lerobot://gpu", "being-h://gpu:5555"])
def test_servers_that_unpickle_are_refused_by_name(url: str) -> None:
    with pytest.raises(ValueError, match=r"unpickles what it receives.*instead$"):
        connect(url)


def test_a_grpc_server_is_recognised_by_its_first_bytes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("robospa.clients.dialect.SECONDS", 0.2)
    monkeypatch.setattr("robospa.clients.PATIENCE", 0.2)

    class Greets(socketserver.BaseRequestHandler):
        def handle(self) -> None:
            self.request.sendall(bytes((0, 0, 6, 4, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0, 1)))
            self.request.recv(1000)

    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), Greets) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, daemon=True).start()
        with pytest.raises(HandshakeError, match=r"looks like a gRPC server; LeRobot's"):
            connect(f"ws://127.0.0.1:{server.server_address[1]}")
        server.shutdown()


@pytest.mark.parametrize("url", ["http://localhost:8000", "localhost:8000", "oracle", ""])
def test_unknown_schemes_are_told_what_exists(url: str) -> None:
    with pytest.raises(ValueError, match="no address of a policy server") as caught:
        connect(url)
    known = [scheme for dialect in dialects() for scheme in dialect.schemes]
    assert all(f"{scheme}://" in str(caught.value) for scheme in known)


def test_a_url_without_host() -> None:
    with pytest.raises(ValueError, match="names no host"):
        connect("ws://")


@pytest.mark.parametrize(
    "value", [None, "x", {}, [[1], [2, 3]], [["a"]], [[10**400]], [["1.5"]], [[True]]]
)
def test_what_is_no_chunk_stays_what_it_is(value: object) -> None:
    found = as_chunk(value)
    assert found is value


def test_grippers_are_turned_and_nothing_else() -> None:
    chunk = np.arange(28, dtype=np.float32).reshape(2, 14)
    change = invert_grippers(chunk, ActionSpace("joint")) - chunk
    assert np.flatnonzero(change.any(axis=0)).tolist() == [6, 13]
    wrong = np.zeros((1, 3), np.float32)
    assert invert_grippers(wrong, ActionSpace("joint")) is wrong


@pytest.mark.parametrize(
    ("text", "count"),
    [("", 2), ("pick", 3), ("pick the red, small block.", 9), ("3 blocks (left)", 7)],
)
def test_tokens_are_counted_from_below(text: str, count: int) -> None:
    assert least_tokens(text) == count


def test_a_budget_is_warned_about_only_when_it_is_broken() -> None:
    assert budget_warning(None, {"A": "word " * 500}) is None
    assert budget_warning(50, {"A": "word " * 48}) is None
    warning = budget_warning(50, {"A": "word " * 49, "B": "word", "C": "word " * 70})
    assert warning is not None
    assert "2 of 3 tasks" in warning and "C: at least 72" in warning


JOINTS = (6, 7)
STATE = np.arange(15, dtype=np.float32) / 15
SEEN: Any = observation(state=STATE)


def test_every_dialect_says_which_robot_its_servers_drive() -> None:
    for dialect in dialects():
        default = {f.name: f.default for f in fields(dialect.options)}.get("embodiment")
        assert default == "aloha-agilex", dialect.scheme


def test_arms_of_six_and_seven_joints_are_sent_one_by_one() -> None:
    sent = robotwin_observation(SEEN, JOINTS)["joint_action"]
    assert isinstance(sent, dict)
    assert (len(sent["left_arm"]), len(sent["right_arm"])) == JOINTS
    assert (sent["left_gripper"], sent["right_gripper"]) == pytest.approx((STATE[6], STATE[14]))
    state = robot_state(SEEN, JOINTS)
    assert len(state["right_arm_joint_state"]) == 7
    assert state["right_ee_joint_state"] == pytest.approx(STATE[14:])


def test_closed_grippers_of_such_arms_are_turned_round() -> None:
    options = XPolicyLabClientOptions(grippers="closed")
    answer = {"actions": np.zeros((2, 15), np.float32)}
    chunk = decode(answer, SEEN, options, JOINTS)
    grippers = ActionSpace("joint", JOINTS).grippers
    assert isinstance(chunk, np.ndarray)
    assert np.flatnonzero(chunk[0]).tolist() == grippers == [6, 14]
