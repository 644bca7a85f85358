"""A server's latency under one, four and eight clients, and the clock that stands for it."""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
import pytest
from wire_helpers import SPEC, Recall

from robospa.clients import connect
from robospa.harness import server_checks as module
from robospa.harness.cli.main import main
from robospa.harness.clock.policy_clock import declared_latency
from robospa.harness.server_checks import Load, measure
from robospa.protocol.errors import WireError
from robospa.protocol.server import ServerThread


class Slow(Recall):
    """Takes ten milliseconds, one request at a time."""

    busy = threading.Lock()

    def infer(self, observation: Any) -> np.ndarray:
        with Slow.busy:
            time.sleep(0.01)
        return super().infer(observation)


def test_each_number_of_clients_asks_as_often_and_more_of_them_wait_longer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(module, "QUERIES", 6)
    with ServerThread(policy_factory=lambda: Slow(SPEC)) as server:
        one, four = measure(lambda: connect(server.url), 30.0, (1, 4))
    assert (one.clients, len(one.latencies)) == (1, 6)
    assert (four.clients, len(four.latencies)) == (4, 24)
    assert min(one.latencies) >= 10.0
    # One model for four: whoever asks while another is served waits for its turn.
    assert four.latency.at(1.0) >= 20.0
    assert list(four.latencies) == sorted(four.latencies)


def test_the_clock_of_a_load_is_read_again() -> None:
    load = Load(1, tuple(float(n) for n in range(10, 51)), 20.0)
    latency = declared_latency(load.clock)
    assert latency == load.latency
    assert [latency.at(s) for s in (0.0, 0.5, 1.0)] == [10.0, 30.0, 50.0]


def test_a_server_that_goes_away_is_an_error_and_nobody_waits_for_ever() -> None:
    class Gone(Recall):
        def infer(self, observation: Any) -> np.ndarray:
            raise RuntimeError("out of memory")

    with (
        ServerThread(policy_factory=lambda: Gone(SPEC)) as server,
        pytest.raises(WireError, match="out of memory"),
    ):
        measure(lambda: connect(server.url), 1.0, (3,))


def test_check_prints_the_clock_that_stands_for_the_server(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(module, "QUERIES", 3)
    monkeypatch.setenv("COLUMNS", "200")
    with ServerThread(policy_factory=lambda: Recall(SPEC)) as server, pytest.raises(SystemExit):
        main(["check", server.url, "--trials", "0"])
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    clocks = [line for line in lines if line.startswith("--clock real:")]
    assert len(clocks) == 3, "for one, four and eight robots"
    assert declared_latency(clocks[0].split()[1]) is not None
