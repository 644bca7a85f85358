"""Bundles that lie in the repository: handed in, completed, shown, refused."""

import json
import shutil
import subprocess
import zipfile
from collections.abc import Callable
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
from bundle_fakes import CARD_DATA, CARD_TEXT, FAKES, REFERENCE, make_run
from site_fakes import REPLAYED, of_bundle

from robospa.leaderboard import submission as in_repository
from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.card import to_card
from robospa.leaderboard.packing import pack
from robospa.leaderboard.pull_request import check
from robospa.leaderboard.site import build
from robospa.leaderboard.submission import add, left_out, read_submissions
from robospa.leaderboard.verify import Valid

pytestmark = pytest.mark.usefixtures("no_figures")

RECIPE = "recipe:scripts/learn_fake.sh"
CARD = CARD_TEXT.replace("https://example.org/w", RECIPE)
NAME = "fake-1"


def data(**changes: Any) -> dict[str, Any]:
    card = deepcopy(CARD_DATA)
    card["checkpoints"]["all"]["reference"] = RECIPE
    return card | changes


@pytest.fixture(scope="module")
def valid(tmp_path_factory: pytest.TempPathFactory) -> Valid:
    """A bundle of a model whose weights a recipe remakes."""
    folder = tmp_path_factory.mktemp("recipe")
    run = make_run(folder / "run")
    return pack([run], to_card(data()), folder / "packed.zip", REFERENCE)[0]


@pytest.fixture
def clone(tmp_path: Path) -> Path:
    """A repository with the recipe."""
    (tmp_path / "clone" / "scripts").mkdir(parents=True)
    (tmp_path / "clone" / "scripts" / "learn_fake.sh").write_text("")
    return tmp_path / "clone"


@pytest.fixture
def folder(valid: Valid, tmp_path: Path) -> Path:
    """A submission as it is handed in, with its bundle."""
    made = tmp_path / "home" / NAME
    made.mkdir(parents=True)
    shutil.copy(valid.path, made / "bundle.zip")
    (made / "model.toml").write_text(CARD)
    announce(made, valid.path.stat().st_size, valid.manifest.bundle)
    return made


def announce(folder: Path, size: int, bundle: str) -> None:
    (folder / "bundle.txt").write_text(f"bundle.zip\n{size}\n{bundle}\n")


def whole(valid: Valid, **changes: Any) -> dict[str, Any]:
    return {"replayed": of_bundle(valid, {**REPLAYED, **changes})}


def refuse(*_: Any) -> None:
    raise AssertionError("this was not to be called")


def test_it_is_verified_without_a_download_and_all_its_trials_are_replayed(
    folder: Path, clone: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls: list[list[str]] = []
    before = (folder / "bundle.zip").read_bytes()

    def verified(command: list[str]) -> subprocess.CompletedProcess[str]:
        calls.append(command)
        assert Path(command[5]).read_bytes() == before
        told = {"valid": {"bundle": (folder / "bundle.txt").read_text().split()[2]}}
        Path(command[command.index("--evidence") + 1]).write_text(json.dumps(told))
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr("robospa.leaderboard.pull_request.subprocess.run", verified)
    check(folder, tmp_path / "e.json", get=refuse, clone=clone)
    check(folder, tmp_path / "e.json", "0123456789abcdef", get=refuse, clone=clone)
    assert "--fraction" not in calls[0] and calls[1][-2:] == ["--fraction", "1"]


def test_a_bundle_that_does_not_verify_is_refused(
    folder: Path, clone: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(BundleError, match="was not verified"):
        check(folder, tmp_path / "e.json", words=FAKES, clone=clone)
    assert "96 of its 100 listed seeds are missing" in capfd.readouterr().err


def test_it_is_left_out_until_completed_and_then_offered_by_its_page(
    valid: Valid, folder: Path, tmp_path: Path
) -> None:
    home = folder.parent
    assert list(left_out(home)) == [NAME] and read_submissions(home) == []
    assert add(valid, [whole(valid)], home, NAME) == folder
    assert left_out(home) == {}
    build(home, tmp_path / "site")
    page = tmp_path / "site" / "models" / NAME / "index.html"
    assert (page.parent / "bundle.zip").read_bytes() == valid.path.read_bytes()
    text = page.read_text()
    assert 'href="bundle.zip"' in text and 'href="recipe' not in text
    assert f"remade by bash scripts/learn_fake.sh; sha256 {'0' * 64}" in text


@pytest.mark.parametrize("evidence", [{}, {"sampled": 19, "trials": 20, "identical": 19}])
def test_fewer_than_all_trials_replayed_are_not_enough(
    valid: Valid, folder: Path, evidence: dict[str, int]
) -> None:
    found = [whole(valid, **evidence)] if evidence else []
    with pytest.raises(BundleError, match=r"not all trials were replayed|20 is the least"):
        add(valid, found, folder.parent, NAME)


def grown(folder: Path) -> None:
    with (folder / "bundle.zip").open("r+b") as file:
        file.truncate(in_repository.MOST + 1)


def linked(folder: Path) -> None:
    (folder / "bundle.zip").rename(folder.parent / "elsewhere.zip")
    (folder / "bundle.zip").symlink_to(folder.parent / "elsewhere.zip")


def a_folder(folder: Path) -> None:
    (folder / "bundle.zip").unlink()
    (folder / "bundle.zip").mkdir()
    (folder / "bundle.zip" / "setup.py").write_text("raise SystemExit")


def announced(old: str, new: str) -> Callable[[Path], object]:
    """bundle.txt says `new` for `old`."""

    def spoil(folder: Path) -> None:
        path = folder / "bundle.txt"
        path.write_text(path.read_text().replace(old, new))

    return spoil


def card(text: str) -> Callable[[Path], object]:
    return lambda folder: (folder / "model.toml").write_text(text)


def more_bytes(folder: Path) -> None:
    with (folder / "bundle.zip").open("ab") as file:
        file.write(b"x")


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (grown, "has at most 8388608, a larger one"),
        (linked, "as plain files"),
        (a_folder, "missing or no plain file"),
        (lambda folder: (folder / "bundle.zip").unlink(), "does not hold the files"),
        (lambda folder: (folder / "setup.py").write_text("x"), "does not hold the files"),
        (announced("bundle.zip", "https://example.org/b.zip"), "bundle.txt, model.toml, and only"),
        (announced("bundle.zip", "../theirs/bundle.zip"), "is not three lines"),
        (announced("zip\n", "zip\n9999"), "announces more than 8388608 bytes"),
        (card(CARD_TEXT), "only if a recipe there remakes the weights"),
        (
            card(CARD.replace("learn_fake", "learn_other")),
            "scripts/learn_other.sh, which this repository does not have",
        ),
        (
            card(CARD.replace("scripts/", "scripts/../")),
            "a https address of at most 300 characters",
        ),
        (more_bytes, r"has \d+ bytes, not \d+"),
    ],
)
def test_what_is_handed_in_wrongly_is_refused_before_it_is_opened(
    folder: Path,
    clone: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    spoil: Callable[[Path], object],
    words: str,
) -> None:
    monkeypatch.setattr("robospa.leaderboard.pull_request.subprocess.run", refuse)
    spoil(folder)
    with pytest.raises(BundleError, match=words):
        check(folder, tmp_path / "e.json", clone=clone)


def test_a_merged_bundle_stays_the_one_that_was_verified(valid: Valid, folder: Path) -> None:
    add(valid, [whole(valid)], folder.parent, NAME)
    other = folder / "other.zip"
    with zipfile.ZipFile(valid.path) as old, zipfile.ZipFile(other, "w") as new:
        for entry in old.infolist():
            new.writestr(entry, old.read(entry) + b" " * (entry.filename == "run.json"))
    other.replace(folder / "bundle.zip")
    with pytest.raises(BundleError, match=r"run\.json in bundle\.zip is not the manifest's"):
        read_submissions(folder.parent)
    (folder / "bundle.zip").unlink()
    with pytest.raises(BundleError, match="missing or no plain file"):
        read_submissions(folder.parent)


def test_another_bundle_in_the_folder_is_not_completed(valid: Valid, folder: Path) -> None:
    announce(folder, valid.path.stat().st_size, "0" * 64)
    with pytest.raises(BundleError, match="size or the hash of another bundle"):
        add(valid, [whole(valid)], folder.parent, NAME)
    (folder / "bundle.zip").write_bytes(b"PK")
    with pytest.raises(BundleError, match="not a plain zip file"):
        add(valid, [whole(valid)], folder.parent, NAME)
