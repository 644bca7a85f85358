"""Any LeRobot policy by its path, behind our wire: pi0.5, X-VLA, SmolVLA, ACT, diffusion and more.

LeRobot's own server unpickles what it is sent; this one does not. The checkpoint's configuration
says which images and state the policy wants, its saved processors do the rest. Cameras are matched
to the configuration's names, never to their places; where a name says nothing, option `images`
must. No state of the policy outlives a query: frames that it wants from the past are asked for
anew, so trials never mix and several of them make one batch.

    robospa serve lerobot --option path=outputs/train/pi05/checkpoints/last/pretrained_model
"""

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from robospa.action_space import ActionSpace
from robospa.clients import model_policy
from robospa.clients.chunks import STATE_TOKENS, Count, RobotOption
from robospa.clients.state_encoding import LAYOUTS, ORDERS, SPACES, StateEncoding
from robospa.observation import CAMERAS, WIDTH, CameraSpec
from robospa.protocol.options import option
from robospa.protocol.policy import PolicySpec

STATE = "observation.state"
OBJECTS = "observation.environment_state"
STATE_STEP = "Pi05PrepareStateTokenizerProcessorStep"


def padded(width: int, transition: Any) -> Any:
    """The transition with a state of at least `width` numbers, zeros appended."""
    torch = model_policy.import_torch()
    state = transition["observation"][STATE]
    if (lacking := width - state.shape[-1]) > 0:
        state = torch.nn.functional.pad(state, (0, lacking))
    return {**transition, "observation": {**transition["observation"], STATE: state}}


def print_state(before: Any, width: int) -> None:
    """Make the processors of pi0.5 print `width` numbers of state; ValueError for others'."""
    steps = list(before.steps)
    places = [i for i, step in enumerate(steps) if type(step).__name__ == STATE_STEP]
    if not places:
        raise ValueError("option state_prompt is for pi0.5: these processors print no state")
    steps[places[0]].max_state_dim = width  # LeRobot < 0.5 pads to this itself
    steps.insert(places[0], partial(padded, width))
    before.steps = steps


CAMERA_WORDS = {
    "head": ("head", "high", "top"),
    "left_wrist": ("left",),
    "right_wrist": ("right",),
    "front": ("front", "low"),
}
"""Parts of an image's name that tell which of our cameras it is."""


@dataclass(frozen=True)
class ImageInput:
    """One image of the policy: its `key`, our `camera`, its declared size [px]."""

    key: str
    camera: str
    width: int
    height: int


def match_cameras(
    features: Mapping[str, Sequence[int]],
    images: str | None,
    sources: Mapping[str, str] | None = None,
) -> tuple[ImageInput, ...]:
    """Which of our cameras each image (key to (C, H, W)) is; raises ValueError.

    Keys that say `empty` are left out: the policy fills them itself. One that is among `sources`
    goes by its name there.
    """
    renamed = sources or {}
    shapes = {key: shape for key, shape in features.items() if "empty" not in key}
    named: dict[str, str] = {}
    for pair in (images or "").split(","):
        camera, colon, key = pair.strip().partition(":")
        if not pair.strip():
            continue
        if not colon or camera not in CAMERAS or key not in shapes or key in named:
            raise ValueError(
                f"option images={images!r}: {pair!r} is no camera:key with a camera of "
                f"{', '.join(CAMERAS)} and a key of {', '.join(shapes) or 'no images'}"
            )
        named[key] = camera
    inputs = []
    for key, (_, height, width) in shapes.items():
        camera = named.get(key) or _camera_named(renamed.get(key, key))
        inputs.append(ImageInput(key, camera, int(width), int(height)))
    cameras = [view.camera for view in inputs]
    if len(set(cameras)) != len(cameras):
        raise ValueError(f"two images of the policy are the same camera: {inputs}; set images")
    return tuple(inputs)


def _camera_named(key: str) -> str:
    words = re.split(r"[^a-z]+", key.rpartition(".")[2].lower())
    found = [
        camera for camera, names in CAMERA_WORDS.items() if any(name in words for name in names)
    ]
    if len(found) != 1:
        raise ValueError(
            f"the name {key!r} does not tell which camera it is; say "
            f"--option images=head:{key}, with a pair for every image"
        )
    return found[0]


@dataclass(frozen=True)
class LeRobotServerOptions(RobotOption):
    """How a LeRobot policy is loaded and fed."""

    path: str = option(
        "", "folder of the checkpoint (`pretrained_model`), or a hub name", needed=True
    )
    device: str = option("cuda", "device of the model")
    batch: Count = option(8, "observations in one call of the model, at most")
    images: str | None = option(
        None, "camera:key pairs, as head:observation.images.image; none to go by the keys' names"
    )
    resize: str = option(
        "declared",
        "`declared`: squash images to the size in the configuration, unless they were renamed in "
        "training (`rename_map`): then it is another data set's; `no`: leave it to the policy",
        ("declared", "no"),
    )
    colors: str = option("rgb", "order of an image's channels", ("rgb", "bgr"))
    tokenizer: str | None = option(None, "folder of the tokenizer, where the hub is out of reach")
    state_prompt: int | None = option(
        None,
        "pi0.5: numbers of state in its prompt, 14 (LeRobot >= 0.5) or 32 (before), as the "
        "checkpoint was trained; none: as the installed version does",
    )
    domain_id: int | None = option(
        None, "X-VLA: the soft prompt; none: as saved with the checkpoint (often 0)"
    )
    space: str | None = option(
        None,
        "joint, ee (16) or ee6d (20); none: by the width of the actions, of which 14 are joints",
    )
    quaternions: str = option(
        "xyzw", "ee6d: how w x y z are read; `xyzw` repeats RoboTwin's slip", ORDERS
    )
    rotation: str = option("interleaved", "ee6d: order of the six rotation numbers", LAYOUTS)
    proprio: str = option(
        "measured",
        "after the first query: what the robot reports, or the last command executed",
        ("commanded", "measured"),
    )
    grippers: str = option(
        "open", "joint: whether a gripper number says open or closed", ("open", "closed")
    )
    closed_above: float = option(0.7, "ee6d, closed: a number above this closes the gripper")
    execute: Count | None = option(
        None, "actions executed before the next query; none: n_action_steps of the configuration"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.state_prompt not in (None, 14, 32):
            raise ValueError(f"option state_prompt={self.state_prompt} is none of 14, 32")
        if self.space is not None and self.space not in SPACES:
            raise ValueError(f"option space={self.space!r} is none of {', '.join(SPACES)}")


class LeRobot(model_policy.ModelPolicy):
    """A LeRobot policy with its processors."""

    def __init__(self, policy: Any, before: Any, after: Any, options: LeRobotServerOptions) -> None:
        """Raises ValueError for a policy whose inputs or outputs are none of ours."""
        super().__init__()
        self.policy, self.before, self.after, self.options = policy, before, after, options
        config = policy.config
        inputs = {key: tuple(feature.shape) for key, feature in config.input_features.items()}
        images = {k: s for k, s in inputs.items() if k.startswith("observation.image")}
        ours = {STATE, *images, *(k for k, s in inputs.items() if k == OBJECTS and s == (WIDTH,))}
        unknown = sorted(inputs.keys() - ours)
        if unknown:
            raise ValueError(f"the policy wants {', '.join(unknown)}, which we do not have")
        # the data set's name of each image that the processors rename (`rename_map`)
        maps = [getattr(step, "rename_map", None) or {} for step in getattr(before, "steps", ())]
        self.sources = {theirs: source for one in maps for source, theirs in one.items()}
        self.views = match_cameras(images, options.images, self.sources)
        width = int(config.output_features["action"].shape[0])
        self.encoding = StateEncoding(
            options.space or _space(width, "action"),
            options.quaternions,
            options.rotation,
            options.proprio,
            options.grippers,
            options.closed_above,
        )
        joint = self.encoding.space == "joint"
        self.state: str | None = None
        if STATE in inputs:  # joints, as the actions are, or what else is as wide
            wide = _state_width(before) or int(inputs[STATE][0])
            self.state = "joint" if joint and wide == width else _space(wide, "state")
        frames = int(getattr(config, "n_obs_steps", 1) or 1)
        self.history = tuple(range(1 - frames, 0))
        if self.history and (self.state or "joint") != "joint":
            raise ValueError("a policy that wants earlier poses is not supported, only joints")
        if self.history and OBJECTS in inputs:
            raise ValueError("a policy that wants the objects of earlier frames is not supported")
        horizon = getattr(config, "chunk_size", None) or config.n_action_steps
        execute = options.execute or min(int(config.n_action_steps), int(horizon))
        if execute > horizon:
            raise ValueError(f"option execute={execute}: at most the policy's horizon {horizon}")
        self.spec = PolicySpec(
            name=f"lerobot:{config.type}",
            cameras=tuple(CameraSpec(view.camera) for view in self.views),
            action="joint" if joint else "ee",
            horizon=int(horizon),
            execute=execute,
            history=self.history,
            batch=options.batch,
            seeded=True,
            embodiments=(options.embodiment,),
            action_dim=width if joint else ActionSpace("ee").width,
            text_budget=_text_budget(config),
            checkpoint=model_policy.describe_checkpoint(options.path),
            contract=model_policy.contract(
                options, normalisation=_statistics(before), dtype=getattr(config, "dtype", "")
            ),
            environment_state=OBJECTS in inputs,
        )

    def predict(self, queries: Sequence[model_policy.Query]) -> list[model_policy.Chunk]:
        try:
            return self._predict(queries)
        except model_policy.NotByRow:
            return [chunk for query in queries for chunk in self._predict([query])]

    def _predict(self, queries: Sequence[model_policy.Query]) -> list[model_policy.Chunk]:
        torch = model_policy.import_torch()
        self.policy.reset()
        with torch.inference_mode():
            batch = self.before(self._batch(queries, None))
            batch.pop("action", None)  # empty, but a policy with queues would look for it
            if self.history:
                batch = self._queue(queries, batch)
            with model_policy.seeded_rows([query.seed for query in queries]):
                answer = self.policy.predict_action_chunk(batch)
            chunks = self.after(answer).float().cpu().numpy()[:, : self.spec.horizon]
        return [self.encoding.actions(query, c) for query, c in zip(queries, chunks, strict=True)]

    def _batch(self, queries: Sequence[model_policy.Query], offset: int | None) -> dict[str, Any]:
        """The observations of now, or of `offset` actions ago, as LeRobot's data loader gives them:
        images float (B, C, H, W) from 0 to 1."""
        torch = model_policy.import_torch()
        batch: dict[str, Any] = {"task": [query.observation["instruction"] for query in queries]}
        seen = [
            query.observation if offset is None else query.observation["history"][offset]
            for query in queries
        ]
        for view in self.views:
            images = np.stack([self._image(one["images"][view.camera], view) for one in seen])
            key = self.sources.get(view.key, view.key)
            batch[key] = torch.from_numpy(images).permute(0, 3, 1, 2).float() / 255
        if self.state is not None:
            if offset is None:
                state = [self.encoding.state(query, self.state) for query in queries]
            else:
                state = [np.array(one["state"], np.float32) for one in seen]
            batch[STATE] = torch.from_numpy(np.stack(state))
        if self.spec.environment_state:
            objects = [query.observation["environment_state"] for query in queries]
            batch[OBJECTS] = torch.from_numpy(np.stack(objects))
        return batch

    def _image(self, image: Any, view: ImageInput) -> Any:
        if self.options.resize == "declared" and view.key not in self.sources:
            image = model_policy.resize(image, view.width, view.height)
        return np.ascontiguousarray(image if self.options.colors == "rgb" else image[..., ::-1])

    def _queue(self, queries: Sequence[model_policy.Query], now: dict[str, Any]) -> dict[str, Any]:
        """Fill the policy's queues with the frames of all queries, oldest first."""
        torch = model_policy.import_torch()
        utils = model_policy.import_installed("lerobot.policies.utils")
        keys = list(self.policy.config.image_features)
        frames = [self.before(self._batch(queries, offset)) for offset in self.history]
        for frame in (*frames, now):
            if keys:
                frame["observation.images"] = torch.stack([frame[key] for key in keys], dim=-4)
            self.policy._queues = utils.populate_queues(self.policy._queues, frame, ["action"])
        return now


def _state_width(before: Any) -> int | None:
    """Numbers in the states that the policy was trained with, by its statistics, None without any.

    A policy fine-tuned from another checkpoint (`--policy.path`) declares that one's width.
    """
    for step in getattr(before, "steps", ()):
        mean = (getattr(step, "stats", None) or {}).get(STATE, {}).get("mean")
        if mean is not None:
            return len(mean)
    return None


def _statistics(before: Any) -> str:
    """A hash of the statistics of all inputs and actions; empty without any."""
    texts = sorted(
        f"{key} {kind} {getattr(value, 'tolist', lambda: value)()}"  # noqa: B023
        for step in getattr(before, "steps", ())
        for key, kinds in (getattr(step, "stats", None) or {}).items()
        for kind, value in kinds.items()
    )
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()[:16] if texts else ""


def _text_budget(config: Any) -> int | None:
    """Tokens that the policy reads of an instruction; None for one that reads none, or all."""
    tokens: int | None = getattr(config, "tokenizer_max_length", None)
    if tokens is None:
        return None
    return max(tokens - STATE_TOKENS, 1) if config.type == "pi05" else tokens


def _space(width: int, what: str) -> str:
    for space, size in SPACES.items():
        if size == width:
            return space
    sizes = ", ".join(f"{space} {size}" for space, size in SPACES.items())
    raise ValueError(f"the policy's {what} has {width} numbers, which is none of ours ({sizes})")


def create(options: LeRobotServerOptions) -> LeRobot:
    """Load a policy and its processors. Raises ModelMissing, ValueError."""
    model_policy.import_torch()
    configs = model_policy.import_installed("lerobot.configs.policies")
    factory = model_policy.import_installed("lerobot.policies.factory")
    overrides: dict[str, Any] = {"device_processor": {"device": options.device}}
    if options.tokenizer is not None:
        overrides["tokenizer_processor"] = {"tokenizer_name": options.tokenizer}
    try:
        config = configs.PreTrainedConfig.from_pretrained(options.path)
        config.device = options.device
        if options.tokenizer is not None and hasattr(config, "tokenizer_name"):
            config.tokenizer_name = options.tokenizer
        policy = factory.get_policy_class(config.type).from_pretrained(options.path, config=config)
        before, after = factory.make_pre_post_processors(
            config, options.path, preprocessor_overrides=overrides
        )
    except (OSError, KeyError, ImportError) as error:
        raise model_policy.ModelMissing(f"cannot load {options.path}: {error}") from error
    if options.domain_id is not None:
        steps = [step for step in before.steps if hasattr(step, "domain_id")]
        if not steps:
            raise ValueError("option domain_id is for X-VLA: these processors have no such step")
        steps[0].domain_id = options.domain_id
    if options.state_prompt is not None:
        print_state(before, options.state_prompt)
    return LeRobot(policy.eval(), before, after, options)
