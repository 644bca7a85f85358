"""Chains, rows, seeds, records and actions that were tampered with: each is refused.

Every forger here knows our code: where that makes sense, all hashes and the chain are made to hold
again after the change, so that the rule in question is what catches it.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
from bundle_fakes import (
    ACTIONS,
    PICK,
    PRESS,
    Files,
    edit,
    edit_row,
    put_rows,
    refused,
    relist,
    rows_of,
    seal,
    zip_up,
)

from robospa.harness.sim.motion import RATE
from robospa.leaderboard import bundle as layout
from robospa.leaderboard.traces import decode
from robospa.leaderboard.trial_rows import trace_hash
from robospa.trial import TrialKey


def test_an_edited_row(files: Files, tmp_path: Path) -> None:
    files[layout.RECORDS] = files[layout.RECORDS].replace(b'"message":""', b'"message":"x"', 1)
    assert "does not follow the row before" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_a_forged_chain(files: Files, tmp_path: Path) -> None:
    sealed = seal(files, chain={"rows": 40, "last": "0" * 64})
    assert "does not end as the manifest says" in refused(zip_up(tmp_path / "b.zip", sealed))


def test_a_chain_from_another_run(files: Files, tmp_path: Path) -> None:
    edit(files, layout.RUN, lambda run: run["settings"].update(step_scale=1))
    lines = files[layout.RECORDS].splitlines()
    first = json.loads(lines[0])
    first["previous"] = "1" * 64
    files[layout.RECORDS] = b"\n".join([json.dumps(first).encode(), *lines[1:], b""])
    assert "does not follow" in refused(zip_up(tmp_path / "b.zip", seal(files)))


@pytest.mark.parametrize("name", ["model.json", "run.json", "seeds.json", "report/scores.json"])
def test_a_file_changed_behind_the_manifest(files: Files, tmp_path: Path, name: str) -> None:
    files[name] = files[name][:-1] + b" }"
    assert f"{name} was changed" in refused(zip_up(tmp_path / "b.zip", files))
    shorter = dict(files)
    shorter[name] = files[name][:-2] + b"}"
    shorter[name] = shorter[name].replace(b":", b";", 1)
    assert f"{name} was changed" in refused(zip_up(tmp_path / "c.zip", shorter))


def test_a_manifest_changed_behind_its_hash(files: Files, tmp_path: Path) -> None:
    edit(files, layout.MANIFEST, lambda m: m.update(robospa="9.9"))
    assert "the manifest was changed" in refused(zip_up(tmp_path / "b.zip", files))


def test_reordered_rows(files: Files, tmp_path: Path) -> None:
    rows = rows_of(files)
    rows[0], rows[1] = rows[1], rows[0]
    put_rows(files, rows)
    assert "row 1 is" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_a_row_left_out(files: Files, tmp_path: Path) -> None:
    put_rows(files, rows_of(files)[:-1])
    assert "trials are missing" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_a_duplicated_trial(files: Files, tmp_path: Path) -> None:
    rows = rows_of(files)
    rows[3] = rows[2]
    put_rows(files, rows)
    assert "is there twice" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_a_duplicated_trial_in_the_list(files: Files, tmp_path: Path) -> None:
    keys = sorted(TrialKey(**row["record"]["key"]) for row in rows_of(files))
    relist(files, [*keys[:3], keys[2], *keys[4:]])
    text = refused(zip_up(tmp_path / "b.zip", seal(files)))
    assert "more than once" in text or "twice" in text


def test_seeds_outside_the_list(files: Files, tmp_path: Path) -> None:
    rows = rows_of(files)
    rows[0]["record"]["key"]["seed"] = 99
    keys = [TrialKey(**row["record"]["key"]) for row in rows]
    relist(files, keys)
    put_rows(files, rows)
    assert "seed 99, which is not in the shipped list" in refused(
        zip_up(tmp_path / "b.zip", seal(files))
    )


def test_a_listed_seed_left_out(files: Files, tmp_path: Path) -> None:
    rows = rows_of(files)[1:]
    relist(files, [TrialKey(**row["record"]["key"]) for row in rows])
    put_rows(files, rows)
    assert "incomplete: 1 of its 4 listed seeds" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_a_task_left_out(files: Files, tmp_path: Path) -> None:
    rows = [r for r in rows_of(files) if r["record"]["key"]["level"] != 5]
    relist(files, [TrialKey(**row["record"]["key"]) for row in rows])
    put_rows(files, rows)
    assert "L5" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_a_task_that_does_not_exist(files: Files, tmp_path: Path) -> None:
    rows = rows_of(files)
    for row in rows:
        row["record"]["key"]["task"] = "Easy_" + row["record"]["key"]["task"]
    relist(files, [TrialKey(**row["record"]["key"]) for row in rows])
    assert "no variant with a list of seeds" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def make_success(row: Any) -> None:
    record = row["record"]
    record.update(success=True, end="success", done=2, best=2, message="")
    end = {"time": record["physics_steps"] / RATE, "kind": "success"}
    record["events"] = [{**end, "object": "", "index": -1, "note": ""}]


def failed(row: Any) -> bool:
    return not row["record"]["success"]


def test_a_success_without_its_event(files: Files, tmp_path: Path) -> None:
    place = next(n for n, row in enumerate(rows_of(files)) if failed(row))
    edit_row(files, place, lambda row: row["record"].update(success=True, end="success"))
    assert "its events say False" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_a_success_that_the_scores_do_not_have(files: Files, tmp_path: Path) -> None:
    place = next(n for n, row in enumerate(rows_of(files)) if failed(row))
    edit_row(files, place, make_success)
    assert "is not what the records give" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_another_tasks_actions(files: Files, tmp_path: Path) -> None:
    other = layout.actions_name(PRESS, 1)
    files[ACTIONS], files[other] = files[other], files[ACTIONS]
    text = refused(zip_up(tmp_path / "b.zip", seal(files)))
    assert "other actions than its row says" in text


def test_another_tasks_actions_with_hashes_to_match(files: Files, tmp_path: Path) -> None:
    files[ACTIONS] = files[layout.actions_name(PRESS, 1)]
    rows = rows_of(files)
    for row, trace in zip(rows, decode(files[ACTIONS], ""), strict=False):
        row["trace"] = trace_hash(trace)
    put_rows(files, rows)
    assert "not those of its record" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_actions_that_are_missing(files: Files, tmp_path: Path) -> None:
    del files[ACTIONS]
    assert "lacks" in refused(zip_up(tmp_path / "b.zip", files))
    assert f"has no {ACTIONS}" in refused(zip_up(tmp_path / "c.zip", seal(files)))


def test_outcomes_that_the_records_do_not_have(files: Files, tmp_path: Path) -> None:
    def change(outcomes: Any) -> None:
        outcomes[f"{PICK}/1"]["success"] = "1111"

    edit(files, layout.OUTCOMES, change)
    text = refused(zip_up(tmp_path / "b.zip", seal(files)))
    assert text == "report/outcomes.json is not what the records give"


def test_edited_tables(files: Files, tmp_path: Path) -> None:
    files["report/tables.csv"] = files["report/tables.csv"].replace(b"75", b"99")
    assert "tables.csv is not what the records give" in refused(
        zip_up(tmp_path / "b.zip", seal(files))
    )


def test_a_video_that_was_not_announced(files: Files, tmp_path: Path) -> None:
    old = next(name for name in files if name.startswith("videos/"))
    seed = "100000" if "100000" not in old else "100001"
    new = f"videos/{PICK}-L1-{seed}-aloha-agilex-clean-heldout.mp4"
    new = new.replace("L1", "L3") if new == old else new
    files[new] = files.pop(old)
    assert "video" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_a_page_in_place_of_a_video(files: Files, tmp_path: Path) -> None:
    name = next(name for name in files if name.startswith("videos/"))
    files[name] = b"<html><script>alert(1)</script></html>"
    assert "is not an MP4 video" in refused(zip_up(tmp_path / "b.zip", seal(files)))
