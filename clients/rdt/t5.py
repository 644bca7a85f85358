"""T5 embeddings of instructions: from files made before, or made once and kept.

RDT's encoder has 4.8 billion parameters, four times the policy; an instruction needs it once. Files
are those of RDT's `encode_lang.py` (a dict with `instruction` and `embeddings`), read without
unpickling code. Where a folder is given, new embeddings are added to it in the same form, so that
the next run can do without T5.
"""

from __future__ import annotations

import hashlib
from collections import OrderedDict
from pathlib import Path
from typing import Any

from robospa.clients.model_policy import ModelMissing, import_installed, import_torch

CACHED = 512
"""Embeddings kept in memory; about 0.3 MB each."""


class Embeddings:
    """Instructions to tensors (1, L, 4096), on the CPU."""

    def __init__(
        self, folder: Path | None, t5: str | None, device: str, dtype: Any, max_tokens: int
    ) -> None:
        self._folder, self._t5, self._device, self._dtype = folder, t5, device, dtype
        self._max_tokens = max_tokens
        self._encoder: tuple[Any, Any] | None = None
        self._cache: OrderedDict[str, Any] = OrderedDict()
        self._files: dict[str, Path] = {}
        if folder is not None:
            if t5 is None and not folder.is_dir():
                raise ModelMissing(f"there is no folder {folder}, and option t5 is none")
            folder.mkdir(parents=True, exist_ok=True)
            for path in sorted(folder.glob("*.pt")):
                found = self._read(path)
                if "instruction" in found:  # a file without one cannot be identified
                    self._files[str(found["instruction"])] = path

    def find(self, instruction: str) -> Any:
        """The embedding of `instruction`; raises ModelMissing where nothing can make it."""
        if instruction not in self._cache:
            path = self._files.get(instruction)
            self._cache[instruction] = (
                self._read(path)["embeddings"] if path is not None else self._make(instruction)
            )
            if len(self._cache) > CACHED:
                self._cache.popitem(last=False)
        self._cache.move_to_end(instruction)
        tensor = self._cache[instruction]
        return tensor[None] if tensor.ndim == 2 else tensor

    def _read(self, path: Path) -> Any:
        torch = import_torch()
        try:
            found = torch.load(path, map_location="cpu", weights_only=True)
        except Exception as error:  # torch raises many kinds for broken files
            raise ModelMissing(f"{path} is no file of T5 embeddings: {error}") from error
        if not isinstance(found, dict) or getattr(found.get("embeddings"), "ndim", 0) not in (2, 3):
            raise ModelMissing(f"{path} is no file of T5 embeddings: it lacks 'embeddings'")
        return found

    def _make(self, instruction: str) -> Any:
        if self._t5 is None:
            raise ModelMissing(
                f"no file in {self._folder} has the embedding of {instruction!r}; make one with "
                "RDT's scripts/encode_lang.py, or give option t5"
            )
        torch = import_torch()
        tokenizer, encoder = self._load()
        tokens = tokenizer(
            instruction,
            return_tensors="pt",
            padding="longest",
            truncation=True,
            max_length=self._max_tokens,
        )["input_ids"].to(self._device)
        with torch.no_grad():
            made = encoder(tokens.view(1, -1)).last_hidden_state.detach().cpu()
        if self._folder is not None:
            name = hashlib.sha256(instruction.encode()).hexdigest()[:16]
            path = self._folder / f"{name}.pt"
            torch.save({"name": name, "instruction": instruction, "embeddings": made}, path)
            self._files[instruction] = path
        return made

    def _load(self) -> tuple[Any, Any]:
        """Tokenizer and encoder; the official embedder insists on a folder of a certain name, so
        the encoder is loaded without it."""
        if self._encoder is None:
            transformers = import_installed("transformers")
            encoder = transformers.T5EncoderModel.from_pretrained(
                self._t5, torch_dtype=self._dtype, low_cpu_mem_usage=True
            )
            tokenizer = transformers.AutoTokenizer.from_pretrained(self._t5)
            self._encoder = tokenizer, encoder.to(self._device).eval()
        return self._encoder
