"""GO-1 (AgiBot World): its own `deploy.py` (POST /act, JSON with arrays inside), or its class here.

The answer is a bare list (T, 14) of absolute joint targets. There is no reset, no spec and no
reason in its errors: every failure inside the server is a bare HTTP 500. `robospa serve go1` runs
the official class instead, one observation at a time: the policy seed of a trial decides the noise.

    PYTHONPATH=AgiBot-World robospa serve go1 --option checkpoint=... --option stats=...
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from robospa.clients import model_policy
from robospa.clients.chunks import ChunkOptions, Frequency
from robospa.clients.dialect import Answer, ConnectionParams, Dialect, Probe
from robospa.clients.http import HttpSession, chunk_of, dumps
from robospa.observation import Observation
from robospa.protocol.options import option


@dataclass(frozen=True)
class Go1Conventions(ChunkOptions):
    """What neither the checkpoint nor GO-1's server says."""

    wrists: str = option(
        "correct",
        "`swapped` sends each wrist image under the other's name, as RoboTwin's client does",
        ("correct", "swapped"),
    )
    ctrl_freq: Frequency = option(30.0, "control frequency [Hz] given to the network")

    @property
    def cameras(self) -> dict[str, str]:
        """Our camera for each image of the model."""
        if self.wrists == "swapped":
            return {"top": "head", "right": "left_wrist", "left": "right_wrist"}
        return {"top": "head", "right": "right_wrist", "left": "left_wrist"}

    def inputs(self, observation: Observation) -> dict[str, object]:
        """One query, arrays as they are in `observation`."""
        images, frequency = observation["images"], self.ctrl_freq
        return {
            **{theirs: images[ours] for theirs, ours in self.cameras.items()},
            "instruction": observation.get("instruction", ""),
            "state": np.asarray(observation["state"], np.float64)[None],
            "ctrl_freqs": np.array([int(frequency) if frequency.is_integer() else frequency]),
        }


WARNINGS = (
    "the control frequency that the model was trained with is invisible on the wire: `ctrl_freq` "
    "must equal ctrl_freq of its training config",
    "a stock AgileX config trains on one constant prompt: unless it maps final_prompt to the task, "
    "the model ignores the instruction",
)
SWAPPED = (
    "left and right wrist images are swapped, as in RoboTwin's GO-1 client, to reproduce "
    "numbers made with it"
)
SILENT = (
    "GO-1's server gives no reason: its log has it (actions of NaN or infinity, which JSON cannot "
    "carry, look like this too)"
)


@dataclass(frozen=True)
class Go1ClientOptions(Go1Conventions):
    """What GO-1's server does not say."""

    state: str = option("commanded", "which joints to send", ("commanded", "measured"))


class Go1Session(HttpSession):
    """One kept-alive HTTP connection."""

    def __init__(self, params: ConnectionParams, options: Go1ClientOptions) -> None:
        self._options = options
        spec = options.spec_of("go1", state=options.state)
        warnings = (*WARNINGS, SWAPPED) if options.wrists == "swapped" else WARNINGS
        super().__init__(params, "go1", spec, options, warnings, ("HTTP 500", SILENT))

    def infer(self, id: int, observation: Observation, timeout: float) -> Answer:
        body = dumps(self._options.inputs(observation)).encode()
        return chunk_of(self.ask(body, timeout)), {}


def recognise(probe: Probe) -> bool:
    """Any failure inside GO-1's server is a bare HTTP 500."""
    return probe.http("POST", "/act", b"{}").status == 500


DIALECT = Dialect(
    server="GO-1's server",
    scheme="go1+http",
    secure_scheme="go1+https",
    wire="http",
    port=9000,
    options=Go1ClientOptions,
    open_session=Go1Session,
    recognise=recognise,
    sign="it answers an empty question with a bare HTTP 500",
    weak_sign=True,
    deciding_options={"wrist images swapped": "wrists", "measured state": "state"},
)


@dataclass(frozen=True)
class Go1ServerOptions(Go1Conventions):
    """How GO-1 is loaded; the conventions are those of the client `go1+http`."""

    checkpoint: str = option("", "folder of the fine-tuned model", needed=True)
    stats: str | None = option(None, "dataset_stats.json of its training run, if it normalises")
    code: str | None = option(None, "checkout of AgiBot-World, or set PYTHONPATH")


class Go1(model_policy.ModelPolicy):
    """The official class, one observation at a time."""

    def __init__(self, model: Any, options: Go1ServerOptions, stats: str | None = None) -> None:
        """`stats`: the file of its normalisation, if it has one."""
        super().__init__()
        self.model, self.options = model, options
        checkpoint = model_policy.describe_checkpoint(options.checkpoint)
        self.spec = options.spec_of(
            "go1",
            seeded=True,
            checkpoint=checkpoint,
            contract=model_policy.contract(
                options,
                normalisation=model_policy.sample_hash(Path(stats)) if stats else "none",
                dtype="bfloat16",
            ),
        )

    def predict(self, queries: Sequence[model_policy.Query]) -> list[model_policy.Chunk]:
        chunks = []
        for query in queries:
            # what its server would have read from the wire, in arrays of its own
            sent = self.options.inputs(query.observation).items()
            own = {k: np.array(v) if isinstance(v, np.ndarray) else v for k, v in sent}
            with model_policy.seeded_rows([query.seed]):
                answer = self.model.inference(own)
            chunks.append(np.array(answer, np.float32)[: self.options.horizon])
        return chunks


def create(options: Go1ServerOptions) -> Go1:
    """Load the model. Raises ModelMissing."""
    model_policy.import_torch()
    source = model_policy.import_code("evaluate.deploy", options.code, "a checkout of AgiBot-World")
    stats = None if options.stats is None else model_policy.existing(options.stats, "stats")
    checkpoint = model_policy.existing(options.checkpoint, "checkpoint")
    return Go1(source.GO1Infer(checkpoint, stats), options, stats)
