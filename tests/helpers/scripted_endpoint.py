"""A chat endpoint on loopback, in the form of OpenAI's, whose model is a function of what it is
shown and which misbehaves as often as it is told to."""

from __future__ import annotations

import base64
import io
import json
import random
import re
import threading
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

AWAY = ("429", "500", "503", "dropped", "page", "choiceless")
"""Misbehaviour that says nothing of the model."""
BAD = ("refusal", "filter", "empty", "cut", "prose", "half", "unknown", "outside", "400")
"""Misbehaviour of the model."""
CALLS = {"unknown": {"skill": "juggle"}, "outside": {"skill": "pick", "at": [0.5, 1.5]}}


@dataclass(frozen=True)
class Shown:
    """What a question shows: its texts, and the last picture, uint8 (height, width, 3)."""

    texts: list[str]
    picture: NDArray[np.uint8]

    @property
    def sentence(self) -> str:
        return self.texts[0].removeprefix("The task: ")


Model = Callable[[Shown], list[dict[str, Any]]]
"""The calls that the model makes at this."""


@dataclass
class ScriptedEndpoint:
    """A context manager. Every answer is in `log`: the sentence, and its kind ("good", or one of
    AWAY and BAD, which a `share` of all are); `tokens` are those of all answers that have any."""

    model: Model
    wrong: Sequence[str] = ()
    share: float = 0.0
    seed: int = 0
    tools: bool = False
    key: str = ""
    log: list[tuple[str, str]] = field(default_factory=list)
    tokens: list[int] = field(default_factory=lambda: [0, 0])
    last: bytes = b""
    """The last request."""

    def __enter__(self) -> ScriptedEndpoint:
        self._random, self._lock = random.Random(self.seed), threading.Lock()
        handler = type("Handler", (_Handler,), {"endpoint": self})
        self._server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
        self._server.daemon_threads = True
        self._server.handle_error = lambda *gone: None  # type: ignore[method-assign]
        self._thread = threading.Thread(target=self._server.serve_forever, args=(0.01,))
        self._thread.start()
        self.url = f"http://127.0.0.1:{self._server.server_port}/v1"
        return self

    def __exit__(self, *error: object) -> None:
        self._server.shutdown()
        self._thread.join()
        self._server.server_close()

    def answer(self, body: bytes) -> tuple[int, object]:
        """Status and body of the answer to a request; status 0 ends the connection."""
        shown = read_question(json.loads(body))
        with self._lock:
            kind = "good"
            if self.wrong and self._random.random() < self.share:
                kind = self._random.choice(self.wrong)
            self.log.append((shown.sentence, kind))
            self.last = body
        if kind == "slow":
            time.sleep(1.5)
        if kind.isdecimal():
            return int(kind), {"error": {"message": "not now", "code": kind}}
        if kind in AWAY:
            html, error = "<html>welcome</html>", {"error": {"message": "overloaded"}}
            return {"dropped": (0, ""), "page": (200, html), "choiceless": (200, error)}[kind]
        calls = [CALLS[kind]] if kind in CALLS else self.model(shown)
        said = json.dumps({"note": f"seen {len(calls)}", "calls": calls})
        said = {"empty": "", "prose": "I would rather not.", "half": said[:-3]}.get(kind, said)
        message: dict[str, Any] = {"content": f"Let me see: {{}} {said}" if said else None}
        if kind == "refusal":
            message = {"content": None, "refusal": "I cannot help with robots."}
        elif self.tools:
            message = {"tool_calls": [{"function": {"name": "act", "arguments": said}}]}
        finish = {"cut": "length", "filter": "content_filter"}.get(kind, "stop")
        used = [len(body) // 7, 1 + len(said)]
        with self._lock:
            self.tokens = [a + b for a, b in zip(self.tokens, used, strict=True)]
        return 200, {
            "choices": [{"index": 0, "message": message, "finish_reason": finish}],
            "usage": {"prompt_tokens": used[0], "completion_tokens": used[1]},
        }


class _Handler(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    endpoint: ScriptedEndpoint

    def do_GET(self) -> None:
        self._send(200, {"object": "list", "data": [{"id": "scripted", "object": "model"}]})

    def do_POST(self) -> None:
        body, key = self.rfile.read(int(self.headers["Content-Length"])), self.endpoint.key
        if key and self.headers["Authorization"] != f"Bearer {key}":
            return self._send(401, {"error": {"message": f"no such key {key}"}})
        self._send(*self.endpoint.answer(body))

    def _send(self, status: int, value: object) -> None:
        if status == 0:
            self.close_connection = True
            return self.connection.close()
        data = value.encode() if isinstance(value, str) else json.dumps(value).encode()
        self.send_response(status)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(data)))
        if status == 429:
            self.send_header("Retry-After", "0.01")
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, *words: object) -> None: ...


def read_question(body: dict[str, Any]) -> Shown:
    """What a request shows."""
    parts = body["messages"][-1]["content"]
    texts = [part["text"] for part in parts if part["type"] == "text"]
    url = [part["image_url"]["url"] for part in parts if part["type"] == "image_url"][-1]
    data = base64.b64decode(url.removeprefix("data:image/png;base64,"))
    return Shown(texts, np.asarray(Image.open(io.BytesIO(data)).convert("RGB")))


HUES = {"red": 0, "orange": 30, "yellow": 54, "green": 129, "blue": 222, "purple": 292}
"""Of the blocks as they are drawn [degrees]."""
MIDDLE = [0.5, 0.55]
"""Where the head camera shows the middle of the table."""


def coloured(picture: NDArray[np.uint8], colour: str) -> list[float]:
    """The middle of what has a strong `colour` in the picture, as u and v."""
    r, g, b = rgb = np.moveaxis(picture.astype(float), -1, 0)
    high, spread = rgb.max(0), np.maximum(np.ptp(rgb, axis=0), 1e-9)
    hue = 60 * np.select(
        [high == r, high == g], [(g - b) / spread % 6, (b - r) / spread + 2], (r - g) / spread + 4
    )
    near = np.abs((hue - HUES[colour] + 180) % 360 - 180) < 9
    rows, columns = np.nonzero(near & (spread > 0.55 * high) & (high > 70))
    if not len(rows):
        return MIDDLE
    return [round(float(x.mean()) / n, 4) for x, n in zip((columns, rows), (640, 480), strict=True)]


def by_colour(shown: Shown, skill: str = "pick") -> list[dict[str, Any]]:
    """Picks up what has the sentence's first colour; of several it stacks one on the other."""
    words = re.findall(r"\w+", shown.sentence)
    names = list(dict.fromkeys(word for word in words if word in HUES)) or ["red"]
    if len(names) < 2:
        return [{"skill": skill, "at": coloured(shown.picture, names[0])}]
    placed = sum(text.count('"place"') for text in shown.texts)
    if placed == len(names):
        return [{"skill": "done"}]
    base = coloured(shown.picture, names[placed - 1]) if placed else MIDDLE
    pick = {"skill": "pick", "at": coloured(shown.picture, names[placed])}
    return [pick, {"skill": "place", "at": base}]
