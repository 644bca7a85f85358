"""`robospa collect --questions`: pictures, sentences and what they ask for, in Parquet, to train
and evaluate vision-language models with.

    README.md                             the card, as dataset hubs read it
    data/train-<task>.parquet             training seeds, sentences and textures
    data/test-<task>.parquet              those of the evaluation: the first of its seeds

A file is a task of a split, a row group a variant, a row a question: the head camera's picture of a
scene at rest. Files say what they were made by: the same command keeps those that are there.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import count, islice
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from robospa.extras import need
from robospa.harness.datasets.settings import (
    Collection,
    command_of,
    lists_of,
    trial_of,
    versions,
)
from robospa.harness.pointing import asked_for, box_of, point_on
from robospa.harness.pool import JobProcess, Pool
from robospa.harness.running.atomic_file import replace_file
from robospa.harness.selection import parse_modes
from robospa.harness.settings import SettingsError
from robospa.harness.trial import TrialSetup, task_parts
from robospa.harness.world import SceneUnstable
from robospa.observation import CameraSpec
from robospa.tasks.catalog import task as find_task
from robospa.tasks.modes import for_training
from robospa.tasks.sampling.places import LayoutError
from robospa.tasks.seeds import FIRST_SEED, FIRST_TRAINING_SEED, ListKey
from robospa.text import markdown_table, size_text
from robospa.trial import REFERENCE, TrialKey

if TYPE_CHECKING:
    import pyarrow as pa

    from robospa.harness.sim.sapien_world import SapienWorld

TEST_SHARE = 10
"""Questions of a variant for training to each one for testing."""
CARD = "README.md"
Row = dict[str, object]
Mask = NDArray[np.bool_]


class QuestionFile(NamedTuple):
    """A file to be made: the first `wanted` questions of each variant of a task."""

    path: Path
    split: str
    keys: tuple[ListKey, ...]
    wanted: int
    made_by: str
    """Command and versions."""

    @property
    def done(self) -> bool:
        """Whether it is there."""
        if not self.path.exists():
            return False
        about = need("pyarrow.parquet").read_schema(self.path).metadata or {}
        return bool(about.get(b"robospa") == self.made_by.encode())


def schema(made_by: str) -> pa.Schema:
    """Columns of a file; `datasets` and pandas read them as they are."""
    pa = need("pyarrow", "demos")
    image = pa.struct([("bytes", pa.binary()), ("path", pa.string())])
    box = pa.list_(pa.int32())
    columns = {
        **dict.fromkeys(("id", "task", "category"), pa.string()),
        "level": pa.int32(), "seed": pa.int64(),
        **dict.fromkeys(("embodiment", "mode", "wording", "sentence"), pa.string()),
        "image": image, "point": pa.list_(pa.float64()), "box": box, "mask": image,
        "boxes": pa.list_(box), "answer": pa.int32(),
    }  # fmt: skip
    images = {name: {"_type": "Image"} for name in ("image", "mask")}
    about = {"huggingface": json.dumps({"info": {"features": images}}), "robospa": made_by}
    return pa.schema(list(columns.items()), metadata=about)


COLUMNS = {
    "id": "task, level, seed, scene mode and, unless it is the default, robot, which `task`, "
    "`level`, `seed`, `mode` and `embodiment` have too",
    "category": "of the task, such as GAC",
    "wording": "of the sentence: train or heldout, in words that are for evaluation",
    "sentence": "what is asked for",
    "image": "PNG of the head camera, 320 x 240",
    "point": "u, v in 0..1 of the picture, on the object that is asked for",
    "box": "its box: left, top, right, bottom [px]",
    "mask": "PNG, white where it is seen",
    "boxes": "boxes of all objects that the task's scene has to choose from or to refer to",
    "answer": "which of `boxes` is asked for",
}


def collect_questions(
    settings: Collection, out: Path, workers: int, say: Callable[[str], None]
) -> int:
    """Make the data set in `out` as far as it is not there; its number of questions.

    SettingsError if no task of `settings` asks a question, or if `out` holds anything else.
    """
    files = list(_files(settings, out))
    there = {*out.glob("[!.]*"), *out.glob("data/[!.]*")} - {out / "data", out / CARD}
    if others := sorted(there - {file.path for file in files if file.done}):
        raise SettingsError(
            f"{out} has {others[0].relative_to(out)}, which is not of these questions, or is of "
            "other settings or versions; choose another --out"
        )
    pending = [file for file in files if not file.done]
    start = partial(JobProcess, file_maker, None, name="questions")
    with Pool[QuestionFile, int](start, min(workers, len(pending))) as pool:
        for job, file in [(pool.submit(file), file) for file in pending]:
            say(f"{file.path.name}: {size_text(job.result())}")
    counts = [need("pyarrow.parquet").read_metadata(file.path).num_rows for file in files]
    replace_file(out / CARD, _card(settings, files, counts).encode())
    return sum(counts)


def _files(settings: Collection, out: Path) -> Iterator[QuestionFile]:
    if settings.tasks == "all":
        settings = replace(settings, tasks="spatial,basic")
    train = lists_of(settings)
    modes = {for_training(mode): mode for mode in parse_modes(settings.mode)}
    made_by = json.dumps([_command(settings), versions()])
    tasks = list(dict.fromkeys(key.task for key in train))
    if wrong := next((n for n in tasks if find_task(n).dimension == "procedural"), ""):
        raise SettingsError(f"{wrong} asks for more than a point: choose tasks spatial,basic")
    test = [key._replace(mode=modes[key.mode]) for key in train]
    few = max(1, settings.episodes // TEST_SHARE)
    for split, keys, wanted in (("train", train, settings.episodes), ("test", test, few)):
        for task in tasks:
            of_task = tuple(key for key in keys if key.task == task)
            yield QuestionFile(
                out / f"data/{split}-{task}.parquet", split, of_task, wanted, made_by
            )


def _command(settings: Collection) -> str:
    return command_of(settings, "").replace("--format ''", "--questions")


def file_maker(_: None) -> Callable[[QuestionFile], int]:
    """`make_file` in a process of its own, which keeps its world."""
    from robospa.harness.sim.sapien_world import SapienWorld

    return partial(make_file, SapienWorld(render=True))


def make_file(world: SapienWorld, file: QuestionFile) -> int:
    """Make it; its bytes."""
    pa, pq = need("pyarrow", "demos"), need("pyarrow.parquet", "demos")
    stream, columns = io.BytesIO(), schema(file.made_by)
    with pq.ParquetWriter(stream, columns, compression="zstd") as writer:
        for key in file.keys:
            rows = list(islice(_questions(world, key, file.split), file.wanted))
            writer.write_table(pa.Table.from_pylist(rows, columns))
    replace_file(file.path, stream.getvalue())
    return stream.tell()


def _questions(world: SapienWorld, key: ListKey, split: str) -> Iterator[Row]:
    """The questions of a variant, of one seed after the other that comes to rest."""
    camera = CameraSpec("head")
    for seed in count(FIRST_TRAINING_SEED if split == "train" else FIRST_SEED):
        trial = trial_of(key, seed)
        trial = trial if split == "train" else replace(trial, split="heldout")
        try:
            setup = task_parts(trial)
            world.load(setup.scene)
        except (SceneUnstable, LayoutError):
            continue
        shown = world.identify(camera)
        numbers = {item.name: n for n, item in enumerate(setup.scene.everything)}
        masks = {name: shown == numbers[name] for name in setup.tracker.roles}
        if all(mask.any() for mask in masks.values()):
            yield _row(trial, setup, masks, world.render(camera))


def _row(
    trial: TrialKey, setup: TrialSetup, masks: Mapping[str, Mask], image: NDArray[np.uint8]
) -> Row:
    target = asked_for(setup.tracker)
    order = sorted(masks)
    robot = "" if trial.embodiment == REFERENCE else f"-{trial.embodiment}"
    return {
        "id": f"{trial.task}-L{trial.level}-{trial.seed}-{trial.mode}{robot}",
        "task": trial.task,
        "category": setup.task.category,
        "level": trial.level,
        "seed": trial.seed,
        "embodiment": trial.embodiment,
        "mode": trial.mode,
        "wording": trial.split,
        "sentence": setup.instruction,
        "image": _png(image),
        "point": point_on(masks[target]),
        "box": box_of(masks[target]),
        "mask": _png(masks[target]),
        "boxes": [box_of(masks[name]) for name in order],
        "answer": order.index(target),
    }


def _png(picture: NDArray[np.uint8] | Mask) -> dict[str, object]:
    image = need("PIL.Image", "demos")
    stream = io.BytesIO()
    image.fromarray(picture).save(stream, "PNG")
    return {"bytes": stream.getvalue(), "path": None}


def _card(settings: Collection, files: Sequence[QuestionFile], counts: Sequence[int]) -> str:
    numbers = {
        split: sum(n for file, n in zip(files, counts, strict=True) if file.split == split)
        for split in ("train", "test")
    }
    size = sum(file.path.stat().st_size for file in files)
    configs = "".join(
        f"\n  - split: {split}\n    path: data/{split}-*.parquet" for split in numbers
    )
    tasks = len({key.task for file in files for key in file.keys})
    command = _command(settings)
    columns = markdown_table(["column", "what"], [[f"`{n}`", text] for n, text in COLUMNS.items()])
    return f"""---
license: mit
task_categories:
- visual-question-answering
tags:
- robospa
configs:
- config_name: default
  data_files:{configs}
---

# Pointing questions of RoboSPA

{numbers["train"]:,} questions to train with and {numbers["test"]:,} to test with, of {tasks} tasks
that ask for one object ({size_text(size)}, suite `{versions()["suite"]}`). A question is a picture
of a table and a sentence; the answer is a point on the object that is asked for, its box, its
mask, or one of the boxes. The split `test` has seeds, wordings and textures of the benchmark's
evaluation, `train` has none of them: a model that was trained on `test` is evaluated neither by it
nor by `robospa eval`.

{columns}

Made, with the same bytes from the same version, by

```
{command}
```

    from datasets import load_dataset
    questions = load_dataset("DIR", split="train")

`pandas.read_parquet("DIR/data/test-Pick_Blocks_Size.parquet")` reads one file. A point is right if
the mask is white there (`robospa eval` grants 6 px beside it where no other object is nearer).
"""
