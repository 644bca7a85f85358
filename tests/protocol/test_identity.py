"""Who a policy server is: what stays the same in its greeting, and what tells another one."""

from typing import Any

import pytest
from run_fakes import SPEC

from robospa.protocol.client import Identity, RemotePolicy, identity_of
from robospa.protocol.errors import SpecMismatch
from robospa.protocol.transport import Timeouts

HELLO: dict[str, Any] = {
    "dialect": "openpi",
    "spec": SPEC.to_json(),
    "options": {"horizon": 50},
    "warnings": ["of ours"],
    "metadata": {
        "checkpoint": "run/2000",
        "norm": {"mean": [0.5, 1.5]},
        "uptime_s": 3,
        "warm": False,
    },
}


def greeting(**metadata: Any) -> dict[str, Any]:
    return {**HELLO, "metadata": {**HELLO["metadata"], **metadata}}


def test_the_same_server_is_the_same() -> None:
    later = greeting(uptime_s=9000, warm=True, started="now", openConnections=7)
    assert identity_of(HELLO).changes(identity_of(later)) == []
    assert identity_of(HELLO).hash == identity_of(later).hash
    assert identity_of({**HELLO, "warnings": []}) == identity_of(HELLO)


@pytest.mark.parametrize(
    ("other", "change"),
    [
        (greeting(checkpoint="run/3000"), "metadata.checkpoint was 'run/2000' and is 'run/3000'"),
        (greeting(norm={"mean": [0.5, 2]}), "metadata.norm.mean was [0.5, 1.5] and is [0.5, 2]"),
        (greeting(lora="x"), "metadata.lora was unset and is 'x'"),
        ({**HELLO, "server": "b"}, "server was unset and is 'b'"),
        ({**HELLO, "spec": {**HELLO["spec"], "horizon": 9}}, "horizon was 4 and is 9"),
        ({**HELLO, "options": {"horizon": 8}}, "options.horizon was 50 and is 8"),
        ({**HELLO, "dialect": "ws"}, "dialect was 'openpi' and is 'ws'"),
    ],
)
def test_another_server_is_named_by_what_differs(other: dict[str, Any], change: str) -> None:
    assert identity_of(HELLO).changes(identity_of(other)) == [change]
    assert identity_of(HELLO).hash != identity_of(other).hash


def test_what_differs_in_two_greetings_is_left_out_for_good() -> None:
    first, again = identity_of(greeting(served=1)), identity_of(greeting(served=2))
    known = first.repeated_in(again)
    assert known.volatile == {"metadata.served"}
    assert known.changes(identity_of(greeting(served=3))) == []
    assert known.changes(identity_of(greeting(served=3, checkpoint="b"))) != []
    assert known.hash == identity_of(greeting(served=9), known.volatile).hash
    other = {**HELLO, "spec": {**HELLO["spec"], "horizon": 9}}
    assert identity_of(HELLO).repeated_in(identity_of(other)) == identity_of(HELLO)


@pytest.mark.parametrize(
    ("hello", "checkpoint"),
    [
        (HELLO, "run/2000"),
        ({"spec": {"checkpoint": "29999 sample:ab"}}, "29999 sample:ab"),
        ({"spec": {"checkpoint": ""}, "metadata": {"reset_pose": [0.0]}}, ""),
        ({"metadata": {"gitCommit": "9f2"}}, "9f2"),
        ({"metadata": {"model": {"weights": ""}, "name": "pi0"}}, ""),
        ({"server": "robospa 1.0 go1"}, ""),
    ],
)
def test_a_checkpoint_is_found_by_its_name(hello: dict[str, Any], checkpoint: str) -> None:
    assert identity_of(hello).checkpoint == checkpoint


def test_a_server_without_a_word_has_an_identity() -> None:
    assert identity_of({}) == Identity({})
    assert identity_of({}).checkpoint == ""


class Session:
    """A connection to a server with one greeting."""

    spec = SPEC

    def __init__(self, hello: dict[str, Any]) -> None:
        self.hello, self.closed = hello, False

    def close(self) -> None:
        self.closed = True


def policy(*hellos: dict[str, Any], expect: Identity | None = None) -> Any:
    sessions = [Session(hello) for hello in hellos]
    left = iter(sessions)
    return RemotePolicy("ws://gpu:1", lambda: next(left), Timeouts(), expect), sessions  # type: ignore[arg-type,return-value]


def test_reconnecting_to_another_checkpoint_is_refused() -> None:
    remote, sessions = policy(HELLO, greeting(uptime_s=8), greeting(checkpoint="b"))
    remote.reconnect()
    with pytest.raises(SpecMismatch, match="gpu:1 is another one than before: metadata"):
        remote.reconnect()
    assert all(session.closed for session in sessions)


def test_the_first_connection_is_compared_with_who_is_expected() -> None:
    with pytest.raises(SpecMismatch, match="was 'run/2000' and is 'b'"):
        policy(greeting(checkpoint="b"), expect=identity_of(HELLO))
