"""The expert's trial of one seed: the `run_trial` of every policy, without wire or pictures."""

import json
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import msgspec

from robospa.harness.pool import JobProcess, Pool
from robospa.harness.world import SceneUnstable, World
from robospa.protocol.policy import Policy
from robospa.tasks.sampling.places import LayoutError
from robospa.tasks.seeds import ListKey
from robospa.trial import TrialKey

ORACLE = "robospa.baselines.oracle:create"
"""By path, not by entry point: the harness does not import baselines, and a list of seeds must come
from this very policy."""
CRASHED = "the simulator crashed"
MOST_TEXT = 300
"""Characters of a reason that are kept."""


@dataclass(frozen=True)
class Attempt:
    """The expert's trial of one seed.

    `reason` says why it was not accepted, or is empty; `seconds` is processor time.
    """

    seed: int
    accepted: bool
    reason: str = ""
    seconds: float = 0.0


def attempt(world: World, policy: Policy, key: ListKey, seed: int, salt: str = "") -> Attempt:
    """Run the expert on one seed; it has to know the `salt` of hidden scenes, too.

    An error is a reason like another: a sweep of hours outlives it, and its table shows it.
    """
    from robospa.harness.trial import run_trial, task_parts

    trial = TrialKey(key.task, key.level, seed, key.embodiment, key.mode)
    parts = partial(task_parts, salt=salt)
    began = time.process_time()
    try:
        record = run_trial(world, policy, trial, policy_seed=0, parts=parts)
    except Exception as error:
        known = {SceneUnstable: "does not settle", LayoutError: "no layout"}
        said = (text for kind, text in known.items() if isinstance(error, kind))
        return Attempt(seed, False, one_line(f"{next(said, type(error).__name__)}: {error}"))
    failures = "; ".join(getattr(policy, "failures", ()))
    reason = "" if record.success else f"{record.end} {record.message} {failures}"
    seconds = round(time.process_time() - began, 4)
    return Attempt(seed, record.success, one_line(reason), seconds)


def one_line(text: str) -> str:
    """A reason as it is kept."""
    return " ".join(text.split())[:MOST_TEXT]


SeedJob = tuple[ListKey, int]
"""A seed of a list, to be tried."""


def expert(salt: str) -> Callable[[SeedJob], Attempt]:
    """What tries seeds in one process, on hidden scenes if there is a `salt`."""
    from robospa.harness.factory import policy_factory
    from robospa.harness.sim.sapien_world import SapienWorld

    world, policy = SapienWorld(render=False), policy_factory(ORACLE)(salt)
    return lambda job: attempt(world, policy, *job, salt)


def expert_pool(workers: int, salt: str = "") -> Pool[SeedJob, Attempt]:
    """Processes that run the expert; a seed at which several of them die is refused."""
    start = partial(JobProcess, expert, salt, name="expert")
    return Pool(start, max(1, workers), crashed=lambda job: Attempt(job[1], False, CRASHED))


class Evidence:
    """The attempts in `folder`; one process writes at a time."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder

    def path(self, key: ListKey) -> Path:
        """The file of a task, with all its levels."""
        return (self.folder / key.file).with_suffix(".jsonl")

    def attempts(self, key: ListKey, inputs: str) -> dict[int, Attempt]:
        """By seed, those made with these `inputs`."""
        path = self.path(key)
        found: dict[int, Attempt] = {}
        if not path.exists():
            return found
        for line in path.read_bytes().split(b"\n"):
            try:
                row = msgspec.json.decode(line)
                item = msgspec.convert(row, Attempt)
            except msgspec.DecodeError:
                continue
            if (row.get("level"), row.get("inputs")) == (key.level, inputs):
                found[item.seed] = item
        return found

    def add(self, key: ListKey, inputs: str, item: Attempt) -> None:
        """Append an attempt, written when this returns."""
        path = self.path(key)
        path.parent.mkdir(parents=True, exist_ok=True)
        line = json.dumps({"level": key.level, "inputs": inputs, **asdict(item)})
        with path.open("ab") as file:
            # After a torn line: the end of that one, which then is one that cannot be read.
            file.write((f"{line}\n" if _ends(path) else f"\n{line}\n").encode())


def _ends(path: Path) -> bool:
    """Whether the file ends with a whole line."""
    with path.open("rb") as file:
        if not file.seek(0, 2):
            return True
        file.seek(-1, 2)
        return file.read() == b"\n"
