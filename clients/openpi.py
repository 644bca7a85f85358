"""openpi: our client to its server, our server of its policies, and training on our datasets.

`openpi://` reaches whatever runs behind `serve_policy`; `ws://` is our own protocol, `robospa.v1`,
and a server that does not know it is taken for openpi's. Our server answers clients of openpi too:
`robospa.protocol.openpi`.

`robospa serve openpi` runs openpi's policy in this process, with noise from our seeds. A
configuration whose `adapt_to_pi` is on is refused: it turns joints and grippers of another robot
into ours silently, which is invisible on the wire.

    robospa serve openpi --option config=pi05_robotwin --option checkpoint=...

A dataset `robospa/NAME` is trained on as `pi05_robospa_NAME`, all parameters, or
`pi05_lora_robospa_NAME` (`docs/policies/pi05.md`). Neither name is in openpi's own list, so its
scripts are started from here, in openpi's environment and folder.

The names are those that `to_openpi` sends at evaluation. openpi's own Aloha configurations name no
prompt among what they take from a dataset; without it, `prompt_from_task` has no effect.
"""

import json
import re
import runpy
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from robospa.action_space import ActionSpace
from robospa.clients.chunks import (
    STATE_TOKENS,
    ChunkOptions,
    Count,
    RobotOption,
    as_chunk,
    refuse_unread,
)
from robospa.clients.dialect import ConnectionParams, Dialect, Probe, StatelessSession
from robospa.clients.model_policy import Chunk, ModelPolicy, Query, describe_checkpoint, import_code
from robospa.clients.numpy_msgpack import unpack
from robospa.observation import CameraSpec, Observation
from robospa.protocol.client import WireClient, open_wire
from robospa.protocol.codec import Limits, encode
from robospa.protocol.errors import DecodeError, ProtocolViolation, ServerError, json_values
from robospa.protocol.openpi import CAMERA_NAMES, to_openpi
from robospa.protocol.options import option
from robospa.protocol.policy import PolicySpec
from robospa.protocol.transport import Timeouts, Transport

WARNINGS = (
    "adapt_to_pi is invisible on the wire: the served config must have adapt_to_pi=False for "
    "data in RoboTwin's conventions, or joint signs and grippers will be wrong",
    "openpi's sampling noise depends on the order of requests and cannot be seeded from here: two "
    "runs will differ",
)
KNOWN = {"actions", "state", "policy_timing", "server_timing"}
"""What an answer may have: the actions, the state as the model read it, and times."""


@dataclass(frozen=True)
class OpenPiClientOptions(ChunkOptions):
    """What `serve_policy` does not say."""

    cameras: str = option("head,left_wrist,right_wrist", "our cameras to send, comma separated")
    names: str = option("", "other camera names at the server, such as head:cam_top,front:cam_low")
    state: str = option("commanded", "which joints to send", ("commanded", "measured"))
    action_dim: int = option(
        ActionSpace().width, "columns of a chunk: 16 for two arms of seven joints"
    )
    text_budget: Count | None = option(
        150,
        "tokens that the model keeps of an instruction: pi0.5 has 200 for it and the state "
        "together, pi0 has 48",
    )
    committed: str = option(
        "",
        "for a server that does real-time chunking: its names of the committed actions and the "
        "delay, such as prev_chunk_left_over,inference_delay; empty: not sent",
    )
    extra: str = option("{}", "JSON map sent along at the top level of every observation")

    def __post_init__(self) -> None:
        super().__post_init__()
        self.camera_names, self.extra_fields, self.committed_names  # noqa: B018
        try:
            PolicySpec.from_json(self.spec.to_json())
        except DecodeError as error:
            raise ValueError(f"options that cannot be: {error}") from error

    @property
    def spec(self) -> PolicySpec:
        """What these options make of a server that says nothing of itself."""
        return self.spec_of(
            "openpi",
            cameras=tuple(CameraSpec(name) for name in self.cameras.split(",") if name),
            state=self.state,
            action_dim=self.action_dim,
            committed_actions=bool(self.committed),
            text_budget=self.text_budget,
        )

    @property
    def camera_names(self) -> dict[str, str]:
        """The server's name of each of our cameras."""
        names = dict(CAMERA_NAMES)
        for pair in filter(None, self.names.split(",")):
            ours, colon, theirs = pair.partition(":")
            if ours not in CAMERA_NAMES or not colon or not theirs:
                raise ValueError(f"option names: {pair!r} is not of the form camera:name")
            names[ours] = theirs
        return names

    @property
    def committed_names(self) -> tuple[str, str] | None:
        """The server's names of our `committed` and `delay`; None if it reads neither."""
        if not self.committed:
            return None
        rows, comma, delay = self.committed.partition(",")
        if not (comma and rows and delay) or "," in delay:
            raise ValueError(f"option committed={self.committed[:80]!r} is not two names")
        return rows, delay

    @property
    def extra_fields(self) -> dict[str, object]:
        try:
            extra = json.loads(self.extra)
        except (ValueError, RecursionError):
            extra = None
        if not isinstance(extra, dict):
            raise ValueError(f"option extra={self.extra[:80]!r} is not a JSON map")
        return extra


class OpenPiSession(StatelessSession):
    """One connection to an openpi server, over an open `transport`.

    The server sends one metadata map, then answers each observation map with a map that has
    `actions`. A text frame is an error with the server's traceback. There is no reset, no request
    id and no spec on the wire.
    """

    def __init__(
        self,
        transport: Transport,
        options: OpenPiClientOptions,
        timeouts: Timeouts,
        limits: Limits,
    ) -> None:
        self._transport, self._limits = transport, limits
        self._cameras, self._extra = options.camera_names, options.extra_fields
        self._committed = options.committed_names
        metadata = json_values(self._receive(timeouts.hello, "metadata"))
        super().__init__("openpi", options.spec, options, WARNINGS, metadata=metadata)

    def infer(
        self, id: int, observation: Observation, timeout: float
    ) -> tuple[object, Mapping[str, float]]:
        if self._transport.has_more():
            self.close()
            raise ProtocolViolation(f"{self._transport.url} sent data that was not requested")
        request = to_openpi(observation, self._cameras, self._extra, self._committed)
        self._transport.send(encode(request, self._limits))
        answer = self._receive(timeout, "actions")
        refuse_unread(answer, KNOWN)
        return as_chunk(answer.get("actions")), _timing(answer)

    def close(self) -> None:
        self._transport.close()

    def _receive(self, timeout: float, what: str) -> dict[str, object]:
        data = self._transport.receive(timeout, what)
        if isinstance(data, str):
            self.close()
            lines = data.strip().splitlines() or ["no text"]
            error = ServerError("openpi", lines[-1], True, self._transport.url)
            error.add_note(data)
            raise error
        try:
            value = unpack(data, self._limits, lenient=True)
        except DecodeError as error:
            self.close()
            raise ProtocolViolation(f"{self._transport.url}: unreadable {what}: {error}") from error
        if not isinstance(value, dict):
            self.close()
            raise ProtocolViolation(f"{self._transport.url}: {what} is not a map")
        return value


def _timing(answer: Mapping[str, object]) -> dict[str, float]:
    for name in ("policy_timing", "server_timing"):
        times = answer.get(name)
        if isinstance(times, dict) and isinstance(times.get("infer_ms"), (int, float)):
            return {"infer_ms": float(times["infer_ms"])}
    return {}


def open_session(params: ConnectionParams, options: OpenPiClientOptions) -> OpenPiSession:
    """A session with the server at `params.endpoint`."""
    address = replace(params.websocket_address(), token_kind="Api-Key")
    transport = Transport(address, params.timeouts, params.limits, None)
    try:
        return OpenPiSession(transport, options, params.timeouts, params.limits)
    except BaseException:
        transport.close()
        raise


def recognise(probe: Probe) -> bool:
    """It greets unasked, with a map; so may others."""
    open_session(probe.params, OpenPiClientOptions()).close()
    return True


DECIDING_OPTIONS = {"measured state": "state"}

DIALECT = Dialect(
    server="an openpi server",
    scheme="openpi",
    wire="websocket",
    options=OpenPiClientOptions,
    open_session=open_session,
    recognise=recognise,
    weak_sign=True,
    also_reaches=("ws",),  # our own server also answers an openpi client
    deciding_options=DECIDING_OPTIONS,
)


@dataclass(frozen=True)
class RobospaClientOptions(OpenPiClientOptions):
    """Used only if the server turns out to speak openpi's dialect; ours tells everything."""


def open_ours(params: ConnectionParams, options: RobospaClientOptions) -> WireClient:
    """A connection in the dialect that the server selects."""
    return open_wire(
        params.websocket_address(),
        params.timeouts,
        params.limits,
        lambda transport: OpenPiSession(transport, options, params.timeouts, params.limits),
    )


def recognise_ours(probe: Probe) -> bool:
    """It selects our subprotocol."""
    params = probe.params
    transport = Transport(params.websocket_address(), params.timeouts, params.limits)
    transport.close()
    return transport.subprotocol is not None


OURS = Dialect(
    server="a robospa.v1 server",
    scheme="ws",
    secure_scheme="wss",
    wire="websocket",
    options=RobospaClientOptions,
    open_session=open_ours,
    recognise=recognise_ours,
    also_reaches=("openpi",),
    deciding_options=DECIDING_OPTIONS,
)


NAME = re.compile(r"pi05_(?P<lora>lora_)?robospa_(?P<dataset>[A-Za-z0-9][A-Za-z0-9._-]*)")
SOURCES = "openpi's sources"
CAMERAS = {theirs: ours for ours, theirs in CAMERA_NAMES.items() if ours != "front"}
"""Our camera for each image of openpi's Aloha transform."""
WEIGHTS = "gs://openpi-assets/checkpoints/pi05_base/params"
STEPS = 20_000
BATCH = 16
"""Of the paper: its appendix on training; all parameters, from the released weights."""


def repack() -> dict[str, Any]:
    """What openpi is to take from a frame of our dataset, under its own names."""
    images = {theirs: f"observation.images.{ours}" for theirs, ours in CAMERAS.items()}
    return {
        "images": images,
        "state": "observation.state",
        "actions": "action",
        "prompt": "prompt",
    }


def train_config(name: str, code: str | None = None) -> Any:
    """The `TrainConfig` called `name`; ValueError for a name that is not of the form above.

    `code` is a folder with openpi's sources, where they are not installed. Raises ModelMissing.
    """
    match = NAME.fullmatch(name)
    if match is None:
        raise ValueError(
            f"{name!r} is no configuration of ours: pi05_robospa_NAME or pi05_lora_robospa_NAME, "
            "NAME being the folder of a dataset in $HF_LEROBOT_HOME/robospa"
        )
    configs = import_code("openpi.training.config", code, SOURCES)
    models = import_code("openpi.models.pi0_config", code, SOURCES)
    transforms = import_code("openpi.transforms", code, SOURCES)
    loaders = import_code("openpi.training.weight_loaders", code, SOURCES)
    kind: dict[str, bool | str] = {"pi05": True}
    extra: dict[str, Any] = {}
    if match["lora"]:
        kind |= {
            "paligemma_variant": "gemma_2b_lora",
            "action_expert_variant": "gemma_300m_lora",
        }
        extra = {"freeze_filter": models.Pi0Config(**kind).get_freeze_filter(), "ema_decay": None}
    return configs.TrainConfig(
        name=name,
        model=models.Pi0Config(**kind),
        data=configs.LeRobotAlohaDataConfig(
            repo_id=f"robospa/{match['dataset']}",
            adapt_to_pi=False,
            use_delta_joint_actions=True,
            repack_transforms=transforms.Group(inputs=[transforms.RepackTransform(repack())]),
            base_config=configs.DataConfig(prompt_from_task=True),
        ),
        weight_loader=loaders.CheckpointWeightLoader(WEIGHTS),
        num_train_steps=STEPS,
        batch_size=BATCH,
        **extra,
    )


def register(name: str, code: str | None = None) -> None:
    """Add the configuration called `name` to openpi's list, from which its scripts take them."""
    configs = import_code("openpi.training.config", code, SOURCES)
    configs._CONFIGS_DICT.setdefault(name, train_config(name, code))


@dataclass(frozen=True)
class OpenPiServerOptions(RobotOption):
    """How the policy is loaded."""

    config: str = option(
        "", "name of the training configuration in openpi, or pi05_robospa_NAME of our datasets"
    )
    checkpoint: str = option("", "its folder (or gs:// address)")
    code: str | None = option(None, "folder with openpi's sources, if it is not installed")
    adapt_to_pi: str = option(
        "refuse",
        "`refuse` a configuration with adapt_to_pi on, or `accept` it",
        ("refuse", "accept"),
    )
    batch: Count = option(8, "observations in one call, where the class has infer_batch")
    execute: Count | None = option(None, "actions executed before the next query; none for all")

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.config or not self.checkpoint:
            raise ValueError("options config and checkpoint are needed")


class OpenPi(ModelPolicy):
    """A policy of openpi's `create_trained_policy`."""

    def __init__(
        self,
        policy: Any,
        horizon: int,
        width: int,
        options: OpenPiServerOptions,
        text_budget: int | None = None,
    ) -> None:
        """`horizon` and `width`: the shape of the model's noise."""
        super().__init__()
        if options.execute is not None and options.execute > horizon:
            raise ValueError(f"option execute={options.execute}: at most the horizon {horizon}")
        self.policy, self.shape = policy, (horizon, width)
        self.batches = hasattr(policy, "infer_batch")
        self.spec = PolicySpec(
            name=f"openpi:{options.config}",
            horizon=horizon,
            execute=options.execute,
            batch=options.batch if self.batches else 1,
            seeded=True,
            embodiments=(options.embodiment,),
            action_dim=ActionSpace().width,
            text_budget=text_budget,
            checkpoint=describe_checkpoint(options.checkpoint),
        )

    def predict(self, queries: Sequence[Query]) -> list[Chunk]:
        inputs = [_observation(query) for query in queries]
        noise = [self._noise(query.seed) for query in queries]
        if self.batches and len(queries) > 1:
            answer = self.policy.infer_batch(inputs, noise=np.stack(noise))["actions"]
            return [np.array(chunk, np.float32) for chunk in answer]
        pairs = zip(inputs, noise, strict=True)
        return [np.array(self.policy.infer(i, noise=n)["actions"], np.float32) for i, n in pairs]

    def _noise(self, seed: int) -> Chunk:
        return np.random.default_rng(seed).standard_normal(self.shape, np.float32)


def _observation(query: Query) -> dict[str, Any]:
    """What the Aloha input transform takes: images (3, H, W), no other camera."""
    images = query.observation["images"]
    return {
        "state": np.array(query.observation["state"], np.float32),
        "images": {
            theirs: np.ascontiguousarray(images[ours].transpose(2, 0, 1))
            for theirs, ours in CAMERAS.items()
        },
        "prompt": query.observation["instruction"],
    }


def create(options: OpenPiServerOptions) -> OpenPi:
    """Load the policy. Raises ModelMissing, and ValueError for a configuration that is refused."""
    configs = import_code("openpi.training.config", options.code, SOURCES)
    loading = import_code("openpi.policies.policy_config", options.code, SOURCES)
    if NAME.fullmatch(options.config):
        register(options.config, options.code)
    config = configs.get_config(options.config)
    if options.adapt_to_pi == "refuse" and getattr(config.data, "adapt_to_pi", False):
        raise ValueError(
            f"openpi's configuration {options.config!r} has adapt_to_pi on, which bends joints and "
            "grippers for another robot; use one with adapt_to_pi=False, or say "
            "--option adapt_to_pi=accept"
        )
    policy = loading.create_trained_policy(config, options.checkpoint)
    model = config.model
    tokens = getattr(model, "max_token_len", None)
    if tokens is not None and getattr(model, "discrete_state_input", False):
        tokens = max(tokens - STATE_TOKENS, 1)
    return OpenPi(policy, model.action_horizon, model.action_dim, options, tokens)


def main(words: Sequence[str]) -> None:
    """Run openpi's script `words[0]` with the configurations that the other words name."""
    if not words:
        raise SystemExit("usage: python -m robospa.clients.openpi SCRIPT ARGUMENTS")
    script, *rest = words
    for word in rest:
        value = word.rpartition("=")[2]
        if NAME.fullmatch(value):
            register(value)
    sys.argv = [script, *rest]
    sys.path.insert(0, str(Path(script).resolve().parent))
    runpy.run_path(script, run_name="__main__")


if __name__ == "__main__":
    main(sys.argv[1:])
