"""Which films a run has, and which it owes."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from fake_runs import RECORDS, make_run

from robospa.results.records.runs import film_name, films_in, owed_films, read_run

NAMES = [film_name(record.key) for record in RECORDS]


def put(folder: Path, name: str) -> None:
    (folder / "videos").mkdir(exist_ok=True)
    (folder / name).write_bytes(b"film")


def test_a_film_is_owed_until_it_is_there(tmp_path: Path) -> None:
    wanted = [replace(record, video=name) for record, name in zip(RECORDS, NAMES, strict=True)]
    assert owed_films(tmp_path, wanted) == wanted
    put(tmp_path, NAMES[1])
    assert films_in(tmp_path) == {NAMES[1]}
    assert owed_films(tmp_path, wanted) == [wanted[0], *wanted[2:]]


def test_nothing_is_owed_of_a_trial_whose_film_nobody_wants(tmp_path: Path) -> None:
    assert owed_films(tmp_path, RECORDS) == []


def test_a_record_that_names_another_file_has_nothing_made(tmp_path: Path) -> None:
    strange = [replace(RECORDS[0], video=name) for name in ("../x.mp4", "videos/x.mp4", NAMES[1])]
    assert owed_films(tmp_path, strange) == []


def test_a_film_that_was_made_long_afterwards_belongs_to_its_trial(tmp_path: Path) -> None:
    run = make_run(tmp_path, RECORDS)
    assert {record.video for record in run.records.values()} == {""}
    put(tmp_path, NAMES[4])
    found = read_run(tmp_path).records
    assert [found[record.key].video for record in RECORDS] == [""] * 4 + [NAMES[4], ""]
