"""The worked example of a dialect runs end to end, registered as an installed package would be."""

from __future__ import annotations

import re
import threading
import tomllib
from collections.abc import Iterator
from http.server import ThreadingHTTPServer
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest
from standin_base import QUICK, STATE, TRIAL, observation

from robospa.clients import check_options, connect
from robospa.clients.dialect import dialects
from robospa.protocol.conformance import check
from robospa.protocol.errors import HandshakeError

ROOT = Path(__file__).resolve().parents[1]
EXAMPLE = ROOT / "docs" / "examples" / "acme_dialect"


@pytest.fixture
def installed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The example on the path, with the entry points that installing it would write."""
    project = tomllib.loads((EXAMPLE / "pyproject.toml").read_text())["project"]
    metadata = tmp_path / f"acme_robospa-{project['version']}.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text(f"Name: {project['name']}\nVersion: {project['version']}\n")
    groups = project["entry-points"].items()
    (metadata / "entry_points.txt").write_text(
        "\n".join(
            f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in entries.items())
            for group, entries in groups
        )
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.syspath_prepend(EXAMPLE)


@pytest.fixture
def port(installed: None) -> Iterator[int]:
    """The made-up server."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), import_module("acme_server").Acme)
    server.daemon_threads = True
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield server.server_port
    server.shutdown()
    thread.join(5)
    server.server_close()


def test_a_policy_behind_it_answers_in_our_units(port: int) -> None:
    url = f"acme+http://127.0.0.1:{port}?execute=2"
    with connect(url, timeouts=QUICK) as policy:
        assert policy.dialect == "acme"
        assert (policy.spec.horizon, policy.spec.execute) == (None, 2)
        policy.reset(TRIAL)
        chunk = policy.infer(observation())
        policy.end({"success": True})
    wanted = STATE.copy()
    wanted[[6, 13]] = 1.0
    assert np.allclose(chunk, np.tile(wanted, (5, 1)))


def test_it_passes_the_checks_of_every_server(port: int) -> None:
    url = f"acme+http://127.0.0.1:{port}"
    results = check(url, timeouts=QUICK, connector=lambda: connect(url, timeouts=QUICK))
    assert [result for result in results if result.passed is False] == []


def test_its_options_are_checked(installed: None) -> None:
    with pytest.raises(ValueError, match="1 <= execute <= horizon"):
        check_options("acme+http://gpu?horizon=20&execute=21")
    with pytest.raises(ValueError, match=r"begin with acme\+http://"):
        check_options("nothing://gpu")


def test_who_speaks_to_it_in_another_dialect_is_told(port: int) -> None:
    advice = re.escape(f"looks like Acme's server; try acme+http://127.0.0.1:{port}")
    for scheme in ("go1+http", "ws", "xpolicylab"):
        with pytest.raises(HandshakeError, match=advice):
            connect(f"{scheme}://127.0.0.1:{port}", timeouts=QUICK)


def test_the_page_prints_the_example() -> None:
    page = (ROOT / "docs" / "adding-a-dialect.md").read_text()
    source = (EXAMPLE / "acme_robospa" / "client.py").read_text()
    blocks = re.findall(r"```python\n(.*?)```", page, re.S)
    assert blocks and [block for block in blocks if block not in source] == []
    assert (
        re.findall(r"```toml\n(.*?)```", page, re.S)[0] in (EXAMPLE / "pyproject.toml").read_text()
    )


def test_a_package_that_cannot_be_loaded_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    metadata = tmp_path / "broken-1.dist-info"
    metadata.mkdir()
    (metadata / "METADATA").write_text("Name: broken\nVersion: 1\n")
    (metadata / "entry_points.txt").write_text("[robospa.dialects]\nbad = no_such_module:X\n")
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.warns(UserWarning, match="dialect 'bad' is left out: cannot load"):
        assert "ws" in [dialect.scheme for dialect in dialects()]
