"""Acme's policy server, which is made up: it opens the grippers and moves nothing else."""

from __future__ import annotations

import json
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any


class Acme(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def do_GET(self) -> None:
        pages = {"/": (200, {"server": "acme"}), "/predict": (405, {"error": "POST only"})}
        self.answer(*pages.get(self.path, (404, {"error": "no such page"})))

    def do_POST(self) -> None:
        seen = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
        if self.path != "/predict":
            return self.answer(404, {"error": "no such page"})
        joints = seen["joints"]
        joints[6] = joints[13] = 100.0
        self.answer(200, {"joints": [joints] * 5})

    def answer(self, status: int, value: Any) -> None:
        data = json.dumps(value).encode()
        self.send_response(status)
        self.send_header("Content-Length", str(len(data)))
        self.end_headers()
        self.wfile.write(data)

    def log_message(self, *_: object) -> None:
        return None


if __name__ == "__main__":
    ThreadingHTTPServer(("127.0.0.1", 7000), Acme).serve_forever()
