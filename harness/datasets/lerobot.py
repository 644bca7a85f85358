"""LeRobot data sets of version 3.0, the newest, and of 2.1, which openpi and others read.

Version 3.0: many episodes share a file.

    meta/info.json, stats.json, tasks.parquet, subtasks.parquet
    meta/episodes/chunk-000/file-000.parquet      a row an episode, with its statistics
    data/chunk-000/file-000.parquet               a row a frame, a row group an episode
    videos/<feature>/chunk-000/file-000.mp4       films, joined without encoding them again

Version 2.1: a file an episode.

    meta/info.json, tasks.jsonl, episodes.jsonl, episodes_stats.jsonl, subtasks.jsonl
    data/chunk-000/episode_000000.parquet
    videos/chunk-000/<feature>/episode_000000.mp4

`meta/info.json` comes last: without it LeRobot loads nothing. A chunk is a folder of 1000 files.
"""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from robospa.harness.datasets import features
from robospa.harness.datasets.episode import DatasetEpisode
from robospa.harness.datasets.features import EpisodeLayout, picture_key
from robospa.harness.datasets.manifest import EpisodeLine, json_line
from robospa.harness.datasets.pictures import FPS, JoinedFilm, check_film, colours, frame_count
from robospa.harness.datasets.statistics import (
    QUANTILES,
    ColourHistogram,
    Moments,
    RangeHistogram,
    Stats,
    row_stats,
)

if TYPE_CHECKING:
    import pyarrow as pa

CHUNK = 1000
"""Files in a folder."""
DATA_LIMIT, FILM_LIMIT = 100, 200
"""Largest files of version 3.0 [MB], as LeRobot's own."""
BUFFERED = 100
"""Episodes of version 3.0 whose rows are written at a time."""
V3, V21 = "v3.0", "v2.1"
COMMANDED = "observation.state"
NOTHING = ""
"""The subtask of frames in which nothing in particular is being done; its index is 0."""
JsonObject = dict[str, object]


class LeRobotWriter:
    """What both versions have in common: counts, an episode's numbers and statistics, the info."""

    version: str
    depth_key: str
    """How the version says that pictures are no depth."""
    paths: tuple[str, str]
    """Of data and of films."""

    def __init__(self, folder: Path, layout: EpisodeLayout) -> None:
        self._folder, self._layout = folder, layout
        self._count = self._frames = 0
        self._tasks: dict[str, int] = {}
        self._subtasks = {NOTHING: 0}
        (folder / "meta").mkdir(parents=True, exist_ok=True)

    def _numbers(self, episode: DatasetEpisode) -> tuple[dict[str, NDArray[Any]], dict[str, Stats]]:
        """The numbers of the next `episode`, by feature, (T, D), or (T,) for a feature of one
        number, and their statistics; its texts are numbered in the order in which they come."""
        self._layout.check(episode)
        task = self._tasks.setdefault(episode.instructions[0], len(self._tasks))
        for text in episode.subtasks:
            self._subtasks.setdefault(text, len(self._subtasks))
        texts = np.array([0, *(self._subtasks[text] for text in episode.subtasks)])
        count, objects = len(episode), episode.environment_state
        frames = np.arange(count)
        found: dict[str, NDArray[Any]] = {
            "observation.state": episode.commanded,
            **({features.ENVIRONMENT: objects} if objects.size else {}),
            "action": episode.action,
            "measured_state": episode.measured,
            "ee_pose": episode.ee.reshape(count, len(features.POSES)),
            "sim_time": episode.sim_time.astype(np.float32),
            "subtask_index": texts[episode.subtask + 1].astype(np.int64),
            "label": episode.label.astype(np.int64),
            "timestamp": (frames / FPS).astype(np.float32),
            "frame_index": frames,
            "episode_index": np.full(count, self._count),
            "index": self._frames + frames,
            "task_index": np.full(count, task),
        }
        numbers = {name: of for name, of in found.items() if name not in episode.absent}
        return numbers, {n: row_stats(of.reshape(len(of), -1)) for n, of in numbers.items()}

    def _row(self, episode: DatasetEpisode) -> JsonObject:
        """What both versions say of `episode`, which is counted now."""
        index, length = self._count, len(episode)
        self._count, self._frames = index + 1, self._frames + length
        return {"episode_index": index, "tasks": [episode.instructions[0]], "length": length}

    def _write_info(self, **counts: object) -> None:
        info = {
            "codebase_version": self.version,
            "robot_type": self._layout.robot,
            "total_episodes": self._count,
            "total_frames": self._frames,
            "total_tasks": len(self._tasks),
            **counts,
            "fps": FPS,
            "splits": {"train": f"0:{self._count}"},
            "data_path": self.paths[0],
            "video_path": self.paths[1] if self._layout.films else None,
            "features": features.described(self._layout, self.depth_key),
        }
        self._write_json("info", info)

    def _write_json(self, name: str, value: object) -> None:
        text = json.dumps(value, indent=4, ensure_ascii=False)
        (self._folder / "meta" / f"{name}.json").write_text(text, encoding="utf-8")

    def _texts(self) -> dict[str, Mapping[str, int]]:
        found: dict[str, Mapping[str, int]] = {"task": self._tasks}
        if "subtask_index" not in self._layout.absent:
            found["subtask"] = self._subtasks
        return found


class LeRobotV21(LeRobotWriter):
    """Writes the data set of version 2.1 in `folder`, episode by episode."""

    version, depth_key = V21, "video.is_depth_map"
    paths = (
        "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
        "videos/chunk-{episode_chunk:03d}/{video_key}/episode_{episode_index:06d}.mp4",
    )

    def __init__(self, folder: Path, layout: EpisodeLayout) -> None:
        super().__init__(folder, layout)
        self._episodes, self._stats = self._lines("episodes"), self._lines("episodes_stats")

    def _lines(self, name: str) -> IO[str]:
        return (self._folder / "meta" / f"{name}.jsonl").open("w", encoding="utf-8")

    def add(self, episode: DatasetEpisode) -> str:
        """Write `episode` as the next; its data file. Raises EpisodeMisfit, EpisodeFilmError."""
        import pyarrow.parquet as pq

        numbers, stats = self._numbers(episode)
        stats.update({picture_key(c): colours(of).stats() for c, of in episode.pictures.items()})
        index = self._count
        where = {"episode_chunk": index // CHUNK, "episode_index": index}
        name = self.paths[0].format(**where)
        path = self._folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(features.frame_table(self._layout, numbers, episode.pictures), path)
        for camera in self._layout.films:
            (film,) = episode.pictures[camera].files
            check_film(film, len(episode))
            video = self._folder / self.paths[1].format(video_key=picture_key(camera), **where)
            video.parent.mkdir(parents=True, exist_ok=True)
            video.write_bytes(film)
        self._episodes.write(json_line(self._row(episode)))
        plain = {  # this version has no quantiles
            feature: {n: value.tolist() for n, value in of.items() if n not in QUANTILES}
            for feature, of in stats.items()
        }
        self._stats.write(json_line({"episode_index": index, "stats": plain}))
        return name

    def close(self) -> None:
        """Finish the files, then write what is said of all of them."""
        self._episodes.close()
        self._stats.close()
        for name, texts in self._texts().items():
            with self._lines(f"{name}s") as file:
                for text, number in texts.items():
                    file.write(json_line({f"{name}_index": number, name: text}))
        videos, chunks = self._count * len(self._layout.films), -(-self._count // CHUNK)
        self._write_info(total_videos=videos, total_chunks=chunks, chunks_size=CHUNK)


class LeRobotV3(LeRobotWriter):
    """Writes the data set of version 3.0 in `folder`, episode by episode; memory does not grow with
    their frames."""

    version, depth_key = V3, "is_depth_map"
    paths = (
        "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
        "videos/{video_key}/chunk-{chunk_index:03d}/file-{file_index:03d}.mp4",
    )

    def __init__(self, folder: Path, layout: EpisodeLayout) -> None:
        super().__init__(folder, layout)
        self._data = TableFiles(folder / "data")
        self._films = {
            camera: FilmFiles(folder / "videos" / picture_key(camera)) for camera in layout.films
        }
        self._episodes = TableFiles(folder / "meta" / "episodes")
        self._waiting: list[JsonObject] = []
        self._moments: dict[str, Moments] = {}
        self._colours = {camera: ColourHistogram() for camera in layout.cameras}

    def add(self, episode: DatasetEpisode) -> str:
        """Write `episode` as the next, in files of others; "". Raises EpisodeMisfit,
        EpisodeFilmError."""
        numbers, stats = self._numbers(episode)
        for name, of in stats.items():
            self._moments.setdefault(name, Moments()).add(of)
        for camera, seen in episode.pictures.items():
            found = colours(seen)
            self._colours[camera].merge(found)
            stats[picture_key(camera)] = found.stats()
        first, row = self._frames, self._row(episode)
        row |= {"dataset_from_index": first, "dataset_to_index": self._frames}
        row |= features.facts_of(episode)
        row |= self._add_films(episode)
        chunk, file = self._data.add(features.frame_table(self._layout, numbers, episode.pictures))
        row |= {"data/chunk_index": chunk, "data/file_index": file}
        for feature, of in stats.items():
            row |= {f"stats/{feature}/{name}": value.tolist() for name, value in of.items()}
        self._waiting.append(row)
        if len(self._waiting) == BUFFERED:
            self._write_rows()
        return ""

    def _add_films(self, episode: DatasetEpisode) -> JsonObject:
        found: JsonObject = {}
        for camera, files in self._films.items():
            (film,) = episode.pictures[camera].files
            file, start = files.add(film, len(episode))
            place = f"videos/{picture_key(camera)}"
            found[f"{place}/chunk_index"], found[f"{place}/file_index"] = file
            found[f"{place}/from_timestamp"] = start
            found[f"{place}/to_timestamp"] = start + len(episode) / FPS
        return found

    def _write_rows(self) -> None:
        import pyarrow as pa

        table = pa.Table.from_pylist(self._waiting)
        for number, field in enumerate(table.schema):
            if pa.types.is_null(field.type):  # seeds that none of these recordings names
                column = table[field.name].cast(pa.int64())
                table = table.set_column(number, field.name, column)
        chunk, file = self._episodes.place(table)
        for name, value in (("chunk_index", chunk), ("file_index", file)):
            column = pa.array([value] * len(table), pa.int64())
            table = table.append_column(f"meta/episodes/{name}", column)
        self._episodes.add(table)
        self._waiting.clear()

    def close(self) -> None:
        """Finish the files, then write what is said of all of them."""
        if self._waiting:
            self._write_rows()
        for films in self._films.values():
            films.close()
        self._data.close()
        self._episodes.close()
        for name, texts in self._texts().items():
            _write_texts(self._folder / "meta" / f"{name}s.parquet", name, list(texts))
        self._write_json("stats", self._stats())
        self._write_info(
            chunks_size=CHUNK,
            data_files_size_in_mb=DATA_LIMIT,
            video_files_size_in_mb=FILM_LIMIT,
        )

    def _stats(self) -> dict[str, JsonObject]:
        found = {name: dict(of.stats()) for name, of in self._moments.items()}
        for name, quantiles in self._quantiles().items():
            found[name].update(quantiles)
        for camera, seen in self._colours.items():
            found[picture_key(camera)] = dict(seen.stats())
        return {name: {k: v.tolist() for k, v in of.items()} for name, of in found.items()}

    def _quantiles(self) -> dict[str, Stats]:
        """Of all features of numbers, from a second reading of the data files."""
        import pyarrow.parquet as pq

        found = {name: RangeHistogram(of.low, of.high) for name, of in self._moments.items()}
        for path in sorted((self._folder / "data").glob("*/*.parquet")):
            with pq.ParquetFile(path) as file:
                for group in range(file.num_row_groups):
                    table = file.read_row_group(group, columns=list(found))
                    for name, histogram in found.items():
                        column = table[name].combine_chunks()
                        flat = column.flatten() if hasattr(column, "flatten") else column
                        values = flat.to_numpy(zero_copy_only=False)
                        histogram.add(np.asarray(values).reshape(len(table), -1))
        return {name: histogram.quantiles() for name, histogram in found.items()}


class TableFiles:
    """Parquet files below `folder`, of at most `limit` MB; what is added becomes a row group."""

    def __init__(self, folder: Path, limit: float = DATA_LIMIT) -> None:
        self._folder, self._limit = folder, limit * 1024**2
        self._number = -1
        self._file: IO[bytes] | None = None
        self._writer: Any = None

    def place(self, table: pa.Table) -> tuple[int, int]:
        """Chunk and file index of the file that `table` will go into; begins it if need be."""
        if self._file is None or self._file.tell() + table.nbytes > self._limit:
            self.close()
            self._number += 1
            self._file = _numbered(self._folder, self._number, "parquet").open("wb")
        return divmod(self._number, CHUNK)

    def add(self, table: pa.Table) -> tuple[int, int]:
        """Write `table`; returns chunk and file index."""
        import pyarrow.parquet as pq

        place = self.place(table)
        if self._writer is None:
            self._writer = pq.ParquetWriter(self._file, table.schema, compression="snappy")
        self._writer.write_table(table, row_group_size=max(len(table), 1))
        return place

    def close(self) -> None:
        """Finish the file that is open, if one is."""
        for of in (self._writer, self._file):
            if of is not None:
                of.close()
        self._writer = self._file = None


class FilmFiles:
    """MP4 files of one camera below `folder`, of at most `limit` MB."""

    def __init__(self, folder: Path, limit: float = FILM_LIMIT) -> None:
        self._folder, self._limit = folder, limit * 1024**2
        self._number = -1
        self._film: JoinedFilm | None = None

    def add(self, data: bytes, frames: int) -> tuple[tuple[int, int], float]:
        """Add an episode's film of `frames`: chunk and file index, and where it begins [s]. Raises
        EpisodeFilmError."""
        film = self._film
        if film is None or film.size + len(data) > self._limit:
            self.close()
            self._number += 1
            film = self._film = JoinedFilm(_numbered(self._folder, self._number, "mp4"))
        start = film.seconds
        film.append(data, frames)
        return divmod(self._number, CHUNK), start

    def close(self) -> None:
        """Finish the file that is open, if one is."""
        if self._film is not None:
            self._film.close()
        self._film = None


def _numbered(folder: Path, number: int, ending: str) -> Path:
    chunk, file = divmod(number, CHUNK)
    path = folder / f"chunk-{chunk:03d}/file-{file:03d}.{ending}"
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


def _write_texts(path: Path, name: str, texts: Sequence[str]) -> None:
    """A table of texts and their numbers, `task` or `subtask` by `name`, as pandas reads one: the
    text is its index, and `<name>_index` counts from 0."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    number = f"{name}_index"
    columns = [
        {"name": n, "field_name": n, "pandas_type": kind, "numpy_type": dtype, "metadata": None}
        for n, kind, dtype in ((number, "int64", "int64"), (name, "unicode", "object"))
    ]
    about = {
        "index_columns": [name],
        "column_indexes": [],
        "columns": columns,
        "creator": {"library": "pyarrow", "version": pa.__version__},
        "pandas_version": "2.0.0",
    }
    fields = [(number, pa.int64()), (name, pa.string())]
    schema = pa.schema(fields, metadata={"pandas": json.dumps(about)})
    pq.write_table(pa.table([range(len(texts)), list(texts)], schema=schema), path)


# ---------------------------------------------------------------- reading back


def commands(folder: Path, line: EpisodeLine) -> NDArray[np.float32]:
    """The commanded joints (T, D) of an episode of either version."""
    import pyarrow.parquet as pq

    where = [("episode_index", "=", line.episode_index)]
    table = pq.read_table(folder / (line.file or "data"), columns=[COMMANDED], filters=where)
    width = table.schema.field(COMMANDED).type.list_size
    flat = table[COMMANDED].combine_chunks().flatten().to_numpy()
    return np.asarray(flat, np.float32).reshape(-1, width)


def misfits(version: str, folder: Path, lines: Sequence[EpisodeLine]) -> Iterator[str]:
    """A sentence for everything in the files that is not as the episodes `lines` say."""
    import pyarrow.parquet as pq

    info = json.loads((folder / "meta" / "info.json").read_text())
    frames = sum(line.frames for line in lines)
    said = (info["codebase_version"], info["total_episodes"], info["total_frames"])
    if said != (wanted := (version, len(lines), frames)):
        yield f"meta/info.json says {said} of version, episodes and frames, not {wanted}"
    stored = {name for name, of in info["features"].items() if of["dtype"] != "video"}
    counts: Counter[int] = Counter()
    index = 0
    for path in sorted((folder / "data").glob("*/*.parquet")):
        name = path.relative_to(folder)
        with pq.ParquetFile(path) as file:
            if set(file.schema_arrow.names) != stored:
                yield f"{name} has other columns than meta/info.json names"
            for batch in file.iter_batches(columns=["episode_index", "index"]):
                counts.update(batch["episode_index"].to_pylist())
                rows = batch["index"].to_numpy()
                if not np.array_equal(rows, np.arange(index, index + len(rows))):
                    yield f"{name} has rows that do not count on from {index}"
                index += len(rows)
    for line in lines:
        if (count := counts[line.episode_index]) != line.frames:
            yield f"episode {line.episode_index} has {count} rows, not {line.frames}"
    for name, of in info["features"].items():
        if of["dtype"] == "video":
            films = sorted((folder / "videos").rglob(f"{name}/**/*.mp4"))
            if (count := sum(map(frame_count, films))) != frames:
                yield f"the films of {name} have {count} frames, not {frames}"
