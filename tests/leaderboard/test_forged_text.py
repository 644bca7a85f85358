"""Scripts in names and fields, future versions, settings that do not count: each is refused.

Every forger here knows our code: where that makes sense, all hashes and the chain are made to hold
again after the change, so that the rule in question is what catches it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from bundle_fakes import Files, edit, edit_row, refused, seal, zip_up

from robospa.leaderboard import bundle as layout


@pytest.mark.parametrize(
    "text",
    [
        "<script>alert(1)</script>",
        "<img src=x onerror=alert(1)>",
        "javascript:alert(1)",
        "a\u202eb",
        "a\u0000b",
        "a\u200bb",
        '" onload="alert(1)',
        "x" * 81,
        "",
    ],
)
def test_a_script_in_the_models_name(files: Files, tmp_path: Path, text: str) -> None:
    edit(files, "model.json", lambda card: card.update(name=text))
    assert "model" in refused(zip_up(tmp_path / "b.zip", seal(files)))


@pytest.mark.parametrize("link", ["javascript:alert(1)", "http://x.org", 'https://x.org/"><b>'])
def test_a_script_in_a_link(files: Files, tmp_path: Path, link: str) -> None:
    edit(files, "model.json", lambda card: card.update(link=link))
    assert "model" in refused(zip_up(tmp_path / "b.zip", seal(files)))


@pytest.mark.parametrize("text", ["<script>", "</td>", "\\u003cscript>", "<svg/onload=x>"])
@pytest.mark.parametrize("field", ["instruction", "message", "digest"])
def test_a_script_in_a_record(files: Files, tmp_path: Path, field: str, text: str) -> None:
    edit_row(files, 0, lambda row: row["record"].update({field: "MARK"}))
    files[layout.RECORDS] = files[layout.RECORDS].replace(b"MARK", text.encode())
    assert "markup" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_a_script_in_the_settings(files: Files, tmp_path: Path) -> None:
    def change(run: Any) -> None:
        run["settings"]["policy"]["spec"]["name"] = "<script>"

    edit(files, layout.RUN, change)
    assert "markup" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_an_unknown_field_in_the_card(files: Files, tmp_path: Path) -> None:
    edit(files, "model.json", lambda card: card.update(onload="x"))
    assert "has the unknown field 'onload'" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_a_future_format(files: Files, tmp_path: Path) -> None:
    text = refused(zip_up(tmp_path / "b.zip", seal(files, format=2)))
    assert text == "the bundle has format 2, this robospa reads up to 1: update it"


def test_a_future_suite(files: Files, tmp_path: Path) -> None:
    assert "robospa-99" in refused(zip_up(tmp_path / "b.zip", seal(files, suite="robospa-99")))


def test_fields_of_a_future_record(files: Files, tmp_path: Path) -> None:
    edit_row(files, 0, lambda row: row["record"].update(reward=1.0))
    assert "written by a newer version" in refused(zip_up(tmp_path / "b.zip", seal(files)))


@pytest.mark.parametrize("field", ["privileged", "environment_state"])
def test_a_privileged_run_with_its_flag_taken_off(files: Files, tmp_path: Path, field: str) -> None:
    def change(run: Any) -> None:
        run["settings"]["policy"]["spec"][field] = True

    edit(files, layout.RUN, change)
    assert "privileged" in refused(zip_up(tmp_path / "b.zip", seal(files)))


def test_a_world_named_by_the_bundle_is_never_loaded(files: Files, tmp_path: Path) -> None:
    def change(run: Any) -> None:
        run["settings"]["world"]["name"] = "os:getcwd"

    edit(files, layout.RUN, change)
    assert "another world" in refused(zip_up(tmp_path / "b.zip", seal(files)))
