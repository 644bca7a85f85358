"""A vision-language model as a policy of the action space "skill".

    robospa serve agent --endpoint http://127.0.0.1:8000/v1 --model NAME

Each query is one question without a history of messages: the skills, the sentence, all calls so far
with their feedback, the model's own notes, earlier pictures and those of now. So it costs about the
same at the end of a trial as at its start, and an endpoint keeps nothing of a trial. An answer that
is no list of calls is shown to the model with what is wrong with it, a few times; then the trial
ends as a policy error. A trial that has used up its requests, seconds or money ends with `done`.
"""

import base64
import io
import json
import logging
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from robospa.baselines.agent.endpoint import (
    Amount,
    BadAnswer,
    ChatEndpoint,
    EndpointError,
    EndpointOptions,
    Usage,
)
from robospa.extras import need
from robospa.observation import Observation
from robospa.protocol.calls import FIELDS, check_calls
from robospa.protocol.errors import DecodeError, PolicyAnswerError, printable
from robospa.protocol.options import option
from robospa.protocol.policy import CALLED, POINT, SKILL, USAGE, PolicySpec, TrialInfo
from robospa.schema import Count

log = logging.getLogger("robospa.agent")
Call = Mapping[str, object]
Message = dict[str, object]
LONGEST_NOTE, SHOWN = 500, 2000
"""Characters of a note, and of an answer that cannot be used, that the model gets back."""


WHAT = {
    "pick": "grasp the object there and lift it; the arm holds it until it is put down",
    "place": "put down what is held, on the table there or on the object there; offset moves the "
    "place by [right, away] metres, turn turns the thing by degrees anticlockwise",
    "drop": "let go of what is held above the container there",
    "press": "press the object there from above, once",
    "stamp": "take the stamp at `at` and stamp what is at `to`",
    "hit": "take the hammer at `at` and hit what is at `to`; to may be a list of points",
    "pour": "take what is at `at` and empty it into what is at `to`; the arm keeps it",
    "hang": "take what is at `at` and hang it on the hook at `to`",
    "dock": "take what is at `at` and set it into its holder at `to`",
    "open": "open the door or lid by the handle there",
    "raise_lower": "lift the object there and set it down again; arms: which ones",
    "handover": "pass what is held to the other arm",
    "wait": "hold still and watch",
    "home": "bring the arms out of the way",
    "done": "the task is done; nothing comes after it",
}
"""What a model is told of each skill of `FIELDS`."""
POINTS = """\
A point is [u, v]: u from 0 at the left edge of the picture to 1 at the right edge, v from 0 at the
top edge to 1 at the bottom edge. In the picture of the camera head, right is the right of a robot
that stands before the table, and up is away from it."""
LEADING = """\
You lead a robot with two arms at a table. You get a task and pictures, and answer with calls of
skills. The robot makes them one after the other; then you see what came of each, and new pictures.

{points} A point means the object that is drawn there, or the table there.
All points of an answer are in the pictures of now: do not plan further than they show.

Skills, the fields that each needs, and in brackets those that it may have:
{skills}
arm is "left" or "right"; left out, the robot chooses. Do only what is asked for: to touch a wrong
object counts against you. Write into "note" what you have to remember, such as what you see now and
will be hidden later; you get your notes back."""
POINTING = """\
You get a task for a robot, and a picture of its table. Answer with the one call "point", at a point
of the picture on the object that the robot has to take or press.

{points}"""
"""What a model is told at every question, in either space."""
FORM = '{"note": "...", "calls": [{"skill": "%s", "at": [0.5, 0.5]}]}'
"""An answer in text."""
ACT: Message = {
    "type": "object",
    "properties": {
        "note": {"type": "string"},
        "calls": {"type": "array", "items": {"type": "object"}},
    },
    "required": ["calls"],
}
TOOLS: Message = {
    "tools": [{"type": "function", "function": {"name": "act", "parameters": ACT}}],
    "tool_choice": "required",
}
"""An answer as a tool call."""


@dataclass(frozen=True)
class AgentOptions(EndpointOptions):
    """What the model sees, and what a trial may cost."""

    space: str = option(SKILL, "what it answers: calls of skills, or a point each", CALLED)
    cameras: str = option("head", "cameras whose pictures it gets: names with commas")
    width: Count = option(640, "pixels of a picture, across")
    height: Count = option(480, "pixels of a picture, down")
    memory: Count = option(3, "earlier pictures that it gets again: the first and the last ones")
    repairs: Count = option(2, "how often in a row it may mend an answer that is no list of calls")
    most_requests: Count = option(60, "answers of the model in a trial, at most")
    most_seconds: Amount = option(1800.0, "seconds of its answers in a trial, at most")
    most_cost: Amount = option(0.0, "cost of a trial at most, at the prices given; 0 for no limit")
    log: Path | None = option(None, "folder for a file per trial with all questions and answers")


@dataclass
class Sight:
    """Pictures of one instant by camera, PNG as base64, after so many actions and calls."""

    step: int
    calls: int
    pictures: dict[str, str]


@dataclass
class Trial:
    """What is known of the trial that goes on."""

    info: TrialInfo
    looks: list[Sight] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    bad: list[str] = field(default_factory=list)
    """The answers to the present question that cannot be used, and why."""
    used: Usage = field(default_factory=lambda: dict.fromkeys(USAGE, 0))
    """In this attempt."""
    largest: float = 0
    """The most input tokens that a question has had."""


class Agent:
    """One connection to a model that all connections share."""

    def __init__(
        self, options: AgentOptions, endpoint: ChatEndpoint, totals: dict[str, Usage]
    ) -> None:
        """`totals`: what trials have used so far in all attempts, by their ids."""
        self.options, self._endpoint, self._totals = options, endpoint, totals
        self.spec = spec_of(options)
        self._trial: Trial | None = None
        self._sums: Usage = {}

    def reset(self, trial: TrialInfo) -> None:
        """Forget the trial before."""
        self._trial = Trial(trial)
        self._sums = self._totals.setdefault(trial.id, dict.fromkeys(USAGE, 0))

    @property
    def last_timing(self) -> Mapping[str, float]:
        """What the trial has used, its earlier attempts included."""
        return {**self._sums}

    def infer(self, observation: Observation) -> list[dict[str, object]]:
        """The next calls. Raises PolicyAnswerError, and Away where the endpoint is."""
        trial = self._trial
        if trial is None:
            raise RuntimeError("the policy was asked for calls before a reset")
        made = list(observation.get("calls", ()))
        if not trial.looks or trial.looks[-1].step != observation["step"]:
            trial.looks.append(look(observation, len(made), self.spec))
        until = time.monotonic() + self.options.deadline
        while not self._used_up(trial):
            try:
                note, calls = self._asked(trial, made, until)
            except BadAnswer as error:
                if len(trial.bad) > self.options.repairs:
                    raise PolicyAnswerError(
                        f"{self.options.model} gave {len(trial.bad)} answers in a row that are no "
                        f"list of calls; of the last one: {error}"
                    ) from None
                continue
            trial.bad.clear()
            trial.notes.append(note)
            return calls
        self._count({"exhausted": 1})
        return [{"skill": "done"}]

    def end(self, outcome: Mapping[str, object]) -> None:
        """The trial is over, and what it has used is in its record."""
        if self._trial is not None:
            self._totals.pop(self._trial.info.id, None)

    def _asked(
        self, trial: Trial, made: Sequence[Call], until: float
    ) -> tuple[str, list[dict[str, object]]]:
        """Note and calls of one answer of the model; raises BadAnswer."""
        given = self.options
        used: Usage = dict.fromkeys(USAGE, 0)
        said, wrong = "", ""
        parts = question(trial, made, given)
        try:
            answer = self._endpoint.ask(request(parts, given), until, used)
            said = " ".join(answer)
            return read_answer(answer, self.spec)
        except BadAnswer as error:
            wrong = str(error)
            used["repairs"] += 1
            trial.bad.append(f"{wrong}\nIt was: {printable(said, SHOWN) or '(nothing)'}")
            raise
        finally:
            trial.largest = max(trial.largest, used["input_tokens"])
            self._count(used)
            if given.log is not None and used["requests"]:
                asked = [part["text"] for part in parts if "text" in part]
                line: Message = {"question": asked, "answer": said, "error": wrong}
                note_down(given.log, trial, {**line, "usage": used})

    def _count(self, used: Usage) -> None:
        assert self._trial is not None
        for sums in (self._trial.used, self._sums):
            sums.update({name: sums[name] + value for name, value in used.items()})

    def _used_up(self, trial: Trial) -> bool:
        """Whether this attempt has had all that it may use; of money, whether another answer as
        long as allowed might be more."""
        given, used = self.options, trial.used
        dearest = used["cost"] + given.price(trial.largest, given.max_tokens)
        return (
            used["requests"] >= given.most_requests
            or used["seconds"] >= given.most_seconds
            or (given.most_cost > 0 and dearest > given.most_cost)
        )


def spec_of(options: AgentOptions) -> PolicySpec:
    """What the agent reads and answers; raises EndpointError for cameras that cannot be."""
    size = {"width": options.width, "height": options.height}
    spec = {
        "name": f"agent:{printable(options.model, 190)}",
        "cameras": [{"name": name, **size} for name in options.cameras.split(",")],
        "state": "none",
        "action": options.space,
        "checkpoint": printable(options.model, 200),
    }
    try:
        return PolicySpec.from_json(spec)
    except DecodeError as error:
        raise EndpointError(f"the agent's {error}") from None


def look(observation: Observation, calls: int, spec: PolicySpec) -> Sight:
    """The pictures of `observation`."""
    found = {}
    for camera in spec.cameras:
        stream = io.BytesIO()
        need("PIL.Image", "agent").fromarray(observation["images"][camera.name]).save(stream, "PNG")
        found[camera.name] = base64.b64encode(stream.getvalue()).decode()
    return Sight(observation["step"], calls, found)


def question(trial: Trial, made: Sequence[Call], options: AgentOptions) -> list[Message]:
    """The parts of the question: texts and pictures, those of now last."""
    *earlier, now = trial.looks
    kept = earlier
    if len(earlier) > options.memory:  # the first one, and of the others the last ones
        kept = [*earlier[:1], *earlier[len(earlier) - options.memory + 1 :]][: options.memory]
    parts = [_text(f"The task: {trial.info.instruction}")]
    for one in kept:
        parts += [_text(f"Earlier, after {one.calls} calls:"), *_pictures(one)]
    if made:
        lines = [f"{number}. {json.dumps(dict(call))}" for number, call in enumerate(made, 1)]
        parts.append(_text("Your calls so far, with what came of them:\n" + "\n".join(lines)))
    if any(trial.notes):
        parts.append(_text("Your notes:\n" + "\n".join(filter(None, trial.notes))))
    parts += [_text("Now, which all points refer to:"), *_pictures(now)]
    if trial.bad:
        parts.append(_text(f"Your last answer cannot be used: {trial.bad[-1]}\nAnswer again."))
    return parts


def _text(text: str) -> Message:
    return {"type": "text", "text": text}


def _pictures(one: Sight) -> Iterator[Message]:
    for camera, png in one.pictures.items():
        yield _text(f"Camera {camera}:")
        yield {"type": "image_url", "image_url": {"url": f"data:image/png;base64,{png}"}}


def request(parts: Sequence[Message], options: AgentOptions) -> Message:
    """What is sent to an endpoint to ask for the next calls."""
    pointing, tools = options.space == POINT, options.form == "tools"
    skills = [
        f"  {' '.join(filter(None, (name, needed, taken and f'({taken})')))}: {WHAT[name]}"
        for name, (needed, taken) in FIELDS.items()
        if name in WHAT
    ]
    rules = (POINTING if pointing else LEADING).format(points=POINTS, skills="\n".join(skills))
    form = FORM % ("point" if pointing else "pick")
    how = "Call the function act with" if tools else "Answer with one JSON object:"
    system = {"role": "system", "content": f"{rules}\n{how} {form}"}
    user = {"role": "user", "content": list(parts)}
    return {"messages": [system, user], **(TOOLS if tools else {})}


def read_answer(texts: Sequence[str], spec: PolicySpec) -> tuple[str, list[dict[str, object]]]:
    """Note and calls in the texts of an answer; raises BadAnswer."""
    found = [_last_json(text) for text in texts]
    calls: list[object] = []
    for one in found:
        if not isinstance(inner := one.get("calls"), list):
            raise BadAnswer("the answer has no list 'calls'")
        calls += inner
    notes = " ".join(str(one["note"]) for one in found if one.get("note"))
    try:
        return printable(notes, LONGEST_NOTE), check_calls(calls, spec)
    except PolicyAnswerError as error:
        raise BadAnswer(str(error)) from None


def _last_json(text: str) -> dict[str, object]:
    """The last JSON object with calls in a text, around which a model may have written more."""
    read, at = json.JSONDecoder(strict=False), 0
    found: dict[str, object] | None = None
    while (at := text.find("{", at)) >= 0:
        try:
            value, at = read.raw_decode(text, at)
        except (ValueError, RecursionError):
            at += 1
            continue
        if "calls" in value or found is None:
            found = value
    if found is None:
        raise BadAnswer("the answer is no JSON")
    return found


def note_down(folder: Path, trial: Trial, line: Message) -> None:
    """Append a question with its answer to the file of `trial`, and its pictures beside it."""
    name, now = trial.info.id or "trial", trial.looks[-1]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for camera, png in now.pictures.items():
            (folder / f"{name}-{now.calls}-{camera}.png").write_bytes(base64.b64decode(png))
        with (folder / f"{name}.jsonl").open("a") as file:
            file.write(json.dumps({"calls": now.calls, **line}) + "\n")
    except OSError as error:
        log.warning("no question can be noted down in %s: %s", folder, error)


class Agents:
    """Makes an agent for each connection of a server."""

    def __init__(self, options: AgentOptions) -> None:
        """Raises EndpointError if the endpoint cannot be used."""
        self.spec, self.threads = spec_of(options), options.parallel
        self._options, self._endpoint = options, ChatEndpoint(options)
        self._endpoint.check()
        self._totals: dict[str, Usage] = {}

    def __call__(self) -> Agent:
        """An agent of its own for a connection."""
        return Agent(self._options, self._endpoint, self._totals)
