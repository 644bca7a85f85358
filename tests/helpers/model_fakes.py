"""A torch of numpy arrays, and observations: what the servers' fast tests run on.

Only what the servers call is there. Its random functions ask an entered `TorchFunctionMode` first,
as torch's do.
"""

from __future__ import annotations

import contextlib
import pickle
import sys
import types
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from robospa.protocol.policy import PolicySpec, TrialInfo

COLORS = {"head": (200, 30, 40), "left_wrist": (20, 190, 60), "right_wrist": (50, 70, 180)}
"""The colour that fills each camera's image."""


OTHERS = ("randint", "bernoulli", "multinomial", "randn_like", "rand_like", "normal")
"""Random functions of torch that no server calls."""


class Tensor(np.ndarray):
    """An array with the methods of a tensor that are called."""

    device = "cpu"

    def to(self, *args: Any, **kwargs: Any) -> Tensor:
        dtypes = [a for a in (*args, kwargs.get("dtype")) if isinstance(a, (type, np.dtype))]
        return tensor(self.astype(dtypes[0]) if dtypes else self)

    def float(self) -> Tensor:
        return tensor(self.astype(np.float32))

    def cpu(self) -> Tensor:
        return self

    detach = cpu

    def numpy(self) -> Any:
        return np.asarray(self)

    def permute(self, *axes: int) -> Tensor:
        return tensor(self.transpose(axes))

    def view(self, *shape: Any) -> Any:
        if shape and isinstance(shape[0], int):
            return self.reshape(shape)
        return super().view(*shape)

    def is_floating_point(self) -> bool:
        return self.dtype.kind == "f"

    def normal_(self, mean: float = 0.0, std: float = 1.0, generator: Any = None) -> Tensor:
        raise NotImplementedError

    uniform_ = bernoulli_ = exponential_ = normal_

    def copy_(self, other: Any) -> Tensor:
        self[...] = other
        return self


def tensor(value: Any) -> Tensor:
    return np.asarray(value).view(Tensor)


class Generator:
    def __init__(self, device: str = "cpu") -> None:
        self.random = np.random.default_rng(0)

    def manual_seed(self, seed: int) -> Generator:
        assert 0 <= seed < 2**63
        self.random = np.random.default_rng(seed)
        return self


class Mode:
    """TorchFunctionMode: while entered, sees every random function."""

    entered: ClassVar[list[Mode]] = []

    def __enter__(self) -> Mode:
        Mode.entered.append(self)
        return self

    def __exit__(self, *error: object) -> None:
        Mode.entered.pop()


def fake_torch() -> Any:
    """A fresh module."""
    torch = types.ModuleType("torch")
    everyone = Generator()

    def random(draw: str) -> Any:
        def function(*size: Any, generator: Any = None, **kwargs: Any) -> Tensor:
            if Mode.entered:
                mode = Mode.entered.pop()  # a mode does not see what it calls itself
                try:
                    return mode.__torch_function__(  # type: ignore[attr-defined,no-any-return]
                        function, (), size, {**kwargs, "generator": generator}
                    )
                finally:
                    Mode.entered.append(mode)
            shape = kwargs.get("size", size)
            shape = shape[0] if len(shape) == 1 and not isinstance(shape[0], int) else shape
            source = generator or everyone
            made = getattr(source.random, draw)(size=tuple(shape))
            return tensor(made.astype(kwargs.get("dtype") or np.float32))

        return function

    values = {
        "Tensor": Tensor,
        "Generator": Generator,
        "randn": random("standard_normal"),
        "rand": random("random"),
        "randperm": random("random"),
        **dict.fromkeys(OTHERS, object()),
        "manual_seed": lambda seed: everyone.manual_seed(seed),
        "overrides": types.SimpleNamespace(TorchFunctionMode=Mode),
        "get_default_dtype": lambda: np.float32,
        "float32": np.float32,
        "bfloat16": np.float32,
        "long": np.int64,
        "no_grad": contextlib.nullcontext,
        "inference_mode": contextlib.nullcontext,
        "from_numpy": tensor,
        "stack": lambda parts, dim=0: tensor(np.stack(parts, dim)),
        "cat": lambda parts: tensor(np.concatenate(parts)),
        "full": lambda size, value, dtype: tensor(np.full(size, value, dtype)),
        "save": lambda value, path: Path(path).write_bytes(pickle.dumps(value)),
        "load": load,
        "nn": types.SimpleNamespace(functional=types.SimpleNamespace(pad=pad)),
    }
    for name, value in values.items():
        setattr(torch, name, value)
    return torch


def load(path: Any, map_location: str, weights_only: bool) -> Any:
    """torch.load, only as the servers may call it."""
    assert map_location == "cpu" and weights_only
    return pickle.loads(Path(path).read_bytes())


def pad(value: Any, sides: tuple[int, int]) -> Tensor:
    widths = [(0, 0)] * (value.ndim - 1) + [sides]
    return tensor(np.pad(np.asarray(value), widths))


@pytest.fixture
def torch(monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The fake torch in place of any real one."""
    module = fake_torch()
    monkeypatch.setitem(sys.modules, "torch", module)
    yield module
    assert not Mode.entered


def install(monkeypatch: pytest.MonkeyPatch, name: str, **values: Any) -> None:
    """A module `name` with these values."""
    module = types.ModuleType(name)
    module.__file__ = f"/nowhere/{name.replace('.', '/')}.py"
    for key, value in values.items():
        setattr(module, key, value)
    monkeypatch.setitem(sys.modules, name, module)


def trial(policy_seed: int = 1, instruction: str = "Pick up the largest cube.") -> TrialInfo:
    """A trial with that seed."""
    return TrialInfo("Pick", "aloha-agilex", instruction, policy_seed)


def seen(spec: PolicySpec, step: int = 0, **changes: Any) -> dict[str, Any]:
    """What `spec` asks for: images of one colour each, darker in the past."""
    images = {c.name: picture(c.name, c.width, c.height) for c in spec.cameras}
    past = {name: image // 2 for name, image in images.items()}
    state = np.linspace(-0.6, 0.7, 14, dtype=np.float32)
    state[[6, 13]] = 0.25, 1.0
    observation = {
        "images": images,
        "state": state,
        "ee": poses(),
        "instruction": trial().instruction,
        "step": step,
        "history": {offset: {"images": past, "state": state / 2} for offset in spec.history},
    }
    for image in (*images.values(), *past.values(), state):
        image.setflags(write=False)  # as they come from the wire
    return {**observation, **changes}


def picture(camera: str, width: int, height: int) -> Any:
    return np.tile(np.array(COLORS[camera], np.uint8), (height, width, 1))


def poses() -> Any:
    """Two poses: a quarter turn about z on the left, none on the right."""
    half = np.sqrt(0.5)
    return np.array(
        [[-0.3, 0.1, 0.9, half, 0, 0, half, 1.0], [0.3, 0.2, 0.8, 1, 0, 0, 0, 0.0]], np.float32
    )


def color_of(image: Any) -> tuple[int, ...]:
    """The mean colour of an image (H, W, 3)."""
    return tuple(np.asarray(image, float).reshape(-1, 3).mean(0).round().astype(int))


def close(color: Sequence[int], expected: Sequence[int], within: int = 2) -> bool:
    return all(abs(a - b) <= within for a, b in zip(color, expected, strict=True))


def first(policy: Any) -> tuple[Any, Any]:
    """The first observation of a trial, and what `policy` answers."""
    policy.reset(trial())
    observation = seen(policy.spec)
    return observation, policy.infer(observation)
