"""A world, a task and policies that need no simulator and take microseconds.

The goal of every fake trial: the sum of all executed actions' first entry reaches the seed's last
digit plus one. A policy that sends ones needs (digit + 1) actions.
"""

import hashlib
import os
import signal
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robospa.geometry import Pose
from robospa.harness.action_decoder import ActionDecoder
from robospa.harness.robots import embodiment
from robospa.harness.trial import TrialSetup, trial_id
from robospa.harness.world import Poll, SceneUnstable, StepResult
from robospa.observation import CameraSpec
from robospa.protocol.errors import ConnectionLost
from robospa.protocol.policy import PolicySpec, TrialInfo
from robospa.tasks.events import Event, ObjectRole
from robospa.tasks.packs import PackError
from robospa.tasks.scene import Scene
from robospa.tasks.snapshot import Contact, Snapshot
from robospa.tasks.task import Level, Task
from robospa.trial import TrialKey

if TYPE_CHECKING:
    from robospa.harness.running.evaluate import Request
    from robospa.harness.running.worker import WorkerConfig
    from robospa.results.records.trial_record import TrialRecord

HERE = Pose((0.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0))
DECODER = ActionDecoder(embodiment("aloha-agilex"))
HOME = np.zeros((2, 6))
LIMIT = 20
SPEC = PolicySpec(name="fake", cameras=(), state="commanded", horizon=4)
KEYED = replace(SPEC, needs_trial_key=True)
"""Of a policy that goes by the trial's seed."""
FAKES: dict[str, Any] = {"world": "run_fakes:FakeWorld", "parts": "run_fakes:parts"}
"""Settings of a run of what is here."""


def trial_keys(count: int) -> list[TrialKey]:
    """Trials of a fake variant."""
    return [TrialKey("Pick_Fake", 1, 100000 + n) for n in range(count)]


def fake_config(folder: Path, policy: str = "run_fakes:FakePolicy", **given: Any) -> "WorkerConfig":
    """What a worker needs to know in the fake world, unless `given` name another."""
    from robospa.harness.running.worker import WorkerConfig

    return WorkerConfig(folder, policy, **{**FAKES, **given})


@dataclass(frozen=True)
class FakeStill:
    steps: int

    def draw(self, cameras: Sequence[CameraSpec]) -> list[NDArray[np.uint8]]:
        return [np.full((c.height, c.width, 3), self.steps % 256, np.uint8) for c in cameras]


class FakeWorld:
    def __init__(self) -> None:
        self.total = 0.0
        self.steps = 0
        self.views = 0
        self.seed = -1

    def load(self, scene: Scene, contacts: bool = False) -> None:
        if scene.seed == 666:
            raise SceneUnstable("the scene of seed 666 does not come to rest")
        if scene.seed == 667:
            raise PackError("the model of seed 667 has no mesh")
        self.total, self.steps, self.seed, self.views = 0.0, 0, scene.seed, 0

    def step(self, action: NDArray[np.float32], space: str, poll: Poll) -> StepResult:
        goals = DECODER.decode(action, space, HOME)  # refuses and clips as the real world does
        self.total += float(goals.joints[0, 0] if space == "joint" else action[0])
        self.steps += 1
        joints = None if space == "joint" else DECODER.joint_action(goals)
        return StepResult(5, poll(self.snapshot()), goals.problems, joints)

    def observe(self, spec: PolicySpec) -> dict[str, Any]:
        self.views += 1
        state = np.full(14, self.steps, np.float32)
        images = {c.name: self.render(c) for c in spec.cameras}
        return {"images": images, "state": state, "ee": np.zeros((2, 8), np.float32)}

    def render(self, camera: CameraSpec) -> NDArray[np.uint8]:
        return self.still().draw((camera,))[0]

    def still(self) -> FakeStill:
        return FakeStill(self.steps)

    def snapshot(self) -> Snapshot:
        points = (HERE.position, HERE.position)
        poses = {"sum": HERE}
        return Snapshot(
            0.02 * self.steps, poses, (self.total, 1.0), (HERE, HERE), grasp_points=points
        )

    def contacts(self) -> tuple[Contact, ...]:
        return ()

    def digest(self) -> str:
        return hashlib.sha256(f"{self.seed}/{self.total}/{self.steps}".encode()).hexdigest()[:16]

    def info(self) -> Mapping[str, Any]:
        return {"simulator": "fake"}

    def close(self) -> None: ...


class SumTracker:
    needs_contacts = False
    roles: Mapping[str, ObjectRole] = {}

    def __init__(self, wanted: float, total: int) -> None:
        self.wanted, self.total, self.done = wanted, total, 0

    def start(self, snapshot: Snapshot) -> tuple[Event, ...]:
        return ()

    def update(self, snapshot: Snapshot) -> tuple[Event, ...]:
        if snapshot.gripper[0] >= self.wanted:
            return (Event(snapshot.time, "success"),)
        if self.done == 0 and snapshot.gripper[0] >= self.wanted / 2:
            self.done = 1
            return (Event(snapshot.time, "subtask_done", index=0),)
        return ()

    def diagnostics(self) -> dict[str, Any]:
        return {"idle": 0}


def _unused(*_: Any) -> Any:
    raise AssertionError("the fake task is never drawn")


def fake_task(name: str) -> Task:
    levels = {n: Level(candidates=n + 1, subtasks=2, steps=LIMIT) for n in range(1, 6)}
    category = "GAC" if "Pick" in name else "RPF"
    functions = (_unused,) * 5
    return Task(name, category, levels, *functions, summary="fake", success="fake")


def parts(key: TrialKey, salt: str = "") -> TrialSetup:
    facts = {"salt": trial_id(key, salt)} if salt else {}
    scene = Scene(key.task, key.level, key.seed, key.embodiment, key.mode, (), facts)
    tracker = SumTracker(key.seed % 10 + 1, 2)
    return TrialSetup(
        scene, fake_task(key.task), tracker, f"level {key.level}: sum to {key.seed % 10 + 1}"
    )


def fake_task_of(key: TrialKey) -> Task:
    return parts(key).task


def run_here(config: "WorkerConfig", keys: Iterable[TrialKey]) -> "list[TrialRecord]":
    """The records of `keys`, one after the other by one worker in this process."""
    from robospa.harness.running.record_store import RecordWriter
    from robospa.harness.running.worker import Worker

    (config.folder / "actions").mkdir(parents=True, exist_ok=True)
    with (
        closing(RecordWriter(config.folder)) as writer,
        closing(Worker(config, writer)) as worker,
    ):
        return [worker.run(key, config.targets(key.task)[0]) for key in keys]


class FakePolicy:
    """Sends chunks of ones; subclasses misbehave."""

    def __init__(self, spec: PolicySpec = SPEC, length: int = 2) -> None:
        self.spec = spec
        self.length = length
        self.seen: list[dict[str, Any]] = []
        self.trial: TrialInfo | None = None

    @property
    def seed(self) -> int:
        """The seed of the trial, for a policy with the spec KEYED."""
        assert self.trial is not None and self.trial.key is not None
        return self.trial.key.seed

    @property
    def last_digit(self) -> int:
        """The last digit of the trial's seed, which its instruction tells."""
        assert self.trial is not None
        return int(self.trial.instruction.split()[-1]) - 1

    def reset(self, trial: TrialInfo) -> None:
        self.trial = trial
        self.seen = []

    def infer(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
        self.seen.append(dict(observation))
        return np.ones((self.length, 14), np.float32)


class NanPolicy(FakePolicy):
    def infer(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
        answer = super().infer(observation)
        answer[1, 3] = np.nan
        return answer


class KeyedPolicy(FakePolicy):
    """A policy that goes by the trial's seed."""

    def __init__(self) -> None:
        super().__init__(KEYED)


class CountedPolicy(KeyedPolicy):
    """Leaves a byte for each attempt that it is sent; in the first one at every third seed kills
    the driver, or interrupts it."""

    def reset(self, trial: TrialInfo) -> None:
        super().reset(trial)
        with (Path(os.environ["FAKE_MARKS"]) / str(self.seed)).open("ab", 0) as marks:
            marks.write(b"x")

    def infer(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
        time.sleep(0.02)
        if (
            self.seed % 3 == 0
            and (Path(os.environ["FAKE_MARKS"]) / str(self.seed)).stat().st_size == 1
        ):
            os.kill(os.getppid(), (signal.SIGKILL, signal.SIGINT)[self.seed % 2])
            time.sleep(9)
        return super().infer(observation)


class GonePolicy(FakePolicy):
    """As a client whose line is lost in every trial."""

    def infer(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
        raise ConnectionLost("nobody answers")


class SuicidalPolicy(KeyedPolicy):
    """Kills its own process in the first attempt at seed 100003, hangs in that at 100005."""

    def infer(self, observation: Mapping[str, Any]) -> NDArray[np.float32]:
        mark = Path(os.environ["FAKE_MARKS"]) / str(self.seed)
        if self.seed in (100003, 100005) and not mark.exists():
            mark.touch()
            if self.seed == 100003:
                os.kill(os.getpid(), signal.SIGKILL)
            time.sleep(60)
        return super().infer(observation)


class LastWordsPolicy(KeyedPolicy):
    """Kills its own process after the record of seed 100003 is on disk, before it is reported."""

    def end(self, outcome: Mapping[str, Any]) -> None:
        if self.seed == 100003:
            os.kill(os.getpid(), signal.SIGKILL)


def other() -> FakePolicy:
    return FakePolicy(replace(SPEC, name="other"))


def picky() -> FakePolicy:
    return FakePolicy(replace(SPEC, embodiments=("only-me",)))


class Broken:
    def __init__(self) -> None:
        raise RuntimeError("no Vulkan device")


def request(url: str | list[str], out: Path, trials: int = 2, resume: bool = False) -> "Request":
    """An evaluation in the fake world."""
    # What starts a run is not loaded into its workers: each would take a third longer to start.
    from robospa.harness.running.request import make_request
    from robospa.harness.settings import EvaluationSettings, updated

    given = {"policy": url, "out": out, "trials": trials, "workers": 1, "patience": 1}
    given |= {"tasks": "Pick_Blocks_Size", "levels": "1", "seeds": "100000-100009", "backoff": 0.01}
    given |= FAKES
    return make_request(updated(EvaluationSettings(), given), resume=resume)
