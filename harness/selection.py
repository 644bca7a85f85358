"""The trials of an evaluation: what `tasks`, `levels` and `seeds` of its settings name."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from robospa.harness.settings import Selection, SettingsError
from robospa.schema import MAX_INTEGER, parse_json
from robospa.trial import BASIC, CATEGORIES, DIMENSIONS, REFERENCE, TrialKey

GROUPS = {"all": CATEGORIES, **DIMENSIONS, "basic": BASIC}


def parse_tasks(text: str) -> list[str]:
    """Official names of a comma-separated list of tasks, categories, dimensions, `all`, `basic`.

    `all` is the benchmark: every base task, without the basic grounding tasks.
    """
    from robospa.tasks.catalog import task, tasks

    known = tasks()
    chosen: list[str] = []
    for word in (w.strip() for w in text.split(",") if w.strip()):
        members = GROUPS.get(word.lower(), (word.upper(),))
        if set(members) <= set(CATEGORIES + BASIC):
            chosen += [t.name for t in known.values() if t.category in members]
        else:
            try:
                chosen.append(task(word).name)
            except KeyError as error:
                raise SettingsError(str(error.args[0])) from error
    if not chosen:
        raise SettingsError(f"tasks {text!r} names no task; see `robospa tasks`")
    return list(dict.fromkeys(chosen))


def parse_numbers(text: str, what: str) -> list[int]:
    """The numbers of a list like `1,3-5`, in order, each once; raises SettingsError."""
    numbers: list[int] = []
    for word in (w.strip() for w in text.split(",")):
        found = re.fullmatch(r"(\d+)(?:-(\d+))?", word)
        first, last = (int(found[1]), int(found[2] or found[1])) if found else (1, 0)
        if last > MAX_INTEGER:
            raise SettingsError(f"{word} in {what} is more than {MAX_INTEGER}")
        if last < first or last - first > 1_000_000:
            raise SettingsError(f"{word!r} in {what} is neither a number nor a range such as 3-5")
        numbers += range(first, last + 1)
    return list(dict.fromkeys(numbers))


def parse_levels(text: str) -> list[int]:
    """Levels of a list like `1,3-5` or `L1,L3-L5`; raises SettingsError beyond 1 to 5."""
    levels = parse_numbers(re.sub(r"\bL(?=\d)", "", text), "levels")
    wrong = [n for n in levels if n not in range(1, 6)]
    if wrong:
        raise SettingsError(f"there is no level {wrong[0]}; levels are 1 to 5")
    return levels


Seeds = Callable[[str, int], Sequence[int]]


def parse_seeds(text: str | None, embodiment: str = REFERENCE, mode: str = "clean") -> Seeds:
    """A function (task, level) -> seeds.

    Without `text` the accepted seeds of the robot in the scene mode; else a list like
    `100000-100099` for every variant, a JSON file (a list, or {task: {level: list}}), or a folder
    of `robospa seeds --out`.
    """
    if text is None:
        return partial(_accepted, embodiment=embodiment, mode=mode)
    if re.fullmatch(r"[\d,\s-]+", text):
        numbers = parse_numbers(text, "seeds")
        return lambda task, level: numbers
    if Path(text).is_dir():
        return partial(_listed, Path(text), embodiment=embodiment, mode=mode)
    try:
        data = parse_json(Path(text).read_text())
    except FileNotFoundError as error:
        raise SettingsError(
            f"seeds {text!r} is neither a file nor a list such as 100000-100099"
        ) from error
    except (OSError, ValueError) as error:
        raise SettingsError(f"cannot read the seeds in {text}: {error}") from error

    def look_up(task: str, level: int) -> Sequence[int]:
        levels = data.get(task) if isinstance(data, dict) else {str(level): data}
        found = levels.get(str(level)) if isinstance(levels, dict) else None
        if not isinstance(found, list) or not all(
            type(n) is int and 0 <= n <= MAX_INTEGER for n in found
        ):
            raise SettingsError(f"{text} has no list of seeds for {task} level {level}")
        return found

    return look_up


def _listed(folder: Path, task: str, level: int, embodiment: str, mode: str) -> Sequence[int]:
    from robospa.harness.seeds.lists import read_levels
    from robospa.tasks.modes import tangible
    from robospa.tasks.seeds import ListKey

    path = folder / ListKey(task, level, embodiment, tangible(mode)).file
    if not (found := read_levels(path).get(level)):
        raise SettingsError(
            f"{path} has no list of seeds for level {level}; a folder of seeds is what "
            "`robospa seeds TASKS --out FOLDER` writes"
        )
    return found


def _accepted(task: str, level: int, embodiment: str, mode: str) -> Sequence[int]:
    from robospa.harness.seeds.lists import find_list
    from robospa.tasks.seeds import ListKey, NoSeedList

    try:
        return find_list(ListKey(task, level, embodiment, mode)).seeds
    except NoSeedList as error:
        raise SettingsError(f"{error}, or name some with seeds") from error


def list_trials(selection: Selection) -> list[TrialKey]:
    """The trials that `selection` names: every variant with the first of its seeds, with each
    robot in each scene mode with sentences of each split.

    Raises SettingsError if a name is unknown or a variant has fewer seeds than asked for.
    """
    tasks, levels = parse_tasks(selection.tasks), parse_levels(selection.levels)
    if selection.seeds is None:
        _check_lists(selection, tasks, levels)
    if selection.profile is not None:
        clean = list_trials(replace(selection, profile=None, budget=None))
        return profile_trials(clean, selection.profile, selection.budget)
    if selection.budget is not None:
        raise SettingsError("a budget is divided over the axes of a profile: name some")
    return [
        TrialKey(task, level, seed, robot, mode, split)
        for robot in parse_embodiments(selection.embodiment)
        for mode in parse_modes(selection.mode)
        for seeds in [parse_seeds(selection.seeds, robot, mode)]
        for split in splits_of(selection)
        for task in tasks
        for level in levels
        for seed in first_seeds(seeds, task, level, selection.trials, selection.seeds is not None)
    ]


def profile_trials(
    clean: Sequence[TrialKey], text: str, budget: int | None = None
) -> list[TrialKey]:
    """The trials `clean`, and once more with each of the axes in `text`: the same seeds in all of
    them; with a `budget` as many as that leaves for each axis, evenly over variants. Procedures
    have no single target, so none is asked for another or moved.

    SettingsError if `text` names no axis, or if the budget leaves no trial for each.
    """
    from robospa.tasks.catalog import task
    from robospa.tasks.modes.randomized import OF_TARGETS, axes

    try:
        chosen = axes(text)
    except ValueError as error:
        raise SettingsError(str(error)) from error
    if budget is not None:
        most = min(len(clean), budget // (arms := len(chosen) + 1))
        if not most:
            raise SettingsError(
                f"a budget of {budget} trials is none for each axis: at least {arms} are needed"
            )
        clean = [clean[n * len(clean) // most] for n in range(most)]
    return [*clean] + [
        replace(key, mode=canonical_mode(f"randomized:{name}={strength:g}"))
        for name, strength in chosen
        for key in clean
        if name not in OF_TARGETS or task(key.task).dimension != "procedural"
    ]


def splits_of(selection: Selection) -> list[str]:
    """The instruction splits that `selection` names, in the place of ours the official ones if it
    takes its sentences from a checkout: so that no table mixes them."""
    chosen = list(dict.fromkeys(selection.split.split(",")))
    if selection.instructions is None:
        return chosen
    from robospa.harness.official.sentences import SPLITS as OFFICIAL

    return [OFFICIAL[split] for split in chosen]


def _check_lists(selection: Selection, tasks: Sequence[str], levels: Sequence[int]) -> None:
    """SettingsError, with one command for all of them, if there are variants without a list."""
    from robospa.harness.seeds.lists import find_list
    from robospa.tasks.modes import tangible
    from robospa.tasks.seeds import ListKey, NoSeedList

    for robot in parse_embodiments(selection.embodiment):
        for mode in parse_modes(selection.mode):
            missing: dict[str, None] = {}
            steps: set[int] = set()
            for key in (ListKey(task, level, robot, mode) for task in tasks for level in levels):
                try:
                    find_list(key)
                except NoSeedList:
                    missing[key.task] = None
                    steps.add(key.level)
            if missing:
                names, numbers = ",".join(missing), ",".join(map(str, sorted(steps)))
                flags = f" --embodiment {robot}" * (robot != REFERENCE)
                flags += f" --mode {tangible(mode)}" * (mode != "clean")
                raise SettingsError(
                    f"there are no lists of accepted seeds of {len(missing)} tasks with {robot} in "
                    f"{mode} scenes, such as {names.partition(',')[0]}: make them with `robospa "
                    f"seeds {names} --levels {numbers}{flags}`, or name seeds with seeds"
                )


def seed_sources(selection: Selection, keys: Sequence[TrialKey]) -> list[dict[str, str]]:
    """Where the seeds of `keys`, which `selection` names, come from: a row for each robot, scene
    mode and origin (`shipped`, `local` or `given`), with a hash over the lists."""
    from robospa.harness.seeds.lists import find_list
    from robospa.tasks.seeds import ListKey, list_hash

    found: dict[tuple[str, str, str], dict[ListKey, Sequence[int]]] = {}
    seeds: dict[ListKey, list[int]] = {}
    for key in keys:
        mode = key.mode if selection.profile is None else "clean"
        place = ListKey(key.task, key.level, key.embodiment, mode)
        if key.seed not in (used := seeds.setdefault(place, [])):  # of another split
            used.append(key.seed)
    for place, used in seeds.items():
        listed = find_list(place) if selection.seeds is None else None
        origin = listed.origin if listed else "given"
        lists = found.setdefault((place.embodiment, place.mode, origin), {})
        lists[place] = listed.seeds if listed else used
    return [
        {"embodiment": robot, "mode": mode, "origin": origin, "hash": list_hash(lists)}
        for (robot, mode, origin), lists in found.items()
    ]


def parse_embodiments(text: str) -> list[str]:
    """Names of the robots in a comma-separated list, `all` for every installed one.

    Raises SettingsError, with near matches, for one that is not installed.
    """
    from robospa.harness.robots import embodiment, embodiments

    words = [word.strip() for word in text.split(",") if word.strip()]
    if not words:
        raise SettingsError(
            f"embodiment {text!r} names no robot; known are {', '.join(embodiments())}"
        )
    try:
        found = [
            name
            for word in words
            for name in (embodiments() if word == "all" else [embodiment(word).name])
        ]
    except ValueError as error:
        raise SettingsError(str(error)) from error
    return list(dict.fromkeys(found))


def parse_modes(text: str) -> list[str]:
    """Scene modes of a comma-separated list, in their canonical names.

    A word that is no mode is a part of the one before: `clean,randomized:light,clutter` are two.
    Raises SettingsError for one that is not installed or misspelt.
    """
    from robospa.tasks.modes import modes

    found: list[str] = []
    for word in (w.strip() for w in text.split(",")):
        if found and ":" in found[-1] and word.partition(":")[0] not in modes():
            found[-1] += f",{word}"
        else:
            found.append(word)
    return list(dict.fromkeys(map(canonical_mode, found)))


def canonical_mode(name: str) -> str:
    """The scene mode's one spelling; raises SettingsError if it is not installed or misspelt."""
    from robospa.tasks.modes import canonical

    try:
        return canonical(name)
    except ValueError as error:
        raise SettingsError(str(error)) from error


def first_seeds(seeds: Seeds, task: str, level: int, count: int, named: bool) -> Sequence[int]:
    """The first `count` different seeds of a variant; raises SettingsError if it has fewer, unless
    they were `named` and `count` was not."""
    found = list(dict.fromkeys(seeds(task, level)))
    if len(found) < count and not (named and found and count == Selection().trials):
        raise SettingsError(
            f"{task} level {level} has {len(found)} seeds, not {count}; "
            "choose fewer trials or name more seeds"
        )
    return found[:count]
