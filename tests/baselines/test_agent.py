"""The agent: what it asks an endpoint, whose fault a missing answer is, and what is counted."""

import json
import time
from collections.abc import Iterator
from dataclasses import replace
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scripted_endpoint import AWAY, BAD, ScriptedEndpoint, Shown, by_colour

import robospa
from robospa.baselines.agent import endpoint as module
from robospa.baselines.agent.endpoint import Away, EndpointError
from robospa.baselines.agent.policy import Agent, AgentOptions, Agents, read_answer
from robospa.protocol.client import connect
from robospa.protocol.errors import PolicyAnswerError, PolicyError
from robospa.protocol.options import read_options
from robospa.protocol.policy import USAGE, TrialInfo
from robospa.protocol.server import ServerThread
from robospa.results.scoring.models import results_of_run
from robospa.results.scoring.usage import usage_table

TRIAL = TrialInfo("Pick_Blocks_Size", "aloha-agilex", "pick the largest block", id="abc")
KEY = "sk-not-to-be-seen"
PICK = {"skill": "pick", "at": [0.25, 0.5], "camera": "head"}


@pytest.fixture(autouse=True)
def short_pauses(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "FIRST_PAUSE", 0.01)


def model(shown: Shown) -> list[dict[str, Any]]:
    return [PICK]


@pytest.fixture
def scripted() -> Iterator[ScriptedEndpoint]:
    with ScriptedEndpoint(model) as endpoint:
        yield endpoint


def agent(endpoint: ScriptedEndpoint, **given: Any) -> Agent:
    options = AgentOptions(endpoint=endpoint.url, model="scripted", width=16, height=12)
    made = Agents(replace(options, **given))()
    made.reset(TRIAL)
    return made


def seen(step: int = 0, calls: Any = (), grey: int = 0) -> Any:
    images = {"head": np.full((12, 16, 3), grey, np.uint8)}
    return {"images": images, "instruction": "", "step": step, "calls": list(calls)}


@pytest.mark.parametrize("kind", [*AWAY, "slow"])
def test_an_endpoint_that_is_away_is_asked_again_until_the_deadline(
    scripted: ScriptedEndpoint, kind: str
) -> None:
    asked = agent(scripted, deadline=1.0)
    scripted.wrong, scripted.share = (kind,), 1.0
    with pytest.raises(Away, match=scripted.url):
        asked.infer(seen())
    assert asked.last_timing["unanswered"] > (kind != "slow") and asked.last_timing["requests"] == 0
    scripted.share = 0.0
    asked._endpoint._free = 0.0
    assert asked.infer(seen()) == [PICK]


@pytest.mark.parametrize("kind", BAD)
def test_an_answer_that_is_no_list_of_calls_is_mended_twice_and_then_an_error(
    scripted: ScriptedEndpoint, kind: str
) -> None:
    asked = agent(scripted)
    scripted.wrong, scripted.share = (kind,), 1.0
    with pytest.raises(PolicyAnswerError, match="scripted gave 3 answers in a row"):
        asked.infer(seen())
    assert (asked.last_timing["requests"], asked.last_timing["repairs"]) == (3, 3)
    assert [asked.last_timing[f"{way}_tokens"] for way in ("input", "output")] == scripted.tokens
    assert b"Your last answer cannot be used: " in scripted.last


def test_a_pause_that_the_endpoint_asks_for_is_kept_by_all(scripted: ScriptedEndpoint) -> None:
    assert module._retry_after({"retry-after": "7"}) == 7.0
    for text in ("", "soon", "-1", "nan", "inf", "Wed, 01 Jan 2070 00:00:00 GMT"):
        assert module._retry_after({"retry-after": text}) == 0.0
    first = agent(scripted, deadline=0.1)
    first._endpoint._free = time.monotonic() + 60.0
    with pytest.raises(Away, match="be asked again in 60 s"):
        first.infer(seen())
    assert scripted.log == []


def test_a_question_has_the_calls_their_feedback_notes_and_old_pictures(
    scripted: ScriptedEndpoint,
) -> None:
    asked = agent(scripted, memory=2, form="tools", extra='{"temperature": 0}')
    scripted.tools, done = True, []
    for step in range(5):
        done += [{"skill": "pick", "at": [0.2, 0.1 * step], "feedback": "nothing there"}]
        asked.infer(seen(step, done, grey=step))
    body = json.loads(scripted.last)
    assert body["temperature"] == 0 and body["tools"][0]["function"]["name"] == "act"
    parts = body["messages"][1]["content"]
    texts = "\n".join(part.get("text", "") for part in parts)
    assert [line for line in texts.splitlines() if line.startswith("Earlier")] == [
        "Earlier, after 1 calls:",
        "Earlier, after 4 calls:",
    ]
    assert '5. {"skill": "pick", "at": [0.2, 0.4], "feedback": "nothing there"}' in texts
    assert "Your notes:\nseen 1\n" in texts and texts.startswith("The task: pick the largest")
    assert len([part for part in parts if part["type"] == "image_url"]) == 3


@pytest.mark.parametrize("bound", [{"most_requests": 2}, {"most_cost": 0.01, "price_out": 3.0}])
def test_a_trial_that_has_used_up_what_it_may_use_is_done(
    scripted: ScriptedEndpoint, bound: dict[str, Any]
) -> None:
    """Of money a longest answer of 2000 tokens is held back: 0.006."""
    asked = agent(scripted, **bound)
    found = [asked.infer(seen(step))[0]["skill"] for step in range(3)]
    if "most_cost" in bound:
        asked._trial.used["cost"] = 0.0041  # type: ignore[union-attr]
        found = [*found[:2], asked.infer(seen(3))[0]["skill"]]
    assert found == ["pick", "pick", "done"] and asked.last_timing["exhausted"] == 1
    asked.reset(TRIAL)  # another attempt may use as much
    assert asked.infer(seen())[0]["skill"] == "pick"


def test_what_lost_attempts_have_used_is_in_the_next_one(scripted: ScriptedEndpoint) -> None:
    agents = Agents(AgentOptions(endpoint=scripted.url, model="scripted"))
    for attempt in (1, 2):
        one = agents()
        one.reset(TRIAL)
        one.infer(seen())
        assert one.last_timing["requests"] == attempt
    (lost := agents()).reset(TRIAL)
    one.end({})
    assert lost.infer(seen()) == [PICK]  # its connection may have lost the trial, or be another run
    one.reset(TRIAL)
    assert set(one.last_timing.values()) == {0}


def test_the_key_is_in_no_error_and_no_greeting(
    scripted: ScriptedEndpoint, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: Any
) -> None:
    monkeypatch.setenv("SECRET", KEY)
    options = AgentOptions(endpoint=scripted.url, model="scripted", key="SECRET", log=tmp_path)
    agents = Agents(replace(options, deadline=0.5, width=16, height=12))
    scripted.key = f"{KEY}?"
    with ServerThread(policy_factory=agents) as server, connect(server.url) as remote:
        assert KEY not in repr(remote.hello)
        with pytest.raises(Away) as caught:
            (one := agents()).reset(TRIAL)
            one.infer(seen())
    assert "401" in str(caught.value) and "***?" in str(caught.value)
    assert KEY not in str(caught.value) + caplog.text
    scripted.key, one._endpoint._free = KEY, 0.0
    one.infer(seen())
    (noted,) = tmp_path.glob("*.jsonl")
    assert KEY not in noted.read_text() and len(list(tmp_path.glob("abc-0-head.png"))) == 1


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"model": ""}, "--endpoint URL --model M"),
        ({"model": "other"}, "has no model 'other'; it has scripted"),
        ({"endpoint": "http://127.0.0.1:9/v1"}, "start it first"),
        ({"endpoint": "http://me:word@127.0.0.1/v1"}, "holds a secret"),
        ({"extra": "[1]"}, "extra is no JSON object"),
        ({"cameras": "head,top"}, "must be one of head"),
    ],
)
def test_what_cannot_work_is_said_at_the_start(
    scripted: ScriptedEndpoint, given: dict[str, Any], words: str
) -> None:
    with pytest.raises(EndpointError, match=words):
        Agents(replace(AgentOptions(endpoint=scripted.url, model="scripted"), **given))


@pytest.mark.parametrize("given", ["deadline=0", "parallel=0", "max_tokens=0", "price_in=-1"])
def test_options_with_which_no_question_is_answered_are_refused(given: str) -> None:
    with pytest.raises(ValueError, match="and must be"):
        read_options(AgentOptions, dict([given.split("=")]))


def test_a_note_may_have_lines(scripted: ScriptedEndpoint) -> None:
    said = '{"note": "red is\nleft", "calls": [{"skill": "done"}]}'
    assert read_answer([said], agent(scripted).spec) == ("red is left", [{"skill": "done"}])


def test_of_200_trials_with_bad_answers_none_is_lost_or_scored_wrongly() -> None:
    """A fifth of all answers are wrong in one of 15 ways. A trial is a policy error if and only if
    the model gave three answers in a row that are no calls; tokens are right to the last one."""
    ends: dict[str, str] = {}
    sums = dict.fromkeys(USAGE, 0.0)
    with ScriptedEndpoint(model, AWAY + BAD, 0.2, seed=90) as scripted:
        options = AgentOptions(endpoint=scripted.url, model="scripted", width=16, height=12)
        made = Agents(replace(options, price_in=3.0, price_out=15.0))
        with ServerThread(policy_factory=made) as server, connect(server.url) as remote:
            for number in range(200):
                trial = replace(TRIAL, id=str(number), instruction=f"trial {number}")
                remote.reset(trial)
                try:
                    for step in range(2):
                        assert remote.infer(seen(step)) == [PICK]
                    ends[trial.instruction] = "done"
                except PolicyError:
                    ends[trial.instruction] = "policy_error"
                sums = {name: sums[name] + remote.last_timing[name] for name in sums}
                remote.end({})
        wrong = {name for name in ends if ["bad"] * 3 in _runs(scripted.log, name)}
        kinds = [kind for _, kind in scripted.log]
        tokens = [int(sums[f"{way}_tokens"]) for way in ("input", "output")]
    assert len(ends) == 200 and {n for n, end in ends.items() if end == "policy_error"} == wrong
    assert set(kinds) == {"good", *AWAY, *BAD} and len(wrong) == 3
    assert tokens == scripted.tokens
    assert sums["cost"] == pytest.approx((3 * tokens[0] + 15 * tokens[1]) / 1e6, rel=1e-9)
    assert sums["requests"] + sums["unanswered"] == len(kinds)
    assert sums["repairs"] == sum(kind in BAD for kind in kinds)


def _runs(log: list[tuple[str, str]], name: str) -> list[list[str]]:
    """Answers in a row about trial `name` that are good, or bad; those that were away left out."""
    kinds = ["bad" if kind in BAD else kind for said, kind in log if said == name]
    return [list(run) for _, run in groupby(kind for kind in kinds if kind not in AWAY)]


@pytest.mark.sim
def test_a_model_that_goes_by_pixels_solves_trials_whatever_its_endpoint_does(
    tmp_path: Path,
) -> None:
    with ScriptedEndpoint(by_colour, AWAY + BAD, 0.3, seed=2) as scripted:
        made = Agents(AgentOptions(endpoint=scripted.url, model="scripted", price_out=15.0))
        with ServerThread(policy_factory=made) as server:
            run = robospa.evaluate(
                server.url, tasks="Basic_Color_Blocks", levels=1, trials=6, workers=1, out=tmp_path
            )
    records = list(run.records.values())
    used = [record.diagnostics["usage"] for record in records]
    assert len(records) == 6 and sum(one["unanswered"] for one in used) > 0
    assert [r.success for r in records] == [one["repairs"] < 3 for one in used]
    assert sum(one["repairs"] for one in used) == sum(kind in BAD for _, kind in scripted.log) > 0
    assert [
        sum(one[f"{way}_tokens"] for one in used) for way in ("input", "output")
    ] == scripted.tokens
    table = usage_table([results_of_run(run)])
    assert table is not None
    assert table.rows[-1].cells[4].text == f"{scripted.tokens[0]:,}"
