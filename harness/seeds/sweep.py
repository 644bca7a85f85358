"""The first accepted seeds of many variants: every process busy, no seed tried in vain.

Seeds are tried in ascending order. No more of them are on their way than a list still lacks, and
meanwhile the processes go on with the next variant, so that the seeds tried are exactly those up to
the last one of the list.
"""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, wait
from dataclasses import dataclass, field

from robospa.harness.progress import Bar
from robospa.harness.seeds.attempt import Attempt, Evidence, expert_pool
from robospa.harness.seeds.lists import inputs
from robospa.tasks.seeds import ListKey
from robospa.text import duration_text

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
