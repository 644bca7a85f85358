"""What continuous integration makes of a pull request: from changed paths to evidence."""

from __future__ import annotations

import http.server
import json
import re
import shutil
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from bundle_fakes import CARD_TEXT as CARD
from bundle_fakes import FAKES, PICK, SEEDS, make_run

from robospa.leaderboard import pull_request
from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.card import read_card
from robospa.leaderboard.packing import pack
from robospa.leaderboard.pull_request import check, fetch, submitted
from robospa.leaderboard.reference import shipped
from robospa.trial import TrialKey

ROOT = Path(__file__).parents[2]
MINE = "leaderboard/submissions/mine/"
TWO = [MINE + "model.toml", MINE + "bundle.txt"]


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bundle for practice."""
    folder = tmp_path_factory.mktemp("pull")
    make_run(folder / "run", [TrialKey(PICK, 1, seed) for seed in SEEDS])
    (folder / "model.toml").write_text(CARD)
    card, reference = read_card(folder / "model.toml"), shipped("bundle_fakes:World", FAKES[-1])
    pack([folder / "run"], card, folder / "b.zip", reference, practice=True, videos=False)
    return folder / "b.zip"


def hand_in(root: Path, bundle: Path, card: str = CARD, **changes: Any) -> Path:
    """A submission's folder below `root`."""
    import zipfile

    with zipfile.ZipFile(bundle) as archive:
        told = json.loads(archive.read("manifest.json"))["bundle"]
    said = {"address": "https://example.org/b.zip", "size": bundle.stat().st_size, "hash": told}
    folder = root / MINE
    folder.mkdir(parents=True)
    (folder / "model.toml").write_text(card)
    (folder / "bundle.txt").write_text("\n".join(map(str, {**said, **changes}.values())))
    return folder


def test_two_files_are_a_submission() -> None:
    assert submitted(TWO) == ["mine"]
    assert submitted(["README.md", "leaderboard/submissions/README.md"]) == []


@pytest.mark.parametrize(
    ("path", "words"),
    [
        ("harness/trial.py", "changes nothing else"),
        (".github/workflows/submission.yml", "changes nothing else"),
        (MINE + "evidence.json", "is not leaderboard/submissions/NAME"),
        (MINE + "videos/x.mp4", "is not leaderboard/submissions/NAME"),
        ("leaderboard/submissions/../../x/bundle.txt", "is not leaderboard/submissions/NAME"),
        ("leaderboard/submissions/Mine/bundle.txt", "small letters"),
        ("leaderboard/submissions/bundle.txt", "is not leaderboard/submissions/NAME"),
    ],
)
def test_other_changes_are_refused(path: str, words: str) -> None:
    with pytest.raises(BundleError, match=words):
        submitted([*TWO, path])


def test_what_was_announced_is_downloaded_verified_and_replayed(
    bundle: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
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
    told = {"bundle": json.loads(_manifest(bundle))["bundle"]}

    def verified(command: list[str]) -> subprocess.CompletedProcess[str]:
        Path(command[command.index("--evidence") + 1]).write_text(json.dumps({"valid": told}))
        return subprocess.CompletedProcess(command, 0)

    monkeypatch.setattr(pull_request.subprocess, "run", verified)
    folder = hand_in(tmp_path, bundle, **changes)
    with pytest.raises(BundleError, match=words):
        check(folder, tmp_path / "e.json", get=lambda a, path, s: shutil.copy(bundle, path))


def _manifest(bundle: Path) -> bytes:
    import zipfile

    with zipfile.ZipFile(bundle) as archive:
        return archive.read("manifest.json")


def test_a_bundle_that_does_not_verify_fails(bundle: Path, tmp_path: Path) -> None:
    folder = hand_in(tmp_path, bundle)
    with pytest.raises(BundleError, match="was not verified"):
        check(folder, tmp_path / "e.json", get=lambda a, path, s: path.write_bytes(b"PK"))


def test_further_files_and_links_are_refused(bundle: Path, tmp_path: Path) -> None:
    folder = hand_in(tmp_path, bundle)
    (folder / "setup.py").write_text("raise SystemExit")
    with pytest.raises(BundleError, match="and only them"):
        check(folder, tmp_path / "e.json")
    (folder / "setup.py").unlink()
    (folder / "bundle.txt").unlink()
    (folder / "bundle.txt").symlink_to("/etc/passwd")
    with pytest.raises(BundleError, match="and only them"):
        check(folder, tmp_path / "e.json")


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
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Files) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        yield f"http://127.0.0.1:{server.server_address[1]}"
        server.shutdown()
        thread.join()


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
    (tmp_path / "changed.txt").write_text("README.md\n")
    script = [sys.executable, str(ROOT / "scripts/check_submission.py"), "changed.txt", ".", "out"]
    done = subprocess.run(script, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert (done.returncode, done.stdout) == (0, "no submission is handed in\n")
    (tmp_path / "changed.txt").write_text("\n".join([*TWO, "harness/trial.py"]))
    done = subprocess.run(script, cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    assert done.stderr.startswith("refused: a submission adds a folder")


def test_the_workflow_calls_what_exists() -> None:
    text = (ROOT / ".github/workflows/submission.yml").read_text()
    for name in re.findall(r"scripts/[a-z_.]+", text):
        assert (ROOT / name).is_file()
    assert "pull_request_target" not in text
    assert "secrets" not in text.replace("no secrets", "")
