"""`robospa view RUN TRIAL` and `robospa tasks NAME --view`: what they refuse, in one sentence."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

import pytest
from fake_runs import KNOWN, make_run

from robospa.harness.cli.main import main
from robospa.harness.viewer.show import trial_named
from robospa.results.records.manifest import RunError
from robospa.trial import TrialKey

SLUG = KNOWN[0].key.slug
TASK = KNOWN[0].key.task


def test_a_trial_goes_by_the_beginning_of_its_name(tmp_path: Path) -> None:
    run = make_run(tmp_path / "run", KNOWN)
    assert trial_named(run, SLUG).key == KNOWN[0].key
    short = f"{TASK}-L{KNOWN[0].key.level}-{KNOWN[0].key.seed}"
    assert trial_named(run, short).key == KNOWN[0].key
    with pytest.raises(RunError, match=f"trials are called '{TASK}'; they are {TASK}-L"):
        trial_named(run, TASK)
    with pytest.raises(RunError, match=r"no trial with a result is called 'Nothing'; there are \w"):
        trial_named(run, "Nothing")


def test_a_seed_is_no_beginning_of_another(tmp_path: Path) -> None:
    one = KNOWN[0]
    keys = [TrialKey(TASK, one.key.level, seed) for seed in (10, 100)]
    run = make_run(tmp_path / "run", [type(one)(**{**vars(one), "key": key}) for key in keys])
    assert trial_named(run, f"{TASK}-L{one.key.level}-10").key == keys[0]


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["view", "RUN", "--html", "a.html"], "--html needs a trial"),
        (["view", "RUN", SLUG, "--film"], "are of a run's page"),
        (["tasks", "--view"], "--view needs a task"),
    ],
)
def test_flags_that_do_not_go_together_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], words: list[str], sentence: str
) -> None:
    with pytest.raises(SystemExit) as stop:
        main([str(tmp_path) if word == "RUN" else word for word in words])
    assert stop.value.code == 2
    assert sentence in capsys.readouterr().err


@pytest.mark.skipif(find_spec("viser") is not None, reason="viser is installed here")
def test_without_viser_its_extra_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit) as stop:
        main(["view", str(make_run(tmp_path / "run", KNOWN).folder), SLUG])
    assert stop.value.code == 1
    assert "[view]'" in capsys.readouterr().err
