"""What all servers of learned models share: one copy of the weights, and trials kept apart.

A model server is one object for all connections (`infer_batch`), so that weights are loaded once
and requests that arrive together can be one call. What belongs to a trial is kept by session.

A model's own code is imported lazily, from its own environment: from `PYTHONPATH`, or from the
folder given as option `code`. `ModelMissing` says what could not be found.
"""

import contextlib
import hashlib
import importlib
import io
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from robospa.observation import Observation
from robospa.protocol.errors import printable
from robospa.protocol.policy import PolicySpec, TrialInfo

Chunk = NDArray[np.float32]


class ModelMissing(Exception):
    """The model's code, weights or one of its files is not there; the message says which."""

    retriable = False


@dataclass
class Query:
    """One query: the observation, its trial, the `seed` of its noise, and the trial's `memory`,
    which is empty at the first query."""

    observation: Observation
    trial: TrialInfo
    seed: int
    memory: dict[str, Any] = field(default_factory=dict)


class ModelPolicy:
    """One model for all connections. A subclass has `spec` and `predict`."""

    spec: PolicySpec

    def __init__(self) -> None:
        self._trials: dict[int, tuple[TrialInfo, dict[str, Any]]] = {}

    def predict(self, queries: Sequence[Query]) -> list[Chunk]:
        """One chunk per query, float32 (T, D)."""
        raise NotImplementedError

    def begin(self, trial: TrialInfo) -> None:
        """Prepare what the trial needs before its first observation, such as its text."""

    def reset(self, trial: TrialInfo) -> None:
        """A trial of a lone caller, without sessions."""
        self.reset_session(0, trial)

    def infer(self, observation: Observation) -> Chunk:
        """The chunk for a lone caller."""
        return self.infer_batch([observation], [0])[0]

    def reset_session(self, session: int, trial: TrialInfo) -> None:
        self.begin(trial)
        self._trials[session] = trial, {}

    def end_session(self, session: int) -> None:
        self._trials.pop(session, None)

    def infer_batch(
        self, observations: Sequence[Observation], sessions: Sequence[int]
    ) -> list[Chunk]:
        """One chunk per observation. The noise of each follows from its trial's policy seed and
        its step alone, so neither neighbours in the batch nor a repeated call change it."""
        queries, kept = [], [self._trials[session] for session in sessions]
        for observation, (trial, memory) in zip(observations, kept, strict=True):
            source = np.random.SeedSequence([trial.policy_seed, int(observation["step"])])
            seed = int(source.generate_state(1, np.uint64)[0]) >> 1  # 0 to 2^63 - 1
            queries.append(Query(observation, trial, seed, dict(memory)))
        chunks = self.predict(queries)
        for query, (_, memory) in zip(queries, kept, strict=True):
            memory.update(query.memory)  # not before all are answered: else each is asked again
        return chunks


def import_code(module: str, code: str | None, whose: str) -> Any:
    """The `module` of a model's own code, found on PYTHONPATH or in the folder `code`.

    Raises ModelMissing.
    """
    if code is not None:
        folder = Path(code).expanduser().resolve()
        if not folder.is_dir():
            raise ModelMissing(f"there is no folder {folder}: option code must be {whose}")
        if str(folder) not in sys.path:
            sys.path.insert(0, str(folder))
    return import_installed(module, f", with {whose} on PYTHONPATH or as option code")


def import_installed(module: str, where: str = "") -> Any:
    """A `module` that the model's environment has installed; raises ModelMissing."""
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ModelMissing(
            f"cannot import {module} ({error}): run this in the environment of the model{where}"
        ) from error


def import_torch() -> Any:
    """PyTorch; raises ModelMissing."""
    return import_installed("torch")


def existing(path: str, what: str) -> str:
    """`path` with ~ expanded; ModelMissing if nothing is there."""
    found = Path(path).expanduser()
    if not found.exists():
        raise ModelMissing(f"there is no {found}: option {what} must name a file or a folder")
    return str(found)


SAMPLES, BLOCK = 16, 2**16
"""Blocks that are read of a file, spread evenly, and bytes of each."""
FILES = 10_000
"""Of a larger folder only the first files by name count."""


def describe_checkpoint(path: str) -> str:
    """A name that changes with the weights: the last one of `path` and a hash of what lies there,
    `29999 sample:6b1f...`. Weights are gigabytes and a server should start at once, so the hash is
    of names, sizes and samples: it guards against mistakes, not against a forger.

    A hub's name (`org/model`) is looked up in the cache of this machine, where its loader has put
    it, and gets its revision. What is found in neither place is named as it was given.
    """
    found = Path(path).expanduser()
    if os.path.exists(found):
        return f"{printable(found.resolve().name, 170)} sample:{sample_hash(found)}"
    revision = _cached_revision(path)
    return printable(f"{path}@{revision}" if revision else path, 200)


def sample_hash(path: Path) -> str:
    """16 hexadecimal digits of a file or folder: names, sizes and samples of the contents."""
    files = [path] if path.is_file() else sorted(p for p in path.rglob("*") if p.is_file())[:FILES]
    made = hashlib.sha256()
    for file in files:
        size = file.stat().st_size
        name = "" if file == path else file.relative_to(path).as_posix()
        made.update(f"{name}\0{size}\0".encode(errors="surrogateescape"))
        with file.open("rb") as opened:
            if size <= SAMPLES * BLOCK:
                made.update(opened.read())
                continue
            for number in range(SAMPLES):
                opened.seek((size - BLOCK) * number // (SAMPLES - 1))
                made.update(opened.read(BLOCK))
    return made.hexdigest()[:16]


UNDECLARED = re.compile(
    "checkpoint|path|code|config|stats|device|t5|t5_device|tokenizer|embeddings|batch"
    "|embodiment|horizon|execute|text_budget"
)
"""Options that say where a model is and runs, or that its spec has in fields of their own."""


def contract(options: object, **more: object) -> tuple[str, ...]:
    """`PolicySpec.contract`: `more` parts, and each option that decides answers by its name; what
    is None or empty is not declared."""
    chosen = {n: v for n, v in vars(options).items() if not UNDECLARED.fullmatch(n)}
    parts = {**more, **chosen}.items()
    return tuple(f"{n}={printable(str(p), 150)}" for n, p in parts if p not in (None, ""))


def _cached_revision(name: str) -> str:
    """The revision of a hub's model that lies in the cache of this machine; empty if none does."""
    try:
        from huggingface_hub import try_to_load_from_cache

        found = try_to_load_from_cache(name, "config.json")
    except (ImportError, ValueError, OSError):  # no such library, or no name of a hub
        return ""
    return Path(found).parent.name if isinstance(found, str) else ""


class NotByRow(Exception):
    """The model drew random numbers that do not belong to one row each."""


@contextlib.contextmanager
def seeded_rows(seeds: Sequence[int]) -> Iterator[None]:
    """Random numbers of torch from `seeds`, one per row of a batch, in models that take none.

    Diffusion and flow policies draw their start (and some every step) from torch's global
    generator. As long as this is entered, torch's random functions draw the first axis of their
    result from one generator per row, so that each gets what it would get alone.

    A draw whose first axis is not the batch comes from the global generator, seeded for it: right
    for one row, and refused with NotByRow for several.
    """
    torch = import_torch()
    generators = [torch.Generator("cpu").manual_seed(seed) for seed in seeds]
    torch.manual_seed(seeds[0])
    like = {torch.randn_like: torch.randn, torch.rand_like: torch.rand}
    fresh = {torch.randn, torch.rand}
    inplace = {torch.Tensor.normal_, torch.Tensor.uniform_}
    others = {torch.randint, torch.randperm, torch.bernoulli, torch.multinomial}
    others |= {torch.normal, torch.Tensor.bernoulli_, torch.Tensor.exponential_}

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
            kwargs, drawn = kwargs or {}, None
            if kwargs.get("generator") is None:
                drawn = self.drawn(function, args, kwargs)
            return function(*args, **kwargs) if drawn is None else drawn

        def drawn(self, function: Any, args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
            """The numbers by row; None where the call is none of ours."""
            result, dtype, device = None, kwargs.get("dtype"), kwargs.get("device")
            if function in fresh:
                result = rows(function, _shape(args, kwargs), dtype, device)
            elif function in like:
                model = args[0]
                dtype, device = dtype or model.dtype, device or model.device
                result = rows(like[function], model.shape, dtype, device)
            elif function is torch.normal and "size" in kwargs:
                mean, std = _two(args, kwargs, "mean", "std", (0.0, 1.0))
                unit = rows(torch.randn, kwargs["size"], dtype, device)
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
            elif function not in others:
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


Image = NDArray[np.uint8]
JPEG_QUALITY = 95
"""OpenCV's default."""


def resize(image: Image, width: int, height: int) -> Image:
    """uint8 (H, W, 3) to (height, width, 3), bilinear, aspect not kept; by OpenCV, as the
    official clients do, or else by Pillow, which differs by a grey level here and there."""
    if image.shape[:2] == (height, width):
        return image
    cv2 = _module("cv2")
    if cv2 is not None:
        return np.asarray(cv2.resize(image, (width, height), interpolation=cv2.INTER_LINEAR))
    pillow = pillow_image()
    resized = pillow.fromarray(image).resize((width, height), pillow.Resampling.BILINEAR)
    return np.asarray(resized)


def jpeg_round_trip(image: Image) -> Image:
    """What JPEG leaves of uint8 (H, W, 3) RGB, coded as if it were BGR: so official code does it,
    and the chroma that is lost is therefore another than usual."""
    cv2 = _module("cv2")
    if cv2 is not None:
        _, data = cv2.imencode(".jpg", np.ascontiguousarray(image))
        return np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR))
    stream = io.BytesIO()
    pillow = pillow_image()
    swapped = np.ascontiguousarray(image[..., ::-1])
    pillow.fromarray(swapped).save(stream, "JPEG", quality=JPEG_QUALITY)
    with pillow.open(stream, formats=("JPEG",)) as picture:
        return np.ascontiguousarray(np.asarray(picture.convert("RGB"))[..., ::-1])


def pillow_image() -> Any:
    """Pillow's Image module; raises ModelMissing."""
    found = _module("PIL.Image")
    if found is None:
        raise ModelMissing("images need Pillow, which is not installed: pip install pillow")
    return found


def _module(name: str) -> Any:
    try:
        return importlib.import_module(name)
    except ImportError:
        return None
