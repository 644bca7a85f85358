"""Settings and fixture of the wire's tests."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack

import pytest
from hypothesis import HealthCheck, settings

from robospa.protocol.server import ServerThread

# Timing decides no test: a busy machine may be slow at generating examples.
settings.register_profile("wire", deadline=None, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("wire")


@pytest.fixture
def start() -> Iterator[Callable[..., ServerThread]]:
    """Start servers that end with the test; arguments as for ServerThread."""
    with ExitStack() as stack:
        yield lambda *args, **kwargs: stack.enter_context(ServerThread(*args, **kwargs))
