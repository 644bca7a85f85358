"""Find things by name: `module:function`, or an entry point of the group "robospa.policies"."""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Callable
from importlib import metadata
from typing import Any

GROUP = "robospa.policies"


class UnknownName(Exception):
    """Nothing goes by that name; the message says what does."""


def load(path: str) -> Callable[..., Any]:
    """The callable at `module:function`; raises UnknownName."""
    module, _, name = path.partition(":")
    try:
        found = getattr(importlib.import_module(module), name)
    except (ImportError, AttributeError, ValueError) as error:
        raise UnknownName(f"cannot load {path!r}: {error}") from error
    if not callable(found):
        raise UnknownName(f"{path!r} is not callable")
    return found  # type: ignore[no-any-return]


def policy_names() -> tuple[str, ...]:
    """Policies that can be served by name."""
    return tuple(sorted({point.name for point in metadata.entry_points(group=GROUP)}))


def policy_factory(name: str) -> Callable[..., Any]:
    """The function that makes a policy, by entry-point name or `module:function`."""
    if ":" in name:
        if os.getcwd() not in sys.path:
            sys.path.append(os.getcwd())  # so that a policy's own folder is enough to serve it
        return load(name)
    for point in metadata.entry_points(group=GROUP):
        if point.name == name:
            return load(point.value)
    known = ", ".join(policy_names()) or "none (is robospa installed?)"
    raise UnknownName(f"no policy {name!r}; known are {known}, or give module:function")


def is_url(target: str) -> bool:
    """Whether `target` names a server rather than a policy of this process."""
    return "://" in target


def open_policy(target: str, options: dict[str, Any]) -> Any:
    """A policy from a server's URL (`options` go to `robospa.clients.connect`) or by name."""
    if is_url(target):
        from robospa.clients import connect

        return connect(target, **options)
    return policy_factory(target)()
