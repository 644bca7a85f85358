"""RDT-1B: the official class, unmodified, behind our wire (it has no server of its own).

Done here is what its callers do for RoboTwin: six images (head, right wrist, left wrist, one action
ago and now; at the first step there is no past), each brought to 640x480 and through JPEG; the
instruction as T5 hidden states; and the real robot's gripper factors, which the class applies in
both directions, cancelled, because our grippers are 0..1.

    PYTHONPATH=RoboticsDiffusionTransformer robospa serve rdt --option checkpoint=...
"""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from robospa.action_space import ActionSpace
from robospa.clients import model_policy
from robospa.clients.chunks import ChunkOptions
from robospa.observation import Observation
from robospa.protocol.options import option
from robospa.protocol.policy import TrialInfo

CACHED = 512
"""Embeddings kept in memory; about 0.3 MB each."""


class Embeddings:
    """Instructions to T5's tensors (1, L, 4096), on the CPU: from files made before, or made once.

    RDT's encoder has 4.8 billion parameters, four times the policy; an instruction needs it once.
    Files are those of RDT's `encode_lang.py` (a dict with `instruction` and `embeddings`), read
    without unpickling code; new ones are added to the folder, for runs without T5.
    """

    def __init__(
        self, folder: Path | None, t5: str | None, device: str, dtype: Any, max_tokens: int
    ) -> None:
        self._folder, self._t5, self._device, self._dtype = folder, t5, device, dtype
        self._max_tokens = max_tokens
        self._files: dict[str, Path] = {}
        self.find = lru_cache(CACHED)(self._find)
        if folder is None:
            return
        if t5 is None and not folder.is_dir():
            raise model_policy.ModelMissing(f"there is no folder {folder}, and option t5 is none")
        folder.mkdir(parents=True, exist_ok=True)
        for path in sorted(folder.glob("*.pt")):
            found = self._read(path)
            if "instruction" in found:  # a file without one cannot be identified
                self._files[str(found["instruction"])] = path

    def _find(self, instruction: str) -> Any:
        """The embedding of `instruction`; raises ModelMissing where nothing can make it."""
        path = self._files.get(instruction)
        tensor = self._make(instruction) if path is None else self._read(path)["embeddings"]
        return tensor[None] if tensor.ndim == 2 else tensor

    def _read(self, path: Path) -> Any:
        torch = model_policy.import_torch()
        wrong = f"{path} is no file of T5 embeddings"
        try:
            found = torch.load(path, map_location="cpu", weights_only=True)
        except Exception as error:  # torch raises many kinds for broken files
            raise model_policy.ModelMissing(f"{wrong}: {error}") from error
        if not isinstance(found, dict) or getattr(found.get("embeddings"), "ndim", 0) not in (2, 3):
            raise model_policy.ModelMissing(f"{wrong}: it lacks 'embeddings'")
        return found

    def _make(self, instruction: str) -> Any:
        if self._t5 is None:
            raise model_policy.ModelMissing(
                f"no file in {self._folder} has the embedding of {instruction!r}; make one with "
                "RDT's scripts/encode_lang.py, or give option t5"
            )
        torch = model_policy.import_torch()
        tokenizer, encoder = self._encoder
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

    @cached_property
    def _encoder(self) -> tuple[Any, Any]:
        """Tokenizer and encoder; the official embedder insists on a folder of a certain name, so
        the encoder is loaded without it."""
        transformers = model_policy.import_installed("transformers")
        encoder = transformers.T5EncoderModel.from_pretrained(
            self._t5, torch_dtype=self._dtype, low_cpu_mem_usage=True
        )
        tokenizer = transformers.AutoTokenizer.from_pretrained(self._t5)
        return tokenizer, encoder.to(self._device).eval()


VIEWS = ("head", "right_wrist", "left_wrist")
"""Our cameras in the order of the model's images."""
STATE_FACTORS = (4.7908, 4.7888)
"""By which the official class divides the grippers of the state."""
ACTION_FACTORS = (11.8997, 13.9231)
"""By which it multiplies those of its actions."""


@dataclass(frozen=True)
class RdtServerOptions(ChunkOptions):
    """How RDT is loaded and fed."""

    checkpoint: str = option(
        "", "folder or file (.pt, .safetensors) with the fine-tuned weights", needed=True
    )
    code: str | None = option(None, "checkout of RoboticsDiffusionTransformer, or set PYTHONPATH")
    config: str | None = option(None, "the model's YAML; none for configs/base.yaml in the code")
    vision: str = option("google/siglip-so400m-patch14-384", "SigLIP: a hub name or a folder")
    embeddings: str | None = option(
        None, "folder of .pt files with T5 embeddings; new ones are added to it"
    )
    t5: str | None = option(
        "google/t5-v1_1-xxl", "T5 for instructions without a file (9.5 GB); none: files only"
    )
    t5_device: str | None = option(None, "device of T5; none for that of the model")
    device: str = option("cuda", "device of the model")
    dtype: str = option("bfloat16", "of weights and activations", ("bfloat16", "float32"))
    ctrl_freq: int = option(25, "control frequency [Hz] given to the network")
    grippers: str = option(
        "cancelled",
        "`cancelled` undoes the real robot's gripper factors; `none` if the class has none (fork)",
        ("cancelled", "none"),
    )
    jpeg: bool = option(True, "put images through JPEG, as in training")

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.embeddings is None and self.t5 is None:
            raise ValueError("options embeddings and t5 are both none: instructions need one")


class Rdt(model_policy.ModelPolicy):
    """The official class, one observation at a time: it stacks images of one sample only."""

    def __init__(self, model: Any, embeddings: Embeddings, options: RdtServerOptions) -> None:
        super().__init__()
        self.model, self.embeddings, self.options = model, embeddings, options
        checkpoint = model_policy.describe_checkpoint(options.checkpoint)
        contract = model_policy.contract(options, normalisation="none", pictures="640x480")
        self.spec = options.spec_of(
            "rdt", history=(-1,), seeded=True, checkpoint=checkpoint, contract=contract
        )

    def begin(self, trial: TrialInfo) -> None:
        """Encode the trial's instruction now, so that no step waits for it."""
        self.embeddings.find(trial.instruction)

    def predict(self, queries: Sequence[model_policy.Query]) -> list[model_policy.Chunk]:
        return [self._one(query.observation, query.seed) for query in queries]

    def _one(self, observation: Observation, seed: int) -> model_policy.Chunk:
        torch = model_policy.import_torch()
        now, first = observation["images"], int(observation["step"]) < 1
        past = None if first else observation["history"][-1]["images"]
        images = [None if past is None else self._picture(past[name]) for name in VIEWS]
        images += [self._picture(now[name]) for name in VIEWS]
        state = np.array(observation["state"], np.float32)
        if self.options.grippers == "cancelled":
            state[ActionSpace("joint").grippers] *= STATE_FACTORS
        with torch.inference_mode(), model_policy.seeded_rows([seed]):
            answer = self.model.step(
                torch.from_numpy(state[None]),
                images,
                self.embeddings.find(observation["instruction"]),
            )
        chunk: model_policy.Chunk = answer.float().cpu().numpy()[0, : self.options.horizon].copy()
        if self.options.grippers == "cancelled":
            chunk[:, ActionSpace("joint").grippers] /= np.array(ACTION_FACTORS, np.float32)
        return chunk

    def _picture(self, image: Any) -> Any:
        large = model_policy.resize(image, 640, 480)
        return model_policy.pillow_image().fromarray(
            model_policy.jpeg_round_trip(large) if self.options.jpeg else large
        )


def create(options: RdtServerOptions) -> Rdt:
    """Load the model. Raises ModelMissing."""
    torch = model_policy.import_torch()
    source = model_policy.import_code(
        "scripts.agilex_model", options.code, "a checkout of RoboticsDiffusionTransformer"
    )
    dtype = getattr(torch, options.dtype)
    left, right = ActionSpace("joint").joints
    # RoboTwin's fork of the class asks for the joints of both arms; the official one ignores them.
    args = {
        "arm_dim": {"left_arm_dim": left, "right_arm_dim": right},
        **read_config(options.config, source),
    }
    model = source.create_model(
        args=args,
        dtype=dtype,
        device=options.device,
        pretrained=model_policy.existing(options.checkpoint, "checkpoint"),
        pretrained_vision_encoder_name_or_path=options.vision,
        control_frequency=options.ctrl_freq,
    )
    embeddings = Embeddings(
        None if options.embeddings is None else Path(options.embeddings).expanduser(),
        options.t5,
        options.t5_device or options.device,
        dtype,
        int(args["dataset"]["tokenizer_max_length"]),
    )
    return Rdt(model, embeddings, options)


def read_config(path: str | None, source: Any) -> dict[str, Any]:
    """The model's YAML as a map; by default that beside the code. Raises ModelMissing."""
    yaml = model_policy.import_installed("yaml")
    chosen = path or str(Path(source.__file__).resolve().parents[1] / "configs" / "base.yaml")
    value = yaml.safe_load(Path(model_policy.existing(chosen, "config")).read_text())
    if not isinstance(value, dict) or "dataset" not in value:
        raise model_policy.ModelMissing(f"{chosen} is no configuration of RDT: it lacks 'dataset'")
    return value
