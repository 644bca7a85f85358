"""What runs have used of what is paid for, summed from their records."""

import json
from typing import Any

from command_line import robospa
from fake_runs import make_run, trial_record

from robospa.results.run import load_run
from robospa.results.scoring.models import results_of_run
from robospa.results.scoring.usage import usage_table
from robospa.trial import TrialKey

USED = {"requests": 3, "repairs": 1, "input_tokens": 1000, "output_tokens": 50, "cost": 0.002}


def record(seed: int, **used: object) -> Any:
    more = {"diagnostics": {"usage": used}} if used else {}
    return trial_record(TrialKey("Task", 3, seed), category="GAC", **more)


def test_a_run_sums_what_its_trials_have_used_and_plans_with_it(tmp_path: Any) -> None:
    rows = [record(seed, **USED, seconds=3.6) for seed in range(10)]
    rows += [record(11), record(12, requests="many", cost=1)]
    made = make_run(tmp_path / "run", rows)
    table = usage_table([results_of_run(load_run(made.folder))])
    assert table and [row.label for row in table.rows] == ["GAC", "all"]
    texts = [cell.text for cell in table.rows[-1].cells]
    assert texts == ["11", "30", "10", "0", "10,000", "500", "1.0200", "0.01", "0", "0.0927"]
    done = robospa("compare", made.folder, "--power", "--tasks", "GAC", "--json")
    costs = json.loads(done.out)["costs"]
    assert len(costs) == 3 and "like these 11: " in costs[0]
    other = make_run(tmp_path / "other", [record(1)])
    assert usage_table([results_of_run(load_run(other.folder))]) is None
