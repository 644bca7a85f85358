"""Pack a bundle of the repository again from its own records, as after a change of its form.

    python tools/repack_submission.py leaderboard/submissions/NAME

Scores, outcomes and tables are made anew; records, actions, films and the card stay. The new bundle
is verified, and the folder is completed as `robospa leaderboard add` does it. As every record and
every action is held against the old bundle's, to the bit, what was found by replaying those counts
for the new one. Nothing is replaced before all of that holds. To replay it here as well:

    robospa submit verify leaderboard/submissions/NAME/bundle.zip --challenge VALUE --fraction 1
"""

from __future__ import annotations

import shutil
import sys
import tempfile
from pathlib import Path

from robospa.leaderboard import bundle as layout
from robospa.leaderboard.bundle import BundleArchive, parse_map
from robospa.leaderboard.card import to_card
from robospa.leaderboard.packing import write_bundle
from robospa.leaderboard.rules import manifest_of, shipped
from robospa.leaderboard.submission import ASKED, BUNDLE, EVIDENCE, add
from robospa.leaderboard.traces import Trace, decode
from robospa.leaderboard.trial_rows import TrialRow, read_rows
from robospa.leaderboard.verify import verify
from robospa.results.records.runs import Run
from robospa.trial import TrialKey


def rewritten(old: Path, new: Path) -> dict[TrialKey, TrialRow]:
    """Write the bundle `old` to `new` in the present form; the rows of both."""
    with BundleArchive(old) as archive:
        run = manifest_of(archive.read_map(layout.RUN))
        first = str(archive.read_map(layout.MANIFEST)["inputs"])
        lines = archive.read(layout.RECORDS).splitlines()
        rows: dict[TrialKey, TrialRow] = {
            record.key: (record, trace)
            for record, trace, _ in read_rows(lines, first, layout.RECORDS)
        }
        stored: dict[TrialKey, Trace] = {}
        for variant in dict.fromkeys(key.variant for key in rows):
            keys = [key for key in rows if key.variant == variant]
            name = layout.actions_name(*variant)
            stored.update(zip(keys, decode(archive.read(name), name), strict=True))
        films = {name: archive.read(name) for name in archive.sizes if name.endswith(".mp4")}
        card = to_card(archive.read_map(layout.CARD))
    whole = Run(old.parent, run, tuple(rows), {key: record for key, (record, _) in rows.items()})
    write_bundle(new, whole, card, stored.__getitem__, films)
    return rows


def repack(folder: Path) -> str:
    """Pack the bundle in `folder` again and complete the folder; its new hash."""
    found = parse_map((folder / EVIDENCE).read_bytes(), EVIDENCE)
    with tempfile.TemporaryDirectory(dir=folder.parent, prefix=".repacked-") as place:
        made = Path(place) / folder.name
        made.mkdir()
        path = made / layout.IN_REPOSITORY
        rows = rewritten(folder / layout.IN_REPOSITORY, path)
        valid = verify(path, shipped())
        records = valid.run.records
        same = {key: (records[key], valid.traces[key]) for key in records}
        assert same == rows, "a record or an action is another"
        bundle = valid.manifest.bundle
        kept = {name: part for name, part in found.items() if name in ("replayed", "reproduced")}
        evidence = {n: {**p, "bundle": bundle} for n, p in kept.items() if isinstance(p, dict)}
        shutil.copy(folder / ASKED, made)
        words = (layout.IN_REPOSITORY, str(path.stat().st_size), bundle)
        (made / BUNDLE).write_text("".join(f"{word}\n" for word in words))
        add(valid, [evidence], Path(place), folder.name)
        shutil.rmtree(folder)
        made.rename(folder)
    return bundle


if __name__ == "__main__":
    print("bundle", repack(Path(sys.argv[1]).resolve()))
