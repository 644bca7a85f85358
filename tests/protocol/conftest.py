"""Fixture of the wire's tests."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest

from robospa.protocol.server import ServerThread


@pytest.fixture
def start() -> Iterator[Callable[..., ServerThread]]:
    """Start servers that end with the test; arguments as for ServerThread."""
    with ExitStack() as stack:
        yield lambda *args, **kwargs: stack.enter_context(ServerThread(*args, **kwargs))
