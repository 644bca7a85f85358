"""Replay: honest bundles hold, forgeries that pass level 1 do not, other builds are told apart."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from bundle_fakes import (
    CARD,
    PRESS,
    REFERENCE,
    Files,
    all_keys,
    claim_success,
    make_run,
    put_rows,
    rows_of,
    seal,
    zip_up,
)
from msgspec import structs

from robospa.action_space import quantize
from robospa.harness.trial import actions_digest
from robospa.leaderboard import bundle as layout
from robospa.leaderboard.bundle import BundleError
from robospa.leaderboard.evidence import check_challenge
from robospa.leaderboard.packing import pack
from robospa.leaderboard.replay import SampleReplay, judge, replay
from robospa.leaderboard.rules import Reference, manifest_of
from robospa.leaderboard.traces import decode, encode
from robospa.leaderboard.trial_rows import trace_hash
from robospa.leaderboard.verify import outcomes_of, results_of, scores_of, verify
from robospa.results.records.runs import Run, from_data

CHALLENGE = "a value nobody knew"


def replayed(path: Path, count: int, reference: Reference = REFERENCE) -> SampleReplay:
    return replay(verify(path, REFERENCE), CHALLENGE, count, reference)


def test_an_honest_bundle_replays_to_the_bit(honest: Path) -> None:
    made = replayed(honest, 40)
    assert made.evidence.holds and made.evidence.exact
    ends = {t.record.end for t in made.trials if t.record}
    assert ends == {"success", "step_limit", "policy_error"}
    assert made.evidence.identical == made.evidence.placed == 40 and made.evidence.most == 0
    assert made.evidence.same_kind


def test_another_build_with_the_same_outcomes_is_said_to_be_that(honest: Path) -> None:
    other = replace(REFERENCE, world="bundle_fakes:OtherBuild")
    made = replayed(honest, 5, other)
    assert made.evidence.holds and not made.evidence.exact
    assert made.evidence.agrees == 5


def test_objects_that_lie_elsewhere_are_refused(honest: Path) -> None:
    """By the median: one bottle that rolls away is no contradiction."""
    (trial, *_) = replayed(honest, 5).trials
    assert trial.record
    moved = {n: [x + 0.03, *rest] for n, (x, *rest) in trial.record.diagnostics["final"].items()}
    for final, apart in ((moved, 30.0), ({}, 1e6), ("nowhere", 1e6)):
        diagnostics = {**trial.record.diagnostics, "final": final}
        found = judge(replace(trial.record, diagnostics=diagnostics), trial.record)
        assert found.apart == pytest.approx(apart) and found.kind == "identical"
    evidence = replayed(honest, 5).evidence
    assert structs.replace(evidence, most=300.0, median=19.0).holds
    assert not structs.replace(evidence, median=21.0).holds


def test_other_things_that_were_chosen_first_are_not_left_out(honest: Path) -> None:
    """No field of a record has them, and models are ranked by what follows from them."""
    (trial, *_) = (t.record for t in replayed(honest, 40).trials if t.record and t.record.success)
    wrong = {**trial.events[0], "kind": "wrong_object", "object": "other"}
    held = {**trial.events[0], "kind": "subtask_done", "time": 0.0, "index": 1}
    for event, words in ((wrong, "first choice"), (held, "subtasks at the start")):
        found = judge(trial, replace(trial, events=(event, *trial.events)))
        assert (found.kind, found.differs) == ("different", (words,))


def test_an_end_that_comes_earlier_is_the_same_outcome(honest: Path) -> None:
    (trial, *_) = (t.record for t in replayed(honest, 5).trials if t.record and t.record.success)
    again = replace(trial, steps=trial.steps - 1, actions_digest="other", digest="other")
    assert judge(trial, again).kind == "agrees"
    assert judge(trial, replace(again, done=trial.done - 1)).kind == "different"


def test_another_physics_does_not_hold(honest: Path) -> None:
    other = replace(REFERENCE, world="bundle_fakes:OtherPhysics")
    made = replayed(honest, 40, other)
    assert not made.evidence.holds
    assert "First difference" in made.sentences()[-1]


def test_a_world_that_does_not_start_is_one_sentence(honest: Path) -> None:
    other = replace(REFERENCE, world="run_fakes:Broken")
    with pytest.raises(BundleError, match="robospa check"):
        replayed(honest, 2, other)


def forge(files: Files, change: Any) -> Files:
    """Change what ended at its limit, and make everything that level 1 looks at follow from it."""
    rows = rows_of(files)
    for row in rows:
        if row["record"]["end"] == "step_limit":
            change(row)
    put_rows(files, rows)
    records = [from_data(row["record"]) for row in rows]
    manifest = manifest_of(json.loads(files[layout.RUN]))
    run = Run(Path("forged"), manifest, manifest.keys, {r.key: r for r in records})
    files[layout.SCORES] = layout.canonical(scores_of(run))
    files[layout.OUTCOMES] = layout.canonical(outcomes_of(run))
    return seal(files)


def test_outcomes_forged_with_all_hashes_are_caught(files: Files, tmp_path: Path) -> None:
    path = zip_up(tmp_path / "b.zip", forge(files, claim_success))
    made = replayed(path, 40)
    assert not made.evidence.holds
    assert made.evidence.different == 8
    wrong = {name for trial in made.trials for name in trial.differs}
    assert wrong == {"success", "first choice", "done", "best", "end"}


def test_actions_of_another_task_forged_with_all_hashes_are_caught(
    files: Files, tmp_path: Path
) -> None:
    name = layout.actions_name(PRESS, 1)
    traces = [quantize(0.5 * trace) for trace in decode(files[name], name)]
    files[name] = encode(traces)
    rows = rows_of(files)
    own = [r for r in rows if from_data(r["record"]).key.variant == (PRESS, 1)]
    for row, trace in zip(own, traces, strict=True):
        row["trace"] = trace_hash(trace)
        row["record"]["actions_digest"] = actions_digest(list(trace))
    put_rows(files, rows)
    made = replayed(zip_up(tmp_path / "b.zip", seal(files)), 40)
    assert not made.evidence.holds
    assert {t.key.variant for t in made.trials if t.kind == "different"} == {(PRESS, 1)}


def in_track(folder: Path, action: str) -> Path:
    """A bundle whose policy says that it answers in `action`s, which were executed as joints."""

    def change(settings: dict[str, Any], about: dict[str, Any]) -> None:
        settings["policy"]["spec"] |= {"action": action, "horizon": None, "execute": None}

    run = make_run(folder / "run", all_keys(), change=change)
    card = structs.replace(CARD, actions=structs.replace(CARD.actions, space=action))
    pack([run], card, folder / "bundle.zip", REFERENCE)
    return folder / "bundle.zip"


def test_skills_are_verified_and_replayed_as_the_joints_they_became(tmp_path: Path) -> None:
    path = in_track(tmp_path, "skill")
    made = replayed(path, 10)
    assert made.evidence.holds and made.evidence.exact
    valid = verify(path, REFERENCE)
    kept = results_of("it", outcomes_of(valid.run), valid.run.manifest)
    assert kept.setting.track == ("skills",)


def test_points_move_nothing_and_enter_no_board(tmp_path: Path) -> None:
    with pytest.raises(BundleError, match="'action' must be one of joint, ee, delta_ee, skill, n"):
        in_track(tmp_path, "point")


def test_a_challenge_that_can_be_guessed_is_refused() -> None:
    check_challenge("12345678")
    with pytest.raises(BundleError, match="challenge"):
        check_challenge(" 1234567 ")
