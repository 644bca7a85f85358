"""What continuous integration asks of a pull request that submits: one folder, two files, a bundle.

The pull request is read as data: nothing that it brings is run. The bundle is downloaded, or copied
from the folder, as far as its announced size, verified by `robospa submit verify`, and held against
the two files. All else is refused, in one sentence.
"""

import shutil
import subprocess
import sys
import tempfile
import urllib.request
from collections.abc import Callable, Sequence
from pathlib import Path, PurePosixPath
from typing import Any
from urllib.parse import urlsplit

from robospa.leaderboard import bundle as layout
from robospa.leaderboard.bundle import IN_REPOSITORY, BundleArchive, BundleError, parse_map
from robospa.leaderboard.card import check_folder, read_card, to_card
from robospa.leaderboard.submission import (
    ASKED,
    BUNDLE,
    EVIDENCE,
    HANDED_IN,
    SLUG,
    check_recipes,
    check_weights,
    read_announced,
    size_of,
)

HOME = PurePosixPath("leaderboard/submissions")
README = str(HOME / "README.md")
DIFF = "git diff --name-status --no-renames -z"
ADDED = "A"
STATUSES = {ADDED: "adds", "D": "deletes", "M": "changes", "T": "changes the type of"}
"""What that command can say of a file; "T" is a file that became a link, for one."""
BLOCK = 1 << 20
SECONDS = 60.0
"""The longest wait for the next bytes of a download."""
Fetch = Callable[[str, Path, int], None]


Change = tuple[str, str]
"""A changed file: git's letter, A for an addition, and its path."""


def read_changes(data: bytes) -> list[Change]:
    """The changes in the output of `git diff --name-status --no-renames -z`.

    BundleError for any other: renames would hide what they take away, and without `-z` git quotes
    the names that it finds unusual.
    """
    words = data.decode("utf-8", "replace").split("\0")
    if words.pop() or len(words) % 2:
        raise BundleError(f"the list of changed files is not what `{DIFF}` writes")
    changes = list(zip(words[::2], words[1::2], strict=True))
    if strange := [status for status, path in changes if status not in STATUSES or not path]:
        raise BundleError(
            f"the list of changed files has the status {strange[0][:20]!a}, which "
            f"`{DIFF}` does not write"
        )
    return changes


def submitted(changes: Sequence[Change]) -> list[str]:
    """Names of the submissions that the `changes` hand in; [] if none.

    BundleError if they touch a submission and anything else, change or delete a file, bring other
    files than these, or take a name that is not free.
    """
    own = [(s, p) for s, p in changes if HOME in PurePosixPath(p).parents and p != README]
    if own and (strange := [path for status, path in changes if (status, path) not in own]):
        raise BundleError(
            f"a submission adds a folder below {HOME} and changes nothing else; this one also "
            f"changes {strange[0][:120]!a}"
        )
    names = set[str]()
    for status, path in own:
        if status != ADDED:
            raise BundleError(
                f"a submission only adds files; this one {STATUSES[status]} {path[:120]!a}"
            )
        place = PurePosixPath(path).relative_to(HOME).parts
        if len(place) != 2 or not SLUG.fullmatch(place[0]) or place[1] not in HANDED_IN:
            raise BundleError(
                f"{path[:120]!a} is not {HOME}/NAME/{ASKED}, {BUNDLE} or {IN_REPOSITORY}, NAME "
                "being of small letters, digits and hyphens"
            )
        check_folder(place[0])
        names.add(place[0])
    return sorted(names)


def check(
    folder: Path,
    evidence: Path,
    challenge: str | None = None,
    words: Sequence[str] = (),
    get: Fetch | None = None,
    clone: Path = Path(),
) -> dict[str, object]:
    """Verify the bundle of the submission in `folder` and return the evidence, also written.

    With `challenge` a sample is replayed, too: all trials of a bundle that lies in the folder.
    `words` go to `robospa submit verify`, whose output is passed on. `clone` is where this
    repository is, whose recipes a card may name. Raises BundleError.
    """
    there = {path.name for path in folder.iterdir()} if folder.is_dir() else set()
    if not {ASKED, BUNDLE} <= there or any((folder / name).is_symlink() for name in there):
        raise BundleError(f"{folder} does not hold {ASKED} and {BUNDLE} as plain files")
    announced, card = read_announced(folder), read_card(folder / ASKED)
    if there != announced.files:
        listed = ", ".join(sorted(announced.files))
        raise BundleError(f"{folder} does not hold the files {listed}, and only them")
    check_recipes(card, clone)
    with tempfile.TemporaryDirectory() as place:
        path = Path(place) / "bundle.zip"
        more = ["--challenge", challenge] if challenge else []
        if announced.address == IN_REPOSITORY:
            check_weights(card, folder.name)
            if (size := size_of(folder)) != announced.size:
                raise BundleError(
                    f"{folder / IN_REPOSITORY} has {size} bytes, not {announced.size}"
                )
            shutil.copyfile(folder / IN_REPOSITORY, path)
            more += ["--fraction", "1"] if challenge else []
        else:
            (get or fetch)(announced.address, path, announced.size)
        command = [sys.executable, "-m", "robospa.harness.cli.main", "submit", "verify", str(path)]
        done = subprocess.run([*command, "--evidence", str(evidence), *more, *words])
        if done.returncode:
            raise BundleError(f"{folder.name}: the bundle was not verified, as said above")
        with BundleArchive(path) as archive:
            packed = to_card(archive.read_map(layout.CARD))
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
    """CHANGED ROOT EVIDENCE [CHALLENGE]: verify what the changes listed in a file hand in."""
    if len(words) not in (3, 4):
        print(main.__doc__, file=sys.stderr)
        return 2
    changed, root, out = map(Path, words[:3])
    challenge = words[3] if len(words) == 4 else None
    try:
        names = submitted(read_changes(changed.read_bytes()))
        for name in names:
            print(f"submission {name}")
            (out / name).mkdir(parents=True, exist_ok=True)
            check(root / HOME / name, out / name / EVIDENCE, challenge)
    except BundleError as error:
        print(f"refused: {error}", file=sys.stderr)
        return 1
    print(f"{len(names)} verified" if names else "no submission is handed in")
    return 0
