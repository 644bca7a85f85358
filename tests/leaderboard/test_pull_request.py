"""What continuous integration makes of a pull request: from changed paths to evidence."""

import http.server
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from bundle_fakes import CARD_TEXT as CARD
from bundle_fakes import FAKES, PICK, SEEDS, make_run, unzip
from wire_helpers import serving

from robospa.leaderboard import pull_request
from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.card import read_card
from robospa.leaderboard.packing import pack
from robospa.leaderboard.pull_request import DIFF, check, fetch, read_changes, submitted
from robospa.leaderboard.rules import shipped
from robospa.trial import TrialKey

ROOT = Path(__file__).parents[2]
MINE = "leaderboard/submissions/mine/"
TWO = [("A", MINE + "model.toml"), ("A", MINE + "bundle.txt")]


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bundle for practice."""
    folder = tmp_path_factory.mktemp("pull")
    make_run(folder / "run", [TrialKey(PICK, 1, seed) for seed in SEEDS])
    (folder / "model.toml").write_text(CARD)
    card, reference = read_card(folder / "model.toml"), shipped("bundle_fakes:World", FAKES[-1])
    pack([folder / "run"], card, folder / "b.zip", reference, practice=True, videos=False)
    return folder / "b.zip"


def hash_of(bundle: Path) -> str:
    return str(json.loads(unzip(bundle)["manifest.json"])["bundle"])


def hand_in(root: Path, bundle: Path, card: str = CARD, **changes: Any) -> Path:
    """A submission's folder below `root`."""
    size = bundle.stat().st_size
    said = {"address": "https://example.org/b.zip", "size": size, "hash": hash_of(bundle)}
    folder = root / MINE
    folder.mkdir(parents=True)
    (folder / "model.toml").write_text(card)
    (folder / "bundle.txt").write_text("\n".join(map(str, {**said, **changes}.values())))
    return folder


HOME = "leaderboard/submissions/"


@pytest.mark.parametrize(
    ("status", "path", "words"),
    [
        *(("A", path, "changes nothing else") for path in ("harness/trial.py", ".github/x.yml")),
        *(
            ("A", path, "is not leaderboard/submissions/NAME")
            for path in (
                *(MINE + name for name in ("evidence.json", "videos/x.mp4", "other.zip")),
                *(HOME + name for name in ("../../x/bundle.txt", "bundle.txt", "bundle.zip")),
                *(MINE + "bundle.zip/x", HOME + "Mine/bundle.txt"),
            )
        ),
        ("A", HOME + "pi0-5/bundle.txt", "is that of the paper's"),
        ("D", HOME + "theirs/bundle.txt", "this one deletes"),
        ("M", HOME + "theirs/bundle.zip", "this one changes"),
        ("T", HOME + "theirs/bundle.txt", "this one changes the type of"),
    ],
)
def test_other_changes_are_refused(status: str, path: str, words: str) -> None:
    with pytest.raises(BundleError, match=words):
        submitted([*TWO, (status, path)])


def git(folder: Path, *words: str) -> bytes:
    own = ["-c", "user.name=n", "-c", "user.email=e@example.org", "-c", "init.defaultBranch=main"]
    return subprocess.run(
        ["git", "-C", str(folder), *own, *words], check=True, capture_output=True, timeout=60
    ).stdout


@pytest.fixture
def repository(tmp_path: Path) -> Path:
    """A clone in which a submission called theirs was merged, on the branch of a new one."""
    folder = tmp_path / "clone"
    theirs = folder / "leaderboard/submissions/theirs"
    theirs.mkdir(parents=True)
    for name in ("model.toml", "bundle.txt", "evidence.json"):
        (theirs / name).write_text(f"the same words in {name}\n" * 9)
    git(folder, "init", "-q")
    git(folder, "config", "diff.renames", "copies")
    git(folder, "add", ".")
    git(folder, "commit", "-q", "-m", "theirs")
    git(folder, "checkout", "-q", "-b", "mine")
    return folder


def changes_of(repository: Path) -> list[tuple[str, str]]:
    git(repository, "add", ".")
    git(repository, "commit", "-q", "-m", "mine")
    return read_changes(git(repository, *DIFF.split()[1:], "main...HEAD"))


@pytest.mark.parametrize("take", [shutil.move, shutil.copy])
def test_a_rename_of_anothers_files_is_a_deletion_and_a_copy_an_addition(
    repository: Path, take: Callable[[Path, Path], object]
) -> None:
    home = repository / HOME
    (home / "mine").mkdir()
    for name in ("model.toml", "bundle.txt"):
        take(home / "theirs" / name, home / "mine" / name)
    found = changes_of(repository)
    if take is shutil.copy:
        assert submitted(found) == ["mine"]
        return
    with pytest.raises(BundleError, match=r"this one deletes .*theirs"):
        submitted(found)


@pytest.mark.parametrize("name", ["mi ne", "mïne", 'mine"', "mine\nleaderboard/x", "mine\tx"])
def test_unusual_names_are_read_as_they_are(repository: Path, name: str) -> None:
    folder = repository / "leaderboard/submissions" / name
    folder.mkdir(parents=True)
    (folder / "model.toml").write_text("")
    found = changes_of(repository)
    assert found == [("A", f"leaderboard/submissions/{name}/model.toml")]
    with pytest.raises(BundleError, match="is not leaderboard/submissions/NAME"):
        submitted(found)


@pytest.mark.parametrize(
    "data",
    [
        b"leaderboard/submissions/mine/model.toml\n",
        b"A\tleaderboard/submissions/mine/model.toml\n",
        b"R100\0theirs\0mine\0",
        b"R100\0theirs\0mine\0A\0x\0",
        b"A\0mine/model.toml",
        b"A\0\0",
    ],
)
def test_other_lists_of_changes_are_refused(data: bytes) -> None:
    with pytest.raises(BundleError, match="the list of changed files"):
        read_changes(data)


def test_what_was_announced_is_downloaded_verified_and_replayed(
    bundle: Path, tmp_path: Path
) -> None:
    asked: list[tuple[str, int]] = []

    def get(address: str, path: Path, size: int) -> None:
        asked.append((address, size))
        shutil.copy(bundle, path)

    more = ["--practice", "--fraction", "1", "--workers", "1", *FAKES]
    folder, evidence = hand_in(tmp_path, bundle), tmp_path / "evidence.json"
    found = check(folder, evidence, "0123456789abcdef", more, get)
    assert asked == [("https://example.org/b.zip", bundle.stat().st_size)]
    assert found["replayed"]["identical"] == 4
    assert json.loads(evidence.read_text()) == found


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"hash": "0" * 64}, "hash of another bundle"),
        ({"hash": "0"}, "64 hexadecimal digits"),
        ({"size": 10**10}, "announces more than"),
        ({"size": "many"}, "not three lines"),
        ({"address": "http://example.org/b.zip"}, "not three lines"),
        ({"address": "file:///etc/passwd"}, "not three lines"),
        ({"card": CARD.replace("Fake 1", "Fake 2")}, "not the bundle's model card"),
    ],
)
def test_another_bundle_than_announced_is_refused(
    bundle: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    changes: dict[str, Any],
    words: str,
) -> None:
    told = {"bundle": hash_of(bundle)}

    def verified(command: list[str]) -> subprocess.CompletedProcess[str]:
        Path(command[command.index("--evidence") + 1]).write_text(json.dumps({"valid": told}))
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr(pull_request.subprocess, "run", verified)
    folder = hand_in(tmp_path, bundle, **changes)
    with pytest.raises(BundleError, match=words):
        check(folder, tmp_path / "e.json", get=lambda a, path, s: shutil.copy(bundle, path))


class Files(http.server.BaseHTTPRequestHandler):
    """Ten bytes, or a redirect to somewhere else."""

    def do_GET(self) -> None:
        self.send_response(302 if self.path == "/away" else 200)
        if self.path == "/away":
            self.send_header("Location", "http://127.0.0.1:9/x")
        self.end_headers()
        self.wfile.write(b"0123456789")

    def log_message(self, *_: Any) -> None:
        pass


@pytest.fixture
def site() -> Iterator[str]:
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Files)
    with serving(server):
        yield f"http://127.0.0.1:{server.server_address[1]}"


def test_a_download_has_the_announced_size(site: str, tmp_path: Path) -> None:
    fetch(f"{site}/x", tmp_path / "b", 10)
    assert (tmp_path / "b").read_bytes() == b"0123456789"
    with pytest.raises(BundleError, match="has more bytes, not 9"):
        fetch(f"{site}/x", tmp_path / "b", 9)
    with pytest.raises(BundleError, match="has 10 bytes, not 11"):
        fetch(f"{site}/x", tmp_path / "b", 11)
    with pytest.raises(BundleError, match="that is not https"):
        fetch(f"{site}/away", tmp_path / "b", 10)


def test_the_script_says_what_it_refuses(tmp_path: Path) -> None:
    (tmp_path / "changed.txt").write_bytes(b"M\0README.md\0")
    script = [sys.executable, str(ROOT / "scripts/check_submission.py"), "changed.txt", ".", "out"]
    done = subprocess.run(script, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (0, "no submission is handed in\n")
    changes = [*TWO, ("M", "harness/trial.py")]
    text = "".join(f"{status}\0{path}\0" for status, path in changes)
    (tmp_path / "changed.txt").write_text(text)
    done = subprocess.run(script, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    assert done.stderr.startswith("refused: a submission adds a folder")


def test_the_workflow_calls_what_exists() -> None:
    text = (ROOT / ".github/workflows/submission.yml").read_text()
    for name in re.findall(r"scripts/[a-z_.]+", text):
        assert (ROOT / name).is_file()
    assert f"{DIFF.removeprefix('git ')} " in text
    assert DIFF.removeprefix("git ") in (ROOT / "docs/leaderboard.md").read_text()
    assert "pull_request_target" not in text
    assert "secrets" not in text.replace("no secrets", "")
