"""A policy from a server's URL, by `module:function`, or by the name of an entry point."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from robospa.registry import POLICIES, UnknownName, find, load

if TYPE_CHECKING:
    from robospa.protocol.policy import Policy


def policy_factory(name: str) -> Callable[..., Policy]:
    """The function that makes a policy, by entry-point name or `module:function`."""
    if re.fullmatch(r"[\w.-]+:\d+(/.*)?", name):
        raise UnknownName(f"{name!r} is no module:function; of a server write ws://{name}")
    if file := re.match(r"(.*/)?(\w+)\.py\b", name):
        module = f"{file[2]}:{name.partition(':')[2] or 'MyPolicy'}"
        raise UnknownName(f"{name!r} is a file: write {module}, in its folder or with PYTHONPATH")
    if ":" in name:
        if os.getcwd() not in sys.path:
            sys.path.append(os.getcwd())  # so that a policy's own folder is enough to serve it
        return load_function(name)
    try:
        return find(POLICIES, name, "policy")  # type: ignore[no-any-return]
    except UnknownName as error:
        raise UnknownName(f"{error}, or give module:function") from error.__cause__


def load_function(path: str) -> Callable[..., Any]:
    """The callable at `module:function`; raises UnknownName."""
    found = load(path)
    if not callable(found):
        raise UnknownName(f"{path!r} is not callable")
    return found  # type: ignore[no-any-return]


def is_url(target: str) -> bool:
    """True if `target` names a server, not a policy of this process."""
    return "://" in target


def open_policy(target: str, options: Mapping[str, Any]) -> Policy:
    """A policy from a server's URL (`options` go to `robospa.clients.connect`) or by name."""
    if is_url(target):
        from robospa.clients import connect

        return connect(target, **options)
    from robospa.protocol.policy_host import spec_of

    make = policy_factory(target)
    try:
        policy: Policy = make()
    except TypeError as error:
        raise UnknownName(f"{target} cannot be made: {error}") from error
    spec_of(policy)
    return policy
