"""A question to an OpenAI-compatible endpoint: an answer, or whose fault it is that there is none.

    Away        no connection, no answer in time, a page that is no completion, and every status but
                those below: it says nothing of the model, so the trial is not scored
    BadAnswer   the model's own: a refusal, nothing, an answer that was cut off, and 400, 413 or
                422, with which an endpoint refuses what it was sent

While an endpoint is away it is asked again, not before the time that its `Retry-After` names, until
the caller's deadline. Every answer is paid for, so every answer is counted, also those that nobody
can use. The key comes from the environment; it is in no text that leaves this module.
"""

import json
import os
import re
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import Annotated

import msgspec
from msgspec import Meta

from robospa.extras import need
from robospa.protocol.errors import CallTimeout, printable, without_secrets
from robospa.protocol.options import option

REFUSED = (400, 413, 422)
"""Statuses with which an endpoint refuses what it was sent."""
FIRST_PAUSE, LONGEST_PAUSE = 0.5, 20.0
"""[s] between two requests to an endpoint that is away and does not say for how long."""
UNREADABLE = (ValueError, LookupError, TypeError, AttributeError, ArithmeticError, RecursionError)
"""What reading a page raises that is no completion."""
LONGEST_ANSWER = 50_000
"""Characters of an answer that are looked at."""


class EndpointError(Exception):
    """The endpoint cannot be used as it is told to be; the message says what to do."""

    retriable = False


class Away(CallTimeout):
    """The endpoint did not answer, which says nothing of its model; `after` [s] it may be asked
    again, 0 if it does not say."""

    def __init__(self, text: str, after: float = 0.0) -> None:
        super().__init__(text)
        self.after = after


class BadAnswer(Exception):
    """The model answered what is no list of calls: one sentence."""


Usage = dict[str, float]
"""What has been used, by the names of `protocol.policy.USAGE`."""


Some = Annotated[int, Meta(ge=1)]
Amount = Annotated[float, Meta(ge=0)]


@dataclass(frozen=True)
class EndpointOptions:
    """Where the model is, and how it is asked."""

    endpoint: str = option("", "base URL of the endpoint, such as http://127.0.0.1:8000/v1")
    model: str = option("", "name of the model there")
    key: str = option("OPENAI_API_KEY", "environment variable that holds the key, if one is needed")
    form: str = option("json", "how the model answers: JSON text, or tool calls", ("json", "tools"))
    max_tokens: Some = option(2000, "tokens of an answer, at most")
    limit: str = option(
        "max_tokens",
        "field of the request that says so",
        ("max_tokens", "max_completion_tokens"),
    )
    extra: str | None = option(
        None, 'more fields of the request, as JSON, such as {"temperature": 0}'
    )
    deadline: Annotated[float, Meta(gt=0)] = option(
        100.0, "seconds for a query, repairs and waits included; less than the client allows (120)"
    )
    parallel: Some = option(8, "requests at once, at most")
    price_in: Amount = option(0.0, "price of a million input tokens")
    price_out: Amount = option(0.0, "price of a million output tokens")

    def price(self, tokens_in: float, tokens_out: float) -> float:
        """Of so many tokens."""
        return (tokens_in * self.price_in + tokens_out * self.price_out) / 1e6


@dataclass
class ChatEndpoint:
    """An endpoint that several threads may ask; one that is away is left alone by all of them."""

    options: EndpointOptions
    _free: float = 0.0
    """When it may be asked again, on the monotonic clock."""
    _why: str = ""
    """Why not before."""
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def __post_init__(self) -> None:
        given = self.options
        if not given.endpoint or not given.model:
            raise EndpointError("an agent needs an endpoint and a model: --endpoint URL --model M")
        if without_secrets(given.endpoint) != given.endpoint:
            raise EndpointError(
                f"the endpoint's URL holds a secret: put it into the variable {given.key}"
            )
        self._key = os.environ.get(given.key, "")
        try:
            self._extra = msgspec.json.decode(given.extra or "{}", type=dict[str, object])
        except msgspec.DecodeError as error:
            raise EndpointError(f"option extra is no JSON object: {error}") from None
        self._openai: ModuleType = need("openai")
        self._client = self._openai.OpenAI(
            base_url=given.endpoint, api_key=self._key or "none", max_retries=0
        )

    def check(self) -> None:
        """Raises EndpointError unless the endpoint is there, lets us in and knows the model; one
        that lists no models is believed."""
        try:
            found = [str(model.id) for model in self._client.models.list(timeout=30.0)]
        except self._openai.APIStatusError as error:
            if error.status_code in (401, 403):
                text = f"set the variable {self.options.key} to a valid key"
                raise EndpointError(f"{self._said(error)}; {text}") from None
            return
        except self._openai.APIConnectionError as error:
            raise EndpointError(f"{self._said(error)}; start it first") from None
        except (self._openai.OpenAIError, TypeError, AttributeError, ValueError):
            return
        if found and self.options.model not in found:
            some = printable(", ".join(found), 300)
            raise EndpointError(
                f"{self.options.endpoint} has no model {self.options.model!r}; it has {some}"
            )

    def ask(self, body: Mapping[str, object], until: float, used: Usage) -> list[str]:
        """The answer to a request, the JSON texts of its tool calls or else its text, and in `used`
        (all 0) what it cost. Raises BadAnswer; Away at `until`, on the monotonic clock, if there is
        none."""
        pause = FIRST_PAUSE
        while True:
            self._wait(until)
            try:
                return self._once(body, until, used)
            except Away as error:
                used["unanswered"] += 1
                now = time.monotonic()
                with self._lock:
                    self._free = max(self._free, now + (error.after or pause))
                    self._why = str(error)
                if self._free >= until:
                    raise
                if not error.after:
                    pause = min(2 * pause, LONGEST_PAUSE)

    def _wait(self, until: float) -> None:
        """Return when the endpoint may be asked; raises Away at `until`."""
        while (left := self._free - (now := time.monotonic())) > 0:
            time.sleep(max(min(left, until - now), 0.0))
            if time.monotonic() >= until:
                raise Away(f"{self._why}; it may be asked again in {self._free - now:.0f} s")

    def _once(self, body: Mapping[str, object], until: float, used: Usage) -> list[str]:
        given, began = self.options, time.monotonic()
        more = {"model": given.model, given.limit: given.max_tokens, "extra_body": self._extra}
        try:
            raw = self._client.chat.completions.with_raw_response.create(
                **body, **more, timeout=max(until - began, 0.01)
            )
            found = json.loads(raw.content)
            choice, tokens = found["choices"][0], found.get("usage") or {}
            used["input_tokens"] += max(0, int(tokens.get("prompt_tokens") or 0))
            used["output_tokens"] += max(0, int(tokens.get("completion_tokens") or 0))
            used["cost"] = given.price(used["input_tokens"], used["output_tokens"])
            said = choice["message"]
            tools = [one["function"]["arguments"] for one in said.get("tool_calls") or ()]
        except self._openai.APIStatusError as error:
            if error.status_code in REFUSED:
                used["requests"] += 1
                raise BadAnswer(self._said(error)) from None
            raise Away(self._said(error), _retry_after(error.response.headers)) from None
        except self._openai.OpenAIError as error:
            raise Away(self._said(error)) from None
        except UNREADABLE:
            raise Away(f"{given.endpoint} answered something that is no completion") from None
        used["requests"] += 1
        used["seconds"] += time.monotonic() - began
        if said.get("refusal") or choice.get("finish_reason") == "content_filter":
            raise BadAnswer(f"the model refused: {printable(str(said.get('refusal')), 200)}")
        if choice.get("finish_reason") == "length":
            raise BadAnswer(f"cut off after {given.max_tokens} tokens: answer in fewer")
        text = said["content"] if isinstance(said.get("content"), str) else ""
        if not text.strip() and not tools:
            raise BadAnswer("the model answered nothing")
        texts = [one if isinstance(one, str) else json.dumps(one) for one in tools or (text,)]
        return [one[:LONGEST_ANSWER] for one in texts]

    def _said(self, error: Exception) -> str:
        """The error in one line that says where, without the key."""
        text = f"{error} ({error.__cause__})" if error.__cause__ else str(error)
        text = text.replace(self._key, "***") if self._key else text
        return f"{self.options.endpoint}: {printable(text)}"


def _retry_after(headers: Mapping[str, str]) -> float:
    """Seconds that an answer asks to wait; 0 if it does not say, or in another form."""
    text = headers.get("retry-after", "")
    return float(text) if re.fullmatch(r"\d{1,7}(\.\d*)?", text) else 0.0
