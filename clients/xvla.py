"""X-VLA behind its own `deploy.py`: POST /act, JSON whose arrays are JSON texts themselves.

Answered are T x 20 absolute end-effector poses, executed as our `ee` actions; with `space=joint`
T x 14 joint targets. From the second query of a trial on, the state sent is not measured but the
command executed last, as in X-VLA's own evaluation. Errors are a bare HTTP 400 without a reason.
`robospa serve xvla` runs the official class instead: several trials in one call, and noise from our
seeds, which X-VLA's own server draws from none.

    PYTHONPATH=X-VLA robospa serve xvla --option checkpoint=2toINF/X-VLA-RoboTwin2
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from robospa.action_space import ActionSpace
from robospa.clients import model_policy
from robospa.clients.chunks import (
    ChunkOptions,
    Count,
    camera_names,
    executed_before,
    invert_grippers,
    last_executed,
    refuse_unread,
)
from robospa.clients.dialect import Answer, ConnectionParams, Dialect, Probe
from robospa.clients.http import HttpSession, chunk_of, dumps
from robospa.clients.state_encoding import (
    ARM,
    LAYOUTS,
    ORDERS,
    StateEncoding,
    ee6d_to_actions,
    poses_to_ee6d,
)
from robospa.observation import CameraSpec, Observation
from robospa.protocol.errors import PolicyAnswerError, ProtocolViolation
from robospa.protocol.options import option
from robospa.protocol.policy import PolicySpec, TrialInfo


@dataclass(frozen=True)
class XvlaConventions(ChunkOptions):
    """What neither the checkpoint nor X-VLA's server says: the same whoever loads the model."""

    space: str = option("ee6d", "what the model answers", ("ee6d", "joint"))
    domain_id: Annotated[int, Meta(ge=0, le=29)] = option(
        6, "the soft prompt, 0 to 29; 6 is the released RoboTwin checkpoint's"
    )
    steps: Count = option(10, "denoising steps")
    quaternions: str = option(
        "xyzw", "how RoboTwin's w x y z are read: `xyzw` repeats the official slip", ORDERS
    )
    rotation: str = option("interleaved", "order of the six rotation numbers", LAYOUTS)
    colors: str = option("rgb", "order of an image's channels", ("rgb", "bgr"))
    cameras: str = option("head,left_wrist,right_wrist", "our cameras to send, in this order")
    proprio: str = option(
        "commanded",
        "after the first query: the last command executed, or what the robot measures",
        ("commanded", "measured"),
    )
    closed_above: float = option(
        0.7, "a gripper number of the 20 above this closes the gripper, any other opens it"
    )
    text_budget: Count | None = option(
        50, "tokens of text that the model's processor keeps; the rest is cut off in silence"
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        self.views  # noqa: B018

    @property
    def views(self) -> tuple[str, ...]:
        """Cameras in the order of the model's views."""
        return camera_names(self.cameras, 1)

    def spec_of_model(self, text_budget: int | None) -> PolicySpec:
        """The spec that these options make of a server or a model."""
        action = "joint" if self.space == "joint" else "ee"
        cameras = tuple(CameraSpec(name) for name in self.views)
        width = ActionSpace(action).width
        return self.spec_of(
            "xvla", cameras=cameras, action=action, action_dim=width, text_budget=text_budget
        )


WARNINGS = (
    "whether a checkpoint was trained with red and blue exchanged is invisible on the wire: one "
    "made from RoboTwin's files with X-VLA's loader of after January 2026 was (`colors=bgr`), one "
    "of the releases before, as the released checkpoint, was not",
    "the order of quaternions is invisible on the wire: the released RoboTwin checkpoint needs "
    "`quaternions=xyzw`, an own fine-tune with the correct order `wxyz`",
    "domain_id chooses the soft prompt: 6 is the released RoboTwin checkpoint's",
)
SILENT = (
    "X-VLA's server gives no reason: its log has it (a wrong domain_id, a wrong size of proprio, "
    "and actions of NaN or infinity, which JSON cannot carry, look like this)"
)


@dataclass(frozen=True)
class XvlaClientOptions(XvlaConventions):
    """What X-VLA's server does not say."""

    joint_grippers: str = option(
        "open",
        "what 1 means in a gripper number of `space=joint`, sent and answered, which are then "
        "executed as they are",
        ("open", "closed"),
    )
    text: str = option(
        "instruction",
        "text given to the model: the instruction, or the task's name as words, as in X-VLA's own "
        "RoboTwin evaluation",
        ("instruction", "task"),
    )


class XvlaSession(HttpSession):
    """One kept-alive HTTP connection, and the last chunk of the trial in progress."""

    def __init__(self, params: ConnectionParams, options: XvlaClientOptions) -> None:
        self._options = options
        self._task = ""
        self._chunk: NDArray[np.float32] | None = None
        self._asked_at = 0
        limit = options.text_budget if options.text == "instruction" else None
        spec = options.spec_of_model(text_budget=limit)
        super().__init__(params, "xvla", spec, options, WARNINGS, ("HTTP 400", SILENT))

    def reset(self, id: int, trial: TrialInfo) -> None:
        """The command of the trial before is forgotten."""
        self._chunk = None
        self._task = trial.task.replace("_", " ")

    def infer(self, id: int, observation: Observation, timeout: float) -> Answer:
        answer = self.ask(self.body(observation), timeout)
        if not isinstance(answer, Mapping) or "action" not in answer:
            raise ProtocolViolation(
                f"{self._server.url}{self.path} did not answer an 'action': is it X-VLA's server?"
            )
        refuse_unread(answer, ("action",))
        self._chunk = self._actions(chunk_of(answer["action"]))
        self._asked_at = executed_before(observation)
        return self._chunk, {}

    def _actions(self, chunk: object) -> NDArray[np.float32]:
        joint = self._options.space == "joint"
        width = ActionSpace("joint").width if joint else 2 * ARM
        if not isinstance(chunk, np.ndarray) or chunk.ndim != 2 or chunk.shape[1] != width:
            shape = chunk.shape if isinstance(chunk, np.ndarray) else type(chunk).__name__
            hint = "; is it a fine-tune in the other space (option space)?"
            raise PolicyAnswerError(f"the policy answered {shape}, not (T, {width}){hint}")
        if not joint:
            how = self._options
            return ee6d_to_actions(chunk, how.quaternions, how.rotation, how.closed_above)
        closed = self._options.joint_grippers == "closed"
        return invert_grippers(chunk, ActionSpace("joint")) if closed else chunk

    def body(self, observation: Observation) -> bytes:
        how, images = self._options, observation["images"]
        turn = 1 if how.colors == "rgb" else -1
        own = how.text == "instruction"
        sent = {
            **{f"image{n}": dumps(images[name][..., ::turn]) for n, name in enumerate(how.views)},
            "proprio": dumps(self.proprio(observation)),
            "language_instruction": observation.get("instruction", "") if own else self._task,
            "domain_id": how.domain_id,
            "steps": how.steps,
        }
        return dumps(sent).encode()

    def proprio(self, observation: Observation) -> NDArray[np.float64]:
        """The robot's state as the model reads it."""
        last = None
        if self._options.proprio == "commanded":
            last = last_executed(self._chunk, executed_before(observation) - self._asked_at)
        if self._options.space == "joint":
            state = np.array(observation["state"] if last is None else last, dtype=float)
            closed = self._options.joint_grippers == "closed"
            return invert_grippers(state, ActionSpace("joint")) if closed else state
        poses = observation["ee"] if last is None else last.reshape(2, 8)
        how = self._options
        return poses_to_ee6d(np.asarray(poses), how.quaternions, how.rotation)


def recognise(probe: Probe) -> bool:
    """A request without images is refused with a reason in `error`."""
    answer = probe.http("POST", "/act", b"{}")
    return answer.status == 400 and "error" in (answer.json() or {})


DIALECT = Dialect(
    server="X-VLA's server",
    scheme="xvla+http",
    secure_scheme="xvla+https",
    wire="http",
    port=8010,
    options=XvlaClientOptions,
    open_session=XvlaSession,
    recognise=recognise,
    sign="it answers a question without pictures with HTTP 400 and an `error`",
    deciding_options={
        "blue for red": "colors",
        "quaternion x y z w": "quaternions",
        "quaternion slip": "quaternions",
        "quaternions of the state x y z w": "quaternions",
        "gripper inverted": "joint_grippers",
    },
)


CHECKOUT = "a checkout of X-VLA"


@dataclass(frozen=True)
class XvlaServerOptions(XvlaConventions):
    """How X-VLA is loaded; the conventions are those of the client `xvla+http`."""

    checkpoint: str = option("", "folder or hub name of the model and its processor", needed=True)
    code: str | None = option(None, "checkout of X-VLA, or set PYTHONPATH")
    device: str = option("cuda", "device of the model")
    batch: Count = option(8, "observations in one call of the model, at most")


class Xvla(model_policy.ModelPolicy):
    """The official model and its processor."""

    def __init__(self, model: Any, processor: Any, options: XvlaServerOptions) -> None:
        super().__init__()
        self.model, self.processor, self.options = model, processor, options
        self.encoding = StateEncoding(
            options.space,
            options.quaternions,
            options.rotation,
            options.proprio,
            "closed",
            options.closed_above,
        )
        self.spec = replace(
            options.spec_of_model(options.text_budget),
            batch=options.batch,
            seeded=True,
            checkpoint=model_policy.describe_checkpoint(options.checkpoint),
            contract=model_policy.contract(options, normalisation="none", dtype="float32"),
        )

    def predict(self, queries: Sequence[model_policy.Query]) -> list[model_policy.Chunk]:
        """One chunk per query: `ee` actions (T, 16), or joint targets (T, 14)."""
        torch = model_policy.import_torch()
        shown = [self._shown(query) for query in queries]
        inputs = {name: torch.cat([one[name] for one in shown]) for name in shown[0]}
        inputs["proprio"] = torch.from_numpy(
            np.stack([self.encoding.state(query) for query in queries])
        )
        inputs["domain_id"] = torch.full((len(queries),), self.options.domain_id, dtype=torch.long)
        weight = next(iter(self.model.parameters()))
        inputs = {
            name: value.to(weight.device, weight.dtype)
            if value.is_floating_point()
            else value.to(weight.device)
            for name, value in inputs.items()
        }
        with torch.inference_mode(), model_policy.seeded_rows([query.seed for query in queries]):
            answer = self.model.generate_actions(**inputs, steps=self.options.steps)
        chunks = answer.float().cpu().numpy()[:, : self.options.horizon]
        return [self.encoding.actions(query, c) for query, c in zip(queries, chunks, strict=True)]

    def _shown(self, query: model_policy.Query) -> dict[str, Any]:
        """What the processor makes of images and text: tensors whose first axis is 1."""
        images = [query.observation["images"][name] for name in self.options.views]
        if self.options.colors == "bgr":
            images = [np.ascontiguousarray(image[..., ::-1]) for image in images]
        views = [model_policy.pillow_image().fromarray(image) for image in images]
        inputs = self.processor(views, query.observation["instruction"])
        lacking = {"input_ids", "image_input", "image_mask"} - set(inputs)
        if lacking:
            raise model_policy.ModelMissing(
                f"the checkpoint's processor gives no {', '.join(sorted(lacking))}"
            )
        return dict(inputs)


def create(options: XvlaServerOptions) -> Xvla:
    """Load the model. Raises ModelMissing."""
    torch = model_policy.import_torch()
    modeling = model_policy.import_code("models.modeling_xvla", options.code, CHECKOUT)
    processing = model_policy.import_code("models.processing_xvla", options.code, CHECKOUT)
    try:
        processor = processing.XVLAProcessor.from_pretrained(options.checkpoint)
        model = modeling.XVLA.from_pretrained(options.checkpoint, torch_dtype=torch.float32)
    except OSError as error:
        raise model_policy.ModelMissing(f"cannot load {options.checkpoint}: {error}") from error
    return Xvla(model.to(options.device).to(torch.float32).eval(), processor, options)
