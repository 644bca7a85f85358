"""`robospa submit` from the outside: a fake world, real workers, a real server."""

import hashlib
import json
from pathlib import Path

import pytest
from bundle_fakes import CARD_TEXT as CARD
from bundle_fakes import FAKES, PICK, REFERENCE, SEEDS, Idle, Weak, make_run
from command_line import Done, robospa
from msgspec import to_builtins
from run_fakes import FakePolicy, KeyedPolicy, other, parts
from site_fakes import REPLAYED, make_valid, of_bundle

from robospa.harness.running.evaluate import evaluate
from robospa.harness.running.request import make_request
from robospa.harness.settings import EvaluationSettings, updated
from robospa.leaderboard.commands import scene_progress
from robospa.leaderboard.reproduce import FIRST, Block, write_block
from robospa.leaderboard.verify import verify
from robospa.protocol.server import ServerThread
from robospa.results.records.manifest import RunError
from robospa.results.records.runs import read_run
from robospa.trial import TrialKey

pytestmark = pytest.mark.usefixtures("world_asked_here")

TEXTS = (".json", ".jsonl", ".toml", ".log")


def submit(*words: str | Path) -> Done:
    return robospa("submit", *words)


@pytest.fixture(scope="module")
def packed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("submit")
    make_run(folder / "run", [TrialKey(PICK, level, s) for level in (1, 2) for s in SEEDS])
    (folder / "model.toml").write_text(CARD)
    return folder


def pack(packed: Path, bundle: Path, *words: str) -> Done:
    told = ["--model", packed / "model.toml", "-o", bundle, "--practice"]
    done = submit("pack", packed / "run", *told, *FAKES, *words)
    assert done.code == 0, done.err
    return done


def packed_for_practice(packed: Path, bundle: Path) -> Path:
    pack(packed, bundle, "--no-videos")
    return bundle


def reproduced(bundle: Path, url: str, out: Path, *words: str | Path) -> Done:
    return submit("reproduce", bundle, url, "--out", out, "--practice", *FAKES, *words)


def hidden_block(folder: Path, count: int) -> tuple[Block, list[str | Path]]:
    """`count` hidden seeds of both levels, with the words that name their file."""
    hidden = tuple(FIRST + n for n in range(count))
    block = Block({f"{PICK}/{level}": hidden for level in (1, 2)}, "ab" * 32)
    write_block(block, folder / "block.json")
    return block, ["--block", folder / "block.json", "--commitment", block.commitment]


def test_from_run_to_badge(packed: Path) -> None:
    bundle = packed / "bundle.zip"
    done = pack(packed, bundle)
    assert "8 trials" in done.out and "bundle " in done.out

    done = submit("verify", bundle, *FAKES)
    assert done.code == 1
    assert done.err.startswith("robospa: the bundle was packed for practice")
    assert len(done.err.strip().splitlines()) == 1

    found = packed / "evidence.json"
    more = ["--practice", "--challenge", "0123456789abcdef", "--fraction", "1", "--workers", "2"]
    done = submit("verify", bundle, *more, "--evidence", found, *FAKES)
    assert done.code == 0, done.err
    assert "valid: 8 trials of 2 variants" in done.out
    assert "replayed: 8 of 8 trials were played again: 8 with the same outcome, 8" in done.out
    assert "8/8 trials" in done.err and "if some were invented: 100.0 %" in done.out
    evidence = json.loads(found.read_text())
    assert evidence["replayed"]["identical"] == 8
    done = submit("verify", bundle, "--practice", "--json", *FAKES)
    told = json.loads(done.out)
    assert done.code == 0 and told == {"holds": True, "valid": evidence["valid"]}
    assert "valid: 8 trials" in done.err
    (one,) = json.loads(pack(packed, packed / "told.zip", "--json").out)
    assert one["path"] == str(packed / "told.zip") and one["evidence"]["trials"] == 8
    assert one["bytes"] == (packed / "told.zip").stat().st_size == bundle.stat().st_size
    assert evidence["valid"]["bundle"] in done.out


@pytest.mark.parametrize(
    ("words", "refusal"),
    [
        (["--challenge", "abcdef"], "the challenge has fewer than 8 characters"),
        (["--challenge", "0123456789", "--fraction", "0"], "the fraction 0 is not above 0"),
    ],
)
def test_a_bad_challenge_is_refused_before_any_work(
    tmp_path: Path, words: list[str], refusal: str
) -> None:
    done = submit("verify", tmp_path / "no-such.zip", *words)
    assert done.code == 1 and done.out == ""
    assert done.err.startswith(f"robospa: {refusal}")


def test_hidden_seeds_run_against_a_server(packed: Path) -> None:
    bundle = packed_for_practice(packed, packed / "again.zip")
    block, told = hidden_block(packed, 5)
    with ServerThread(policy_factory=Weak) as server:
        more = [*told, "--evidence", packed / "hidden.json"]
        done = reproduced(bundle, server.url, packed / "fresh", *more)
    assert done.code == 0, done.err
    assert "agrees, but earns no badge: 8 of 10 fresh trials succeeded" in done.out
    assert "A badge needs 95 % for 5 points." in done.out
    evidence = json.loads((packed / "hidden.json").read_text())["reproduced"]
    assert evidence["counts"]["sr"] == {f"{PICK}/{level}": [3, 4, 4, 5] for level in (1, 2)}
    assert evidence["commitment"] == block.commitment and evidence["trials"] == 10
    assert evidence["bundle"] == verify(bundle, REFERENCE, practice=True).manifest.bundle
    manifest = (packed / "fresh" / "run.json").read_text()
    assert hashlib.sha256(block.salt.encode()).hexdigest() in manifest
    said = [p.read_text() for p in (packed / "fresh").rglob("*") if p.suffix in TEXTS]
    assert len(said) > 2 and not any(block.salt in text for text in said)
    scenes = {r.scene_digest for r in read_run(packed / "fresh").records.values()}
    assert scenes == {parts(k, block.salt).scene.digest for k in read_run(packed / "fresh").keys}
    with ServerThread(policy_factory=Weak) as server:  # the salt is needed again to resume
        done = reproduced(bundle, server.url, packed / "fresh", *told, "--resume", "--json")
        assert done.code == 0, done.err
        assert json.loads(done.out) == {"holds": True, "badge": False, "reproduced": evidence}
        open_block = Block(block.seeds, "cd" * 32)
        write_block(open_block, packed / "other.json")
        other = ["--block", packed / "other.json", "--commitment", open_block.commitment]
        done = reproduced(bundle, server.url, packed / "fresh", *other, "--resume")
    assert done.code == 1 and "salt_sha256" in done.err


def test_a_server_that_asks_for_the_key_gets_no_hidden_scene(packed: Path, tmp_path: Path) -> None:
    key = TrialKey(PICK, 1, FIRST)
    fakes = {"world": "bundle_fakes:World", "parts": "run_fakes:parts", "workers": 1}
    with ServerThread(policy_factory=KeyedPolicy) as server:
        for policy, words in ((server.url, "the key of every trial"), ("hold", "in the process")):
            asked = {"policy": policy, "out": tmp_path / "run", **fakes}
            settings = updated(EvaluationSettings(), asked)
            with pytest.raises(RunError, match=words):
                evaluate(make_request(settings, keys=[key], salt="ab" * 32))
    assert not (tmp_path / "run").exists()


def test_inflated_numbers_are_not_reproduced(packed: Path, tmp_path: Path) -> None:
    """6 of 8 claimed, 0 of 16 afresh: p = 2 (4/220)^2, C(4, 3) of C(12, 3) for each level."""
    bundle = packed_for_practice(packed, tmp_path / "b.zip")
    _, told = hidden_block(tmp_path, 8)
    with ServerThread(policy_factory=Idle) as server:
        done = reproduced(bundle, server.url, tmp_path / "fresh", *told)
    assert done.code == 1
    assert "NOT REPRODUCED: 0 of 16 fresh trials succeeded" in done.out
    assert f"two-sided p = {2 * (4 / 220) ** 2:.3g})" in done.out


def test_another_server_than_the_bundles_is_refused(packed: Path, tmp_path: Path) -> None:
    bundle = packed_for_practice(packed, tmp_path / "b.zip")
    _, told = hidden_block(tmp_path, 1)
    assert FakePolicy().spec != other().spec
    with ServerThread(policy_factory=other) as server:
        done = reproduced(bundle, server.url, tmp_path / "fresh", *told)
    assert done.code == 1
    assert "is not the one of the bundle: name: 'fake' -> 'other'" in done.err
    assert not (tmp_path / "fresh").exists()


def test_the_template_is_printed() -> None:
    assert "[checkpoints." in submit("template").out


def test_large_bundles_show_how_far_their_scenes_are(capsys: pytest.CaptureFixture[str]) -> None:
    show = scene_progress()
    for count in range(100, 2001, 100):
        show(count, 2000)
    *most, last = capsys.readouterr().err.splitlines()
    assert len(most) == 9 and last == "scenes made again: 2000 of 2000"
    scene_progress()(8, 8)
    assert capsys.readouterr().err == ""


def test_evidence_of_another_bundle_adds_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("robospa.leaderboard.rules.shipped", lambda world, parts: REFERENCE)
    valid, path, home = make_valid(tmp_path), tmp_path / "evidence.json", tmp_path / "home"
    words = ["leaderboard", "add", valid.path, "--evidence", path, "--submissions", home, *FAKES]
    path.write_text(json.dumps({"valid": {"bundle": "0"}, "replayed": REPLAYED}))
    done = robospa(*words)
    assert done.code == 1 and "of another bundle" in done.err and not home.exists()
    replayed = of_bundle(valid, REPLAYED)
    path.write_text(json.dumps({"valid": to_builtins(valid.evidence), "replayed": replayed}))
    assert robospa(*words).out.startswith("Submission: ")
    assert (home / "fake-1" / "model.json").is_file()
    told = json.loads(robospa(*words, "--name", "again", "--json").out)
    assert told["submission"] == str(home / "again")
    assert told["evidence"]["bundle"] == valid.evidence.bundle


def test_a_broken_submission_stops_the_build_before_anything_is_written(tmp_path: Path) -> None:
    (tmp_path / "home" / "empty").mkdir(parents=True)
    words = ["leaderboard", "build", "--submissions", tmp_path / "home", "--out", tmp_path / "site"]
    done = robospa(*words)
    assert done.code == 1 and "manifest.json cannot be read" in done.err
    assert not (tmp_path / "site").exists()
