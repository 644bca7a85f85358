"""What continuous integration asks of a pull request that submits: one folder, two files, a bundle.

The pull request is read as data: nothing that it brings is run. The bundle is downloaded to a
temporary file, as far as its announced size, verified by `robospa submit verify`, and held against
the two files. Refused, each in one sentence: changes anywhere else, other files than the two, a
bundle that is not what was announced.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import urllib.request
from collections.abc import Callable, Sequence
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import urlsplit

from robospa.leaderboard import bundle as layout
from robospa.leaderboard.archive import Archive
from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.card import read_card, to_card
from robospa.leaderboard.strict_json import parse_map
from robospa.leaderboard.submission import ASKED, BUNDLE, EVIDENCE, SLUG, read_announced

HOME = PurePosixPath("leaderboard/submissions")
BLOCK = 1 << 20
SECONDS = 60.0
"""The longest wait for the next bytes of a download."""
Fetch = Callable[[str, Path, int], None]


def submitted(changed: Sequence[str]) -> list[str]:
    """Names of the submissions that the changed paths hand in; [] if none.

    BundleError if they touch a submission and anything else, or other files than the two.
    """
    paths = [PurePosixPath(line) for line in changed if line.strip()]
    own = [p for p in paths if HOME in p.parents and p != HOME / "README.md"]
    if own and (strange := [p for p in paths if p not in own]):
        raise BundleError(
            f"a submission adds a folder below {HOME} and changes nothing else; this one also "
            f"changes {str(strange[0])[:120]!a}"
        )
    for path in own:
        place = path.relative_to(HOME).parts
        if len(place) != 2 or not SLUG.fullmatch(place[0]) or place[1] not in (ASKED, BUNDLE):
            raise BundleError(
                f"{str(path)[:120]!a} is not {HOME}/NAME/{ASKED} or {BUNDLE}, NAME being of small "
                "letters, digits and hyphens"
            )
    return sorted({path.parent.name for path in own})


def check(
    folder: Path,
    evidence: Path,
    challenge: str | None = None,
    words: Sequence[str] = (),
    get: Fetch | None = None,
) -> dict[str, object]:
    """Verify the bundle of the submission in `folder` and return the evidence, also written.

    With `challenge` a sample is replayed, too. `words` go to `robospa submit verify`, whose output
    is passed on. Raises BundleError.
    """
    there = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
    if there != {ASKED, BUNDLE} or any((folder / name).is_symlink() for name in there):
        raise BundleError(f"{folder} does not hold the files {ASKED} and {BUNDLE}, and only them")
    announced, card = read_announced(folder), read_card(folder / ASKED)
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "bundle.zip"
        (get or fetch)(announced.address, path, announced.size)
        more = ["--challenge", challenge] if challenge else []
        command = [sys.executable, "-m", "robospa.harness.cli.main", "submit", "verify", str(path)]
        done = subprocess.run([*command, "--evidence", str(evidence), *more, *words])
        if done.returncode:
            raise BundleError(f"{folder.name}: the bundle was not verified, as said above")
        with Archive(path) as archive:
            packed = to_card(parse_map(archive.read(layout.CARD), layout.CARD))
    found = parse_map(evidence.read_bytes(), str(evidence))
    valid = found.get("valid")
    if not isinstance(valid, dict) or valid.get("bundle") != announced.bundle:
        raise BundleError(f"{folder / BUNDLE} has the hash of another bundle")
    if packed != card:
        raise BundleError(f"{folder / ASKED} is not the bundle's model card")
    return found


class _SecureOnly(urllib.request.HTTPRedirectHandler):
    """Follows redirects to https only."""

    def redirect_request(self, *asked: Any) -> urllib.request.Request | None:
        if urlsplit(asked[-1]).scheme != "https":
            raise BundleError("the bundle's address leads to another one that is not https")
        return super().redirect_request(*asked)


def fetch(address: str, path: Path, size: int) -> None:
    """Download `address` to `path`; BundleError unless it has exactly `size` bytes."""
    got = 0
    try:
        opener = urllib.request.build_opener(_SecureOnly)
        with opener.open(address, timeout=SECONDS) as answer, path.open("wb") as file:
            while got <= size and (block := answer.read(min(BLOCK, size + 1 - got))):
                got += len(block)
                file.write(block)
    except (OSError, ValueError) as error:
        raise BundleError(f"the bundle cannot be downloaded from {address}: {error}") from None
    if got != size:
        raise BundleError(f"{address} has {'more' if got > size else got} bytes, not {size}")


def main(words: Sequence[str]) -> int:
    """CHANGED ROOT EVIDENCE [CHALLENGE]: verify what the paths listed in a file hand in."""
    if len(words) not in (3, 4):
        print(main.__doc__, file=sys.stderr)
        return 2
    changed, root, out = map(Path, words[:3])
    challenge = words[3] if len(words) == 4 else None
    try:
        names = submitted(changed.read_text(encoding="utf-8", errors="replace").splitlines())
        for name in names:
            print(f"submission {name}")
            (out / name).mkdir(parents=True, exist_ok=True)
            check(root / HOME / name, out / name / EVIDENCE, challenge)
    except BundleError as error:
        print(f"refused: {error}", file=sys.stderr)
        return 1
    print(f"{len(names)} verified" if names else "no submission is handed in")
    return 0
