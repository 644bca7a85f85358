"""Arrays as each project's own library reads and writes them, for the stand-in servers."""

from __future__ import annotations

import base64
from typing import Any

import numpy as np


def json_numpy(value: Any) -> Any:
    """json_numpy's reading: an object with `__numpy__` is an array."""
    if isinstance(value, dict) and "__numpy__" in value:
        data = base64.b64decode(value["__numpy__"])
        return np.frombuffer(data, np.dtype(value["dtype"])).reshape(value["shape"])
    return value


def openpi_in(value: dict[Any, Any]) -> Any:
    if b"__ndarray__" in value:
        return np.frombuffer(value[b"data"], np.dtype(value[b"dtype"])).reshape(value[b"shape"])
    return value


def openpi_out(value: Any) -> Any:
    return {
        b"__ndarray__": True,
        b"data": value.tobytes(),
        b"dtype": value.dtype.str,
        b"shape": list(value.shape),
    }


def nd_in(value: dict[Any, Any]) -> Any:
    """msgpack-numpy's reading."""
    if value.get(b"nd") is True:
        return np.frombuffer(value[b"data"], np.dtype(value[b"type"])).reshape(value[b"shape"])
    return value


def nd_out(value: Any) -> Any:
    return {
        b"nd": True,
        b"type": value.dtype.str,
        b"kind": b"",
        b"shape": value.shape,
        b"data": value.tobytes(),
    }


def named_in(value: dict[Any, Any]) -> Any:
    if "__ndarray__" in value:
        return np.frombuffer(value["data"], np.dtype(value["dtype"])).reshape(value["shape"])
    return value


def named_out(value: Any) -> Any:
    return {
        "__ndarray__": True,
        "data": value.tobytes(),
        "dtype": value.dtype.str,
        "shape": list(value.shape),
    }


def framed_in(value: dict[str, Any]) -> Any:
    if "__numpy_array__" in value:
        data = base64.b64decode(value["data"])
        return np.frombuffer(data, value["dtype"]).reshape(value["shape"])
    return value


def framed_out(value: Any) -> Any:
    data = base64.b64encode(value.tobytes()).decode()
    return {
        "__numpy_array__": True,
        "data": data,
        "dtype": str(value.dtype),
        "shape": list(value.shape),
    }
