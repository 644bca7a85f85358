"""Collecting a data set: the first good training seeds of every variant, then packing.

First workers make episodes, each a file of its own as soon as it is verified. Then all of them are
packed in the order of the data set. So neither a kill nor the number of workers changes what comes
of it. What is made so far lies below `episodes/` in the folder of the data set:

    episodes/settings.json                       what is being collected, and with which versions
    episodes/ROBOT/MODE/TASK-Ln/SEED.zip         an episode (`episode`)
    episodes/ROBOT/MODE/TASK.jsonl               a line for every seed that gave none
    episodes/kept                                of a finished data set: they stay

Each is written at once or not at all, so a kill at any byte is harmless.
"""

import json
import shutil
import time
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields
from functools import partial
from itertools import starmap
from pathlib import Path

from robospa.extras import need
from robospa.harness.datasets.manifest import MANIFEST, DatasetManifest, SeedFailure, read_record
from robospa.harness.datasets.pack import FORMATS, image_codec, pack
from robospa.harness.datasets.settings import (
    KEYFRAMES,
    Collection,
    check_room,
    command_of,
    expected_bytes,
    frames_of,
    lists_of,
    trial_of,
    versions,
)
from robospa.harness.datasets.workers import EpisodeAttempt, EpisodeJob, OpenPool, pool_opener
from robospa.harness.progress import Bar
from robospa.harness.running.atomic_file import PARTIAL, replace_file, run_lock, storage_errors
from robospa.harness.seeds.attempt import Attempt, Evidence, Search, sweep
from robospa.harness.settings import Compute, SettingsError, changed
from robospa.registry import did_you_mean
from robospa.results.records.runs import LOCK
from robospa.tasks.seeds import FIRST_TRAINING_SEED, ListKey
from robospa.text import clock_text, counted, size_text
from robospa.trial import path_part

EPISODES, SETTINGS, KEPT = "episodes", "settings.json", "kept"

Facts = Mapping[str, Mapping[str, object]]
"""What makes two collections the same, as JSON values: `settings` and `versions`."""


class EpisodeStore:
    """The episodes in `folder`, one process at a time."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._refused = Evidence(folder)

    @property
    def begun(self) -> bool:
        """Whether a collection was begun here."""
        return (self.folder / SETTINGS).exists()

    def begin(self, facts: Facts) -> None:
        """Begin a collection, or go on with one; SettingsError if that is of other `facts`."""
        path = self.folder / SETTINGS
        if not self.begun:
            replace_file(path, (json.dumps(facts, indent=1) + "\n").encode())
            return
        try:
            before = json.loads(path.read_text())
            differ = [
                f"{name} was {before[part].get(name)!r} and is {value!r}"
                for part, values in json.loads(json.dumps(facts)).items()
                for name, value in values.items()
                if before[part].get(name) != value
            ]
        except (OSError, ValueError, LookupError, AttributeError, TypeError) as error:
            raise SettingsError(f"{path} cannot be read ({error}); collect elsewhere") from error
        if differ:
            raise SettingsError(
                f"{self.folder} cannot be gone on with: {'; '.join(differ)}; "
                "go on as it was begun, or choose another --out"
            )

    def path(self, key: ListKey, seed: int) -> Path:
        """The file of an episode."""
        return self._place(key) / f"{seed}.zip"

    def _place(self, key: ListKey) -> Path:
        robot, mode = path_part(key.embodiment), path_part(key.mode)
        return self.folder / robot / mode / f"{key.task}-L{key.level}"

    def attempts(self, key: ListKey) -> dict[int, Attempt]:
        """What is known, by seed; the file of an episode that is damaged is removed."""
        found = self._refused.attempts(key, "")
        for path in sorted(self._place(key).glob("[0-9]*.zip")):
            if zipfile.is_zipfile(path):
                found[int(path.stem)] = Attempt(int(path.stem), True)
            else:
                path.unlink()
        return found

    def add(self, key: ListKey, made: EpisodeAttempt) -> Attempt:
        """Keep what came of a seed, written when this returns; raises StorageError."""
        if made.accepted:
            replace_file(self.path(key, made.seed), made.data)
            return Attempt(made.seed, True)
        attempt = Attempt(made.seed, False, made.reason)
        with storage_errors(self._refused.path(key)):
            self._refused.add(key, "", attempt)
        return attempt

    def size(self) -> int:
        """Bytes of all episodes."""
        return sum(path.stat().st_size for path in self.folder.rglob("*.zip"))


class CollectionProgress(Bar):
    """Counts what comes in and shows it.

    Episodes of one task take twenty times as long as those of another, so the time left follows
    from frames: `work` is that of all episodes that are left, in frames.
    """

    def __init__(self, total: int, done: int, work: float) -> None:
        super().__init__("episodes", total, done)
        self.replaced = self.frames = self.bytes = self.made = 0
        self.times: Counter[str] = Counter()
        self._left, self._worked = work, 0.0
        self._began = time.monotonic()

    def add(self, made: EpisodeAttempt, work: float) -> None:
        """Count what came of a seed; an episode like it has `work` frames."""
        self.times.update(made.times)
        if made.accepted:
            self.done += 1
            self.made += 1
            self.frames += made.frames
            self.bytes += len(made.data)
            self._worked += work
        else:
            self.replaced += 1
        self.show(self.text())

    def give_up(self, episodes: int, work: float) -> None:
        """Expect so many episodes less, of `work` frames together."""
        self.total -= episodes
        self._left -= work

    def text(self) -> str:
        """Rate, time left, size, seeds that were replaced."""
        passed = max(time.monotonic() - self._began, 1e-9)
        parts = [f"{3600 * self.made / passed:.0f} an hour"]
        if self._worked and self.done < self.total:
            parts.append(f"{clock_text((self._left - self._worked) * passed / self._worked)} left")
        parts.append(size_text(self.bytes))
        if self.replaced:
            parts.append(f"{self.replaced} seeds replaced")
        return ", ".join(parts)

    def cost_text(self) -> str:
        """Where the processor time of an episode went; empty if none was made."""
        if not self.made:
            return ""
        total = sum(self.times.values())
        parts = [f"{name} {100 * spent / max(total, 1e-9):.0f} %" for name, spent in
                 self.times.most_common()]  # fmt: skip
        return (
            f"{total / self.made:.1f} s of processor time and {size_text(self.bytes / self.made)} "
            f"an episode of {self.frames / self.made:.0f} frames: {', '.join(parts)}"
        )


@dataclass(frozen=True)
class Order:
    """What is to be collected: `settings` in the format `layout`, into `out`.

    `versions` is what the result depends on besides.
    """

    settings: Collection
    layout: str
    out: Path
    versions: dict[str, str] = field(default_factory=lambda: versions())

    @property
    def images(self) -> str:
        """How pictures are kept; SettingsError if there is no such format, or it cannot hold
        them."""
        codec = image_codec(self.layout, self.settings.images)
        if self.layout == "robotwin-hdf5" and not self.settings.camera_specs():
            raise SettingsError(
                "robotwin-hdf5 is a format of pictures: name cameras, or collect without pictures "
                "in the format lerobot-v3"
            )
        return codec

    @property
    def facts(self) -> Facts:
        """What makes two collections the same."""
        settings = {**asdict(self.settings), "images": self.images, "format": self.layout}
        return {"settings": settings, "versions": self.versions}

    def job(self, key: ListKey, seed: int) -> EpisodeJob:
        """The episode of a seed."""
        shares = (self.settings.noise, self.settings.mistakes, self.settings.midstates)
        return EpisodeJob(
            trial_of(key, seed),
            self.settings.camera_specs(),
            self.images,
            shares,
            self.settings.frames == KEYFRAMES,
            self.settings.environment_state,
        )


@dataclass(frozen=True)
class CollectionResult:
    """A data set that is finished: its folders, one a robot, and what it lacks, a line each."""

    folders: tuple[Path, ...]
    episodes: int
    missing: tuple[str, ...]


def collect(
    out: str | Path,
    *,
    tasks: str | Sequence[str] = "all",
    levels: str | int | Sequence[int] = "1-5",
    episodes: int = 50,
    workers: int = 0,
    format: str = "lerobot-v3",
    resume: bool = False,
    **settings: object,
) -> CollectionResult | None:
    """Collect demonstrations of the expert into `out`, and return what was made.

        made = robospa.collect("data/mine", tasks="GAC", levels=1, episodes=10)

    Args:
        out: Folder of the data set.
        tasks: Names of tasks, categories or dimensions.
        levels: From 1 to 5.
        episodes: Per variant.
        workers: Worker processes; 0 for one a core.
        format: "lerobot-v3", "lerobot-v2.1" or "robotwin-hdf5".
        resume: Go on with the data set in `out`.
        settings: Any other setting of `robospa collect`, such as cameras="head" or noise=0.2.

    Returns:
        The folders, the number of episodes and what is missing; None if the data set was finished.

    Raises:
        SettingsError: A setting is unknown or impossible; nothing was written.
        RunError: Another process is at it, or `out` holds something else.
        MakerError: An episode cannot be made on this machine; StorageError if `out` cannot be
            written. What is done is kept, and `resume` goes on.
    """
    named = {"tasks": tasks, "levels": levels, "episodes": episodes, "workers": workers}
    given = {**named, **settings}
    kinds = {field.name: kind for kind in (Collection, Compute) for field in fields(kind)}
    if unknown := next((name for name in given if name not in kinds), None):
        near = did_you_mean(unknown, kinds)
        raise SettingsError(f"there is no setting {unknown!r}; {near}known are {', '.join(kinds)}")
    own, machine = (
        {name: value for name, value in given.items() if kinds[name] is kind}
        for kind in (Collection, Compute)
    )
    compute = changed(Compute(), machine)
    order = Order(changed(Collection(), own), format, Path(out))
    with pool_opener(compute) as open_pool:
        return make(order, open_pool, resume=resume)


def make(
    order: Order,
    open_pool: OpenPool,
    *,
    resume: bool = False,
    keep_episodes: bool = False,
    say: Callable[[str], None] = print,
) -> CollectionResult | None:
    """Make the data set; None if it was finished before.

    Raises SettingsError for what cannot be collected, MissingPackage before anything is made,
    RunError if another process is at it, StorageError if the folder cannot be written, and what
    `open_pool` and workers raise.
    """
    keys, _ = lists_of(order.settings), order.images
    for module in (FORMATS[order.layout].package, "PIL", "matplotlib"):  # those of card and format
        need(module, "demos")
    with run_lock(order.out) as lock:
        store = EpisodeStore(order.out / EPISODES)
        robots = dict.fromkeys(key.embodiment for key in keys)  # a data set has one: one width
        one = len(robots) == 1
        folders = {r: order.out if one else order.out / path_part(r) for r in robots}
        if all((folder / MANIFEST).exists() for folder in folders.values()):
            _check_finished(order, list(folders.values()), resume)
            _clear(order.out, store, keep_episodes)
            return None
        _check_folder(order.out, store, resume)
        store.begin(order.facts)
        wanted = [
            Search(key, FIRST_TRAINING_SEED, order.settings.episodes, False, store.attempts(key))
            for key in keys
        ]
        whole = expected_bytes(order.settings, keys, order.images)
        text = check_room(order.out, max(0.0, whole - store.size() / 2))
        count = order.settings.episodes * len(keys)
        say(f"{count} episodes of {counted(len(keys), 'variant')}: {text}")
        _make_episodes(order, wanted, store, open_pool, lambda: lock.check(order.out), say)
        result = _pack(order, wanted, store, folders, say)
        _clear(order.out, store, keep_episodes)
    return result


def _check_finished(order: Order, folders: Sequence[Path], resume: bool) -> None:
    if not resume:
        raise SettingsError(f"{order.out} has a data set already; choose another --out")
    made = [read_record(folder).settings for folder in folders]
    wanted = json.loads(json.dumps(order.facts["settings"]))
    if any(settings != wanted for settings in made):
        raise SettingsError(
            f"the data set in {order.out} is of other settings than these; choose another --out"
        )


def _check_folder(out: Path, store: EpisodeStore, resume: bool) -> None:
    if store.begun:
        if not resume:
            raise SettingsError(
                f"{out} has a data set that is not finished: add --resume to go on with it, or "
                "choose another --out"
            )
        return
    others = [path.name for path in out.iterdir() if path.name not in (LOCK, EPISODES)]
    if others:
        raise SettingsError(
            f"{out} has other files, such as {sorted(others)[0]}; choose an empty folder for --out"
        )


def _clear(out: Path, store: EpisodeStore, keep_episodes: bool) -> None:
    """Leave nothing in `out` but the data set, and its episodes if they are or were wanted."""
    with storage_errors(store.folder):
        if keep_episodes and store.folder.exists():
            (store.folder / KEPT).touch()
        elif store.folder.exists() and not (store.folder / KEPT).exists():
            shutil.rmtree(store.folder)
    for path in (out / LOCK, *out.rglob(PARTIAL)):  # of one that was killed
        path.unlink(missing_ok=True)


def _make_episodes(
    order: Order,
    wanted: Sequence[Search],
    store: EpisodeStore,
    open_pool: OpenPool,
    check: Callable[[], None],
    say: Callable[[str], None],
) -> None:
    count = order.settings.episodes
    done = {search.key: len(search.accepted) for search in wanted}
    left = sum(count - done[s.key] for s in wanted if not s.done)
    if not left:
        return
    frames = partial(frames_of, order.settings)
    progress = CollectionProgress(
        count * len(wanted),
        sum(done.values()),
        sum((count - done[s.key]) * frames(s.key) for s in wanted),
    )

    def note(search: Search, item: Attempt) -> None:
        assert isinstance(item, EpisodeAttempt)
        check()
        search.attempts[item.seed] = store.add(search.key, item)
        progress.add(item, frames(search.key))

    with open_pool(left) as pool, progress:
        for search in sweep(lambda *of: pool.submit(order.job(*of)), pool.workers, wanted, note):
            if search.given_up:
                lacking = count - len(search.accepted)
                progress.give_up(lacking, lacking * frames(search.key))
    if text := progress.cost_text():
        say(text)


def _pack(
    order: Order,
    wanted: Sequence[Search],
    store: EpisodeStore,
    folders: dict[str, Path],
    say: Callable[[str], None],
) -> CollectionResult:
    episodes = 0
    for robot, folder in folders.items():
        some = [search for search in wanted if search.key.embodiment == robot]
        files = [store.path(s.key, seed) for s in some for seed in s.accepted]
        episodes += len(files)
        if (folder / MANIFEST).exists() or not files:
            continue
        say(f"packing {len(files)} episodes of {robot} into {folder}")
        refused = ((trial_of(s.key, a.seed), a.reason) for s in some for a in s.refused)
        command, failures = command_of(order.settings, order.layout), starmap(SeedFailure, refused)
        manifest = DatasetManifest(command, dict(order.facts["settings"]), tuple(failures))
        pack(order.layout, folder, files, manifest)
    return CollectionResult(tuple(folders.values()), episodes, tuple(_missing(wanted)))


def _missing(wanted: Sequence[Search]) -> Iterator[str]:
    for search in wanted:
        found = len(search.accepted)
        if found < search.count:
            reasons = list(dict.fromkeys(item.reason for item in search.refused))
            yield (
                f"{search.key}: {found} of {search.count} episodes; {len(search.refused)} seeds "
                f"gave none, such as: {reasons[0]}"
            )
