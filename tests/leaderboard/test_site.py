"""The leaderboard's pages: what they say, that text stays text, and which folders are refused."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from html import unescape
from pathlib import Path
from typing import Any

import pytest
from bundle_fakes import CARD_TEXT
from site_fakes import REPLAYED, REPRODUCED, change, make_submission, make_valid

from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.entries import BADGES, HOW_REPRODUCED, all_entries, published_entries
from robospa.leaderboard.site import build, index_page, write_model, write_site
from robospa.leaderboard.submission import add, left_out, read_submission, read_submissions, slug_of
from robospa.results.paper.columns import Column

pytestmark = pytest.mark.usefixtures("no_figures")

LIED = [100, 100, 340, 400]
EVIL = '</script><script>alert(1)</script><img src=x onerror="alert(2)">'


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A submission with all badges."""
    folder = tmp_path_factory.mktemp("site")
    return make_submission(
        folder, folder / "home", {"replayed": REPLAYED}, {"reproduced": REPRODUCED}
    )


@pytest.fixture
def folder(kept: Path, tmp_path: Path) -> Path:
    """A copy of it, to be changed."""
    return Path(shutil.copytree(kept, tmp_path / "home" / kept.name))


def data_of(page: str) -> dict[str, Any]:
    text = page.split('<script type="application/json" id="data">')[1].split("</script>")[0]
    found: dict[str, Any] = json.loads(text)
    return found


def test_published_models_enter_unverified_with_the_papers_numbers() -> None:
    models = data_of(index_page(published_entries()))["models"]
    assert [m["name"] for m in models] == ["RDT", "GO-1", "π0.5", "X-VLA"]
    assert {BADGES[m["badge"]] for m in models} == {"published, not verified"}
    value, low, high = models[2]["values"]["sr"]["overall"][5]
    assert (value, low, high) == pytest.approx((22.25, 21.37, 23.33), abs=0.01)
    assert models[2]["values"]["onta"].get("overall") is None


def test_a_submission_has_its_badges_and_their_evidence(kept: Path, tmp_path: Path) -> None:
    index = build(kept.parent, tmp_path / "out")
    model = next(m for m in data_of(index.read_text())["models"] if m["name"] == "Fake 1")
    assert (model["badge"], model["badges"]) == ("reproduced", ["valid", "replayed", "reproduced"])
    assert model["values"]["sr"]["Pick_Blocks_Size"][0][0] == 75
    assert "overall" not in model["values"]["sr"], "most categories were not run"
    page = (tmp_path / "out" / "models" / "fake-1" / "index.html").read_text()
    for text in ("20 of 20 trials were played again", "0123456789abcdef",
                 "1210 of 2000 fresh trials succeeded",
                 "5 points 97 %",
                 "In 2 of 3 cells, GAC/0, Pick_Blocks_Size/0,",
                 "https://example.org/bundle.zip", "Filmed trials", "50, 50, 50",
                 "ran 1 of 56 tasks"):  # fmt: skip
        assert text in page
    found = read_submission(kept).grounding["GAC"]
    assert found.trials == 20 and found.due == 20
    assert len(data_of(page)["trials"]) == 1
    film = tmp_path / "out" / "models" / "fake-1" / data_of(page)["trials"][0]["video"]
    assert film.is_file()


def test_who_reproduces_an_entry_is_told_alike_on_the_page_and_in_the_documentation() -> None:
    pages = (index_page([]), (Path(__file__).parents[2] / "docs" / "leaderboard.md").read_text())
    assert all(HOW_REPRODUCED in unescape(" ".join(page.split())) for page in pages)


def test_a_replay_with_other_final_states_has_a_badge_of_its_own(tmp_path: Path) -> None:
    close = {**REPLAYED, "identical": 18, "agrees": 2}
    kept = make_submission(tmp_path, tmp_path / "home", {"replayed": close})
    entry = all_entries([read_submission(kept)])[0]
    assert entry.badges == ("valid", "outcomes")


def test_the_same_trials_are_no_two_entries(kept: Path, tmp_path: Path) -> None:
    for name in ("one", "two"):
        shutil.copytree(kept, tmp_path / name)
    with pytest.raises(BundleError, match="one and two are of the same trials"):
        all_entries(read_submissions(tmp_path))


def test_names_that_are_scripts_stay_text(tmp_path: Path) -> None:
    entry = published_entries()[0]
    found, about = entry.column.results, ((EVIL, EVIL),)
    setting = replace(found.setting, embodiment=(EVIL,))
    evil = replace(
        entry,
        name=EVIL,
        team=EVIL,
        about=about,
        evidence=about,
        column=Column(replace(found, name=EVIL, setting=setting)),
    )
    write_model(evil, tmp_path)
    for page in (index_page([evil]), (tmp_path / "index.html").read_text()):
        assert "<script>alert" not in page and "<img" not in page
        assert page.count("<script") == 2
    assert data_of(index_page([evil]))["models"][0]["name"] == EVIL


def test_a_model_that_left_loses_its_page_and_other_folders_are_left_alone(tmp_path: Path) -> None:
    first, second = published_entries()[:2]
    out = tmp_path / "out"
    write_site([first, second], out)
    write_site([first], out)
    assert not (out / "models" / second.slug).exists()
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "thesis.tex").write_text("x")
    with pytest.raises(BundleError, match="holds other things"):
        write_site([first], tmp_path / "other")


def test_every_file_of_the_bundle_is_held_against_its_hash(folder: Path) -> None:
    for name in ("model.json", "run.json", "scores.json"):
        before = (folder / name).read_bytes()
        (folder / name).write_bytes(before + b" ")
        with pytest.raises(BundleError, match=f"{name} is not the bundle's"):
            read_submission(folder)
        (folder / name).write_bytes(before)
    change(folder / "manifest.json", lambda m: m.update(suite="other"))
    with pytest.raises(BundleError, match="manifest was changed"):
        read_submission(folder)


@pytest.mark.parametrize(
    ("name", "edit", "refusal"),
    [
        *(
            ("evidence.json", edit, refusal)
            for edit, refusal in (
                (lambda d: d["valid"].update(bundle="0" * 64), "this very bundle"),
                (lambda d: d["replayed"].update(different=1), "other outcomes"),
                (lambda d: d["replayed"].update(sampled="all"), "a whole number, not 'all'"),
                (lambda d: d["replayed"].update(sampled=19, identical=19), "20 is the least"),
                (lambda d: d["replayed"].update(trials=21), "not those of the bundle"),
                (lambda d: d["replayed"].update(challenge="1"), "fewer than 8"),
                (lambda d: d["replayed"].update(bundle="0" * 64), "replay is of another bundle"),
                (lambda d: d["reproduced"].update(power={"0.05": 0.0}), "needs 95 %"),
                (lambda d: d["reproduced"].update(alpha=0), "a number > 0.0, not 0"),
                *(
                    (lambda d, new=new: d["reproduced"].update(new), "do not fit each other")
                    for new in (
                        {"counts": {}},
                        {"trials": 1},
                        {"categories": {}},
                        {"cells": {"overall/0": 1.0}},
                    )
                ),
                (lambda d: d["replayed"].update(sampled=21, identical=21), "not those of the"),
                (lambda d: d["reproduced"].pop("bundle"), "lacks the field 'bundle'"),
                (lambda d: d["reproduced"].update(bundle="0" * 64), "is of another bundle"),
                (
                    lambda d: d["reproduced"]["counts"]["sr"].update({"Pick_Blocks_Size/1": LIED}),
                    "contradict what the bundle claims: sr of Pick_Blocks_Size/1",
                ),
                (lambda d: d.update(address="javascript:alert(1)"), "markup|address"),
            )
        ),
        ("trials.json", lambda d: d["films"][0].update(video="../../x.mp4"), "the name of a video"),
        ("trials.json", lambda d: d["films"][0].update(seconds="1"), "a number or null, not '1'"),
        ("trials.json", lambda d: d["failures"].update(x={"odd": 1}), "'failures' must be a map"),
    ],
)
def test_folders_that_are_not_what_add_wrote_are_refused(
    folder: Path, name: str, edit: Callable[[Any], None], refusal: str
) -> None:
    change(folder / name, edit)
    with pytest.raises(BundleError, match=refusal):
        read_submissions(folder.parent)


def test_links_and_odd_names_of_folders_are_refused(folder: Path, tmp_path: Path) -> None:
    card = folder / "model.json"
    card.rename(tmp_path / "elsewhere")
    card.symlink_to(tmp_path / "elsewhere")
    with pytest.raises(BundleError, match="is a link"):
        read_submission(folder)
    with pytest.raises(BundleError, match="small letters"):
        read_submission(tmp_path / "Evil Name")


def test_evidence_of_another_bundle_and_a_second_submission_are_refused(tmp_path: Path) -> None:
    valid = make_valid(tmp_path)
    with pytest.raises(BundleError, match="of another bundle"):
        add(valid, [{"valid": {"bundle": "0"}}], tmp_path / "home")
    for badge, part in (("replayed", REPLAYED), ("reproduced", REPRODUCED)):
        with pytest.raises(BundleError, match="of another bundle"):
            add(valid, [{badge: {**part, "bundle": "0" * 64}}], tmp_path / "home")
    add(valid, [], tmp_path / "home")
    with pytest.raises(BundleError, match="already there"):
        add(valid, [], tmp_path / "home")
    assert slug_of("  π0.5 <b>") == "0-5-b"


def test_what_was_handed_in_has_to_fit_the_bundle(tmp_path: Path) -> None:
    valid = make_valid(tmp_path)
    home, size = tmp_path / "home", valid.path.stat().st_size
    folder = home / "mine"
    folder.mkdir(parents=True)
    (folder / "model.toml").write_text(CARD_TEXT)
    (folder / "bundle.txt").write_text(f"https://example.org/b.zip\n5\n{64 * '0'}")
    with pytest.raises(BundleError, match="another bundle"):
        add(valid, [], home, "mine")
    (folder / "model.toml").write_text(CARD_TEXT.replace("Nobody", "Else"))
    with pytest.raises(BundleError, match="not the bundle's model card"):
        add(valid, [], home, "mine")
    with pytest.raises(BundleError, match="small letters"):
        add(valid, [], home, "../mine")
    with pytest.raises(BundleError, match="names one beside it"):
        add(valid, [], home, "mine", "bundle.zip")
    (folder / "model.toml").write_text(CARD_TEXT)
    (folder / "bundle.txt").write_text(f"https://a.org/b.zip\n{size}\n{valid.manifest.bundle}\n")
    assert list(left_out(home)) == ["mine"] and read_submissions(home) == []
    assert add(valid, [], home, "mine") == folder
    assert read_submissions(home)[0].evidence.address == "https://a.org/b.zip"
    assert left_out(home) == {}


def test_a_folder_called_like_a_published_model_is_refused_and_left_out(
    kept: Path, tmp_path: Path
) -> None:
    with pytest.raises(BundleError, match="is that of the paper's"):
        add(make_valid(tmp_path), [], tmp_path / "home", "pi0-5")
    shutil.copytree(kept, tmp_path / "home" / "pi0-5")
    notes: list[str] = []
    index = build(tmp_path / "home", tmp_path / "out", notes.append)
    assert notes[0].startswith("pi0-5 is left out: the folder's name")
    assert [m["name"] for m in data_of(index.read_text())["models"]] == [
        e.name for e in published_entries()
    ]
