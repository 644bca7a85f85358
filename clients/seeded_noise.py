"""Noise that follows from seeds, row by row, in models that take none.

Diffusion and flow policies draw their start (and some every step) from torch's global generator. A
policy seed must decide it, on every device, and in a batch every row must get what it would get
alone. `seeded_rows` brings that about without touching the model: as long as it is entered,
torch's random functions draw the first axis of their result from one generator per row.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from typing import Any

from robospa.clients.model_policy import import_torch


class NotByRow(Exception):
    """The model drew random numbers that do not belong to one row each."""


@contextlib.contextmanager
def seeded_rows(seeds: Sequence[int]) -> Iterator[None]:
    """Random numbers of torch from `seeds`, one per row of a batch.

    A draw whose first axis is not the batch comes from the global generator, seeded for it: right
    for one row, and refused with NotByRow for several.
    """
    torch = import_torch()
    generators = [torch.Generator("cpu").manual_seed(seed) for seed in seeds]
    torch.manual_seed(seeds[0])
    like = {
        torch.randn_like: torch.randn,
        torch.rand_like: torch.rand,
    }
    fresh = {torch.randn, torch.rand}
    inplace = {torch.Tensor.normal_, torch.Tensor.uniform_}
    others = {
        torch.randint,
        torch.randperm,
        torch.bernoulli,
        torch.multinomial,
        torch.Tensor.bernoulli_,
        torch.Tensor.exponential_,
    }

    def rows(draw: Callable[..., Any], shape: Sequence[int], dtype: Any, device: Any) -> Any:
        if not shape or shape[0] != len(generators):
            return None
        one = [draw(tuple(shape[1:]), generator=g, dtype=torch.float32) for g in generators]
        return torch.stack(one).to(device=device, dtype=dtype or torch.get_default_dtype())

    class ByRow(torch.overrides.TorchFunctionMode):  # type: ignore[misc,name-defined]
        def __torch_function__(
            self,
            function: Any,
            types: Any,
            args: tuple[Any, ...] = (),
            kwargs: dict[str, Any] | None = None,
        ) -> Any:
            kwargs = dict(kwargs or {})
            if kwargs.get("generator") is None:
                drawn = self.drawn(function, args, kwargs)
                if drawn is not None:
                    return drawn
            return function(*args, **kwargs)

        def drawn(self, function: Any, args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
            """The numbers by row; None where the call is none of ours."""
            result = None
            if function in fresh:
                result = rows(
                    function, _shape(args, kwargs), kwargs.get("dtype"), kwargs.get("device")
                )
            elif function in like:
                model = args[0]
                dtype, device = kwargs.get("dtype"), kwargs.get("device")
                result = rows(
                    like[function], model.shape, dtype or model.dtype, device or model.device
                )
            elif function is torch.normal and "size" in kwargs:
                mean, std = _two(args, kwargs, "mean", "std", (0.0, 1.0))
                unit = rows(torch.randn, kwargs["size"], kwargs.get("dtype"), kwargs.get("device"))
                result = None if unit is None else unit * std + mean
            elif function in inplace:
                target, normal = args[0], function is torch.Tensor.normal_
                names = ("mean", "std", (0.0, 1.0)) if normal else ("from", "to", (0.0, 1.0))
                low, high = _two(args[1:], kwargs, *names)
                draw = torch.randn if normal else torch.rand
                unit = rows(draw, target.shape, target.dtype, target.device)
                if unit is not None:
                    scaled = unit * high + low if normal else unit * (high - low) + low
                    result = target.copy_(scaled)
            elif function not in others and function is not torch.normal:
                return None
            if result is None and len(generators) > 1:
                raise NotByRow(f"{function.__name__} was not drawn row by row")
            return result

    with ByRow():
        yield


def _shape(args: tuple[Any, ...], kwargs: dict[str, Any]) -> tuple[int, ...]:
    size = kwargs.get("size", args)
    if len(size) == 1 and not isinstance(size[0], int):
        size = size[0]
    return tuple(size)


def _two(
    args: tuple[Any, ...], kwargs: dict[str, Any], first: str, second: str, default: Any
) -> tuple[float, float]:
    """Two parameters given by place or by name."""
    low = args[0] if args else kwargs.get(first, default[0])
    high = args[1] if len(args) > 1 else kwargs.get(second, default[1])
    return low, high
