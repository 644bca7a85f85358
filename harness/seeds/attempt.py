"""The expert's trial of one seed, and the first accepted seeds of many variants.

An attempt is the `run_trial` of every policy, without wire or pictures. Seeds are tried in
ascending order. No more of them are on their way than a list still lacks, and meanwhile the
processes go on with the next variant: all are busy, and the seeds tried are exactly those up to the
last one of the list.
"""

import json
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import asdict, dataclass, field
from functools import partial
from pathlib import Path

import msgspec

from robospa.harness.pool import JobProcess, Pool
from robospa.harness.progress import Bar
from robospa.harness.seeds.lists import inputs
from robospa.harness.world import SceneUnstable, World
from robospa.protocol.policy import Policy
from robospa.tasks.sampling.places import LayoutError
from robospa.tasks.seeds import ListKey
from robospa.text import duration_text
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

    def attempts(self, key: ListKey, depends: str) -> dict[int, Attempt]:
        """By seed, those made with `depends`, the inputs."""
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
            if (row.get("level"), row.get("inputs")) == (key.level, depends):
                found[item.seed] = item
        return found

    def add(self, key: ListKey, depends: str, item: Attempt) -> None:
        """Append an attempt, written when this returns."""
        path = self.path(key)
        path.parent.mkdir(parents=True, exist_ok=True)
        line = json.dumps({"level": key.level, "inputs": depends, **asdict(item)})
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


Submit = Callable[[ListKey, int], Future[Attempt]]
"""Has a seed tried, in a while."""
PATIENCE = 20
"""A variant is given up when more seeds than this, and more than half of all, were refused."""


@dataclass
class Search:
    """The search for the first `count` accepted seeds of `key` from `start` up.

    `attempts` are those that have finished, by seed; some may be known beforehand. One that only
    `measures` tries `count` seeds, whatever comes of them.
    """

    key: ListKey
    start: int
    count: int
    measures: bool = False
    attempts: dict[int, Attempt] = field(default_factory=dict)
    running: set[int] = field(default_factory=set)

    def row(self) -> list[Attempt]:
        """Finished attempts from `start` up without a gap, to the last one that is needed: the
        list is full, or given up."""
        found: list[Attempt] = []
        counted = 0
        while counted < self.count and (item := self.attempts.get(self.start + len(found))):
            found.append(item)
            counted += self._counts(item)
            if _hopeless(len(found) - counted, len(found)):
                break
        return found

    def _counts(self, item: Attempt) -> bool:
        return item.accepted or self.measures

    @property
    def accepted(self) -> list[int]:
        """The first accepted seeds: `count` of them when the search is done."""
        return [item.seed for item in self.row() if item.accepted]

    @property
    def refused(self) -> list[Attempt]:
        """Refused attempts before the last accepted seed."""
        return [item for item in self.row() if not item.accepted]

    @property
    def given_up(self) -> bool:
        """Whether the expert does not solve this variant often enough."""
        tried = self.row()
        return _hopeless(sum(not self._counts(item) for item in tried), len(tried))

    @property
    def done(self) -> bool:
        return not self.running and self.missing() is None

    def missing(self) -> int | None:
        """The next seed to try; None while enough are accepted or on their way."""
        if self.given_up:
            return None
        hopeful, seed = 0, self.start
        while hopeful < self.count:
            found = self.attempts.get(seed)
            if found is None and seed not in self.running:
                return seed
            hopeful += found is None or self._counts(found)
            seed += 1
        return None


def _hopeless(refused: int, tried: int) -> bool:
    return refused > PATIENCE and 2 * refused > tried


Note = Callable[[Search, Attempt], None]
"""Called with every attempt that has finished; it may put less in its place in `attempts`."""


def sweep(
    submit: Submit,
    workers: int,
    searches: Iterable[Search],
    note: Note = lambda search, item: None,
) -> Iterator[Search]:
    """Every search once it is done, in the order in which they are. `workers` try what is
    submitted."""
    waiting, opened = iter(searches), list[Search]()
    tasks: dict[Future[Attempt], Search] = {}
    while True:
        yield from _take_done(opened)
        while len(tasks) < 2 * workers:
            found = next(((s, n) for s in opened if (n := s.missing()) is not None), None)
            if found is None:
                following = next(waiting, None)
                if following is None:
                    break
                opened.append(following)
                continue
            search, seed = found
            search.running.add(seed)
            tasks[submit(search.key, seed)] = search
        yield from _take_done(opened)
        if not tasks:
            return
        for future in wait(tasks, return_when=FIRST_COMPLETED).done:
            search, item = tasks.pop(future), future.result()
            search.running.discard(item.seed)
            search.attempts[item.seed] = item
            note(search, item)


def _take_done(opened: list[Search]) -> Iterator[Search]:
    for search in [s for s in opened if s.done]:
        opened.remove(search)
        yield search


def searches(
    keys: Sequence[ListKey], start: int, count: int, evidence: Evidence, *, measure: bool = False
) -> list[Search]:
    """A search for each of `keys`, with what `evidence` knows."""
    return [Search(key, start, count, measure, evidence.attempts(key, inputs(key))) for key in keys]


def sweep_with_bar(wanted: Sequence[Search], workers: int, evidence: Evidence) -> Iterator[Search]:
    """Every search of `wanted` once it is done; each attempt is kept as it finishes."""
    total, known = sum(search.count for search in wanted), sum(map(_got, wanted))
    begun, tried = time.monotonic(), 0
    with Bar("seeds", total, known) as bar, expert_pool(workers) as pool:

        def note(search: Search, item: Attempt) -> None:
            nonlocal tried
            evidence.add(search.key, inputs(search.key), item)
            tried += 1
            rate = tried / (time.monotonic() - begun)
            bar.done += item.accepted or search.measures
            left = duration_text((total - bar.done) / rate)
            bar.show(f"{search.key}: {rate:.2f} trials/s, {left} left")

        for search in sweep(lambda *job: pool.submit(job), workers, wanted, note):
            bar.done += search.count - _got(search)  # of one that was given up
            yield search


def _got(search: Search) -> int:
    """How much of what it looks for it has."""
    return len(search.row() if search.measures else search.accepted)
