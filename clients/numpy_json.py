"""Arrays as JSON objects, in the form that json_numpy gives them.

{"__numpy__": base64 of the bytes, "dtype": "|u1", "shape": [240, 320, 3]}
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.clients.chunks import as_chunk, plain_dtype


def array_object(array: NDArray[Any]) -> dict[str, object]:
    """The JSON object of an array; C order, little-endian."""
    plain = np.ascontiguousarray(array)
    if plain.dtype.byteorder == ">":
        plain = plain.astype(plain.dtype.newbyteorder("<"))
    data = base64.b64encode(plain.tobytes()).decode("ascii")
    return {"__numpy__": data, "dtype": plain.dtype.str, "shape": list(array.shape)}


def dumps(value: object) -> str:
    """JSON text in which arrays, anywhere, are their objects."""
    return json.dumps(value, default=_default, separators=(",", ":"))


def _default(value: object) -> object:
    if isinstance(value, np.ndarray):
        return array_object(value)
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} cannot be written as JSON")


def chunk_of(value: object) -> object:
    """An action chunk in a decoded answer as float32 (T, D), wherever that is possible.

    Lists of lists and array objects are understood; anything else is returned as it is, and
    refused by the check that follows every answer.
    """
    if isinstance(value, Mapping) and "__numpy__" in value:
        value = array_of(value, "__numpy__")
    return as_chunk(value)


def array_of(value: Mapping[str, Any], data: str) -> object:
    """The array whose base64 bytes are under the key `data`; `value` itself if it is none."""
    try:
        raw = base64.b64decode(value[data], validate=True)
        dtype = plain_dtype(value["dtype"])
        if dtype is None:
            return value
        return np.frombuffer(raw, dtype).reshape(tuple(value["shape"]))
    except (KeyError, TypeError, ValueError):
        return value
