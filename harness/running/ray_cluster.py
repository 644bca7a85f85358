"""Finding and joining a Ray cluster. Ray is imported only here, when a run asks for it."""

from __future__ import annotations

import importlib
import importlib.util
import logging
import os
import signal
import socket
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from robospa.extras import remedy
from robospa.harness.pool import sigint_blocked

PROBE_SECONDS = 5.0
NONE_HERE = (
    "no Ray cluster runs on this machine; `ray start --head` starts one, "
    "--address local makes one for this run only"
)


class NoCluster(Exception):
    """There is no Ray, or no Ray cluster that can be used."""


@dataclass(frozen=True)
class RaySettings:
    """Where the cluster is and what a worker takes of it: `address` is auto, local, host:port or
    ray://host:port; at most `workers` workers, 0 for as many as fit."""

    address: str = "auto"
    workers: int = 0
    cpus: float = 1.0
    gpus: float = 0.0


def join_cluster(address: str) -> Any:
    """The module `ray`, connected to the cluster at `address` or having started one.

    Raises NoCluster. Ray logs nothing into a run's progress, and signals act as before.
    """
    check_address(address)
    os.environ["RAY_USAGE_STATS_ENABLED"] = "0"
    ray: Any = importlib.import_module("ray")
    options: dict[str, Any] = {"log_to_driver": False, "configure_logging": False}
    if address == "local":
        options.update(
            num_cpus=len(os.sched_getaffinity(0)),
            include_dashboard=False,
            object_store_memory=128 * 2**20,
            _node_ip_address="127.0.0.1",
        )
    elif address.startswith("ray://"):
        options = {"log_to_driver": False}
    logging.getLogger("ray").setLevel(logging.CRITICAL)
    on_sigterm = signal.getsignal(signal.SIGTERM)
    try:
        with sigint_blocked():
            ray.init(address=address, **options)
    except Exception as error:
        text = f"cannot join the Ray cluster at {address}: {error_line(error)}"
        raise NoCluster(_with_advice(text)) from error
    finally:
        with suppress(ValueError):  # not the main thread: then Ray has set none
            signal.signal(signal.SIGTERM, on_sigterm)
    return ray


def check_address(address: str) -> None:
    """Raises NoCluster if Ray is not installed or nothing listens at `address`.

    Ray itself would try for minutes.
    """
    if importlib.util.find_spec("ray") is None:
        raise NoCluster(f"Ray is not installed; {remedy('ray')}")
    if address == "local":
        return
    if address == "auto":
        last = _last_cluster()
        if reason := unreachable(last):
            raise NoCluster(f"{NONE_HERE} (the last one was at {last}: {reason})")
        return
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not host or not port.isdigit():
        raise NoCluster(
            f"--address {address!r} is not one of auto, local, HOST:PORT and ray://HOST:PORT"
        )
    if reason := unreachable(address):
        raise NoCluster(
            f"no Ray cluster answers at {address} ({reason}); `ray start --head` starts one"
        )


def _last_cluster() -> str:
    """Where `auto` looks; empty if Ray has not written it down here."""
    written = Path(os.environ.get("RAY_TMPDIR", "/tmp")) / "ray" / "ray_current_cluster"
    try:
        return os.environ.get("RAY_ADDRESS") or written.read_text().strip()
    except OSError:
        return ""


def unreachable(address: str) -> str:
    """Why nothing can be reached at `address`; empty if something listens, or it is no address."""
    host, _, port = address.removeprefix("ray://").rpartition(":")
    if not host or not port.isdigit():
        return ""
    try:
        socket.create_connection((host, int(port)), timeout=PROBE_SECONDS).close()
    except (OSError, OverflowError) as error:
        return str(error)
    return ""


def error_line(error: BaseException) -> str:
    """What was raised on the node, or the first sentence or so of what Ray says."""
    cause = getattr(error, "cause", None)
    text = " ".join((f"{type(cause).__name__}: {cause}" if cause else str(error)).split())
    return text if len(text) <= 300 else f"{text[:300]} ..."


def _with_advice(text: str) -> str:
    """What Ray says, with what helps."""
    if "Could not find any running Ray instance" in text:
        return NONE_HERE
    if any(hint in text for hint in ("uthenticat", "Failed to connect", "connection timeout")):
        text += "; if the cluster asks for a token, set RAY_AUTH_MODE=token here"
    return text
