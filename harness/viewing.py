"""A run's report as a page that stays up to date while the run goes on: a small local server.

It listens on 127.0.0.1 only, answers only requests that name it so (a page from elsewhere cannot
read it through another name), and serves two things: the page and the run's videos. The page is
made again when records change, but never takes more than a sixth of one core; nothing is written
into the run's folder.
"""

from __future__ import annotations

import hashlib
import re
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from urllib.parse import unquote

from robospa.results.figures.series import Drawing
from robospa.results.records.manifest import MANIFEST, RunError
from robospa.results.records.run_io import TRIALS, Run, read_run
from robospa.results.report.page import FIGURES, page
from robospa.results.report.report import draw_figures, gather
from robospa.results.report.tables import for_page
from robospa.results.report.trials import FILMS

FORMATS = ("svg",)
REST = 5.0
"""Making the page is followed by a rest of so many times as long."""
FIGURES_EVERY = 60.0
"""Seconds between two drawings of the figures while the run goes on."""
CONNECTIONS = 16
PIECE = 1 << 18
RANGE = re.compile(r"bytes=(\d*)-(\d*)")
State = tuple[tuple[str, int, int], ...]


class View:
    """The page of the run in `folder`, made when it is asked for and something has changed."""

    def __init__(self, folder: Path, published: tuple[str, ...] = (), ci: str = "wilson") -> None:
        """Raises RunError if there is no run in `folder`."""
        self.folder = folder
        self._published, self._ci = published, ci
        self._lock = threading.Lock()
        self._place = TemporaryDirectory(prefix="robospa-view-")
        self._state: State = ()
        self._page, self._tag = b"", ""
        self._next = 0.0
        self._drawings: list[Drawing] = []
        self._drawn = -FIGURES_EVERY
        self.read()

    def close(self) -> None:
        """Remove the drawn figures."""
        self._place.cleanup()

    def read(self) -> tuple[bytes, str]:
        """The page as it is now, and a tag that changes with it; raises RunError."""
        with self._lock:
            state = self._look()
            if state != self._state and time.monotonic() >= self._next:
                begun = time.monotonic()
                self._page = self._make(read_run(self.folder)).encode()
                self._tag = f'"{hashlib.sha256(self._page).hexdigest()[:24]}"'
                self._state = state
                self._next = time.monotonic() + REST * (time.monotonic() - begun)
            return self._page, self._tag

    def _look(self) -> State:
        """Names, sizes and times of what the page is made from."""
        found = []
        for path in (self.folder / MANIFEST, *sorted((self.folder / TRIALS).glob("*.jsonl"))):
            try:
                about = path.stat()
            except FileNotFoundError:
                continue
            found.append((path.name, about.st_size, about.st_mtime_ns))
        if not found:
            raise RunError(f"{self.folder} is not a run: it has no {MANIFEST}")
        return tuple(found)

    def _make(self, run: Run) -> str:
        gathered = gather([run], self._published, self._ci)
        place = Path(self._place.name)
        if not run.missing or time.monotonic() >= self._drawn + FIGURES_EVERY:
            (place / FIGURES).mkdir(exist_ok=True)
            self._drawings = draw_figures([run], gathered.columns, place / FIGURES, FORMATS)
            self._drawn = time.monotonic()
        return page(
            [run],
            gathered.names,
            gathered.scores,
            for_page(gathered.tables),
            self._drawings,
            gathered.notes,
            self.folder,
            drawn=place,
            formats=(),
            live=True,
        )

    def video(self, name: str) -> Path | None:
        """The run's video of that name; None if there is none."""
        home = (self.folder / FILMS).resolve()
        path = (home / name).resolve()
        return path if path.parent == home and path.suffix == ".mp4" and path.is_file() else None


class Server(ThreadingHTTPServer):
    """Serves one view on the loopback device to a bounded number of connections."""

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, view: View, port: int = 0) -> None:
        self.view = view
        self._free = threading.Semaphore(CONNECTIONS)
        super().__init__(("127.0.0.1", port), _Handler)

    @property
    def address(self) -> str:
        """Where to look."""
        return f"http://127.0.0.1:{self.server_port}/"

    def process_request(self, request: Any, client_address: Any) -> None:
        """One more connection, or none if there are too many."""
        if not self._free.acquire(blocking=False):
            self.shutdown_request(request)
            return
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Count the connection as long as it lasts."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A browser that went away is no news."""


class _Handler(BaseHTTPRequestHandler):
    server: Server
    timeout = 30
    protocol_version = "HTTP/1.0"

    def do_GET(self) -> None:
        """The page or a video."""
        port = self.server.server_port
        if self.headers.get("Host") not in (f"127.0.0.1:{port}", f"localhost:{port}"):
            self._say(HTTPStatus.FORBIDDEN, "this server is for this machine only")
            return
        place = unquote(self.path.partition("?")[0])
        if place == "/":
            self._page()
        elif place.startswith(f"/{FILMS}/") and (
            film := self.server.view.video(place.removeprefix(f"/{FILMS}/"))
        ):
            self._film(film)
        else:
            self._say(HTTPStatus.NOT_FOUND, "there is nothing of that name")

    def log_message(self, format: str, *args: Any) -> None:
        """Quiet: what is asked for is no news."""

    def _page(self) -> None:
        try:
            made, tag = self.server.view.read()
        except (RunError, ValueError) as error:
            self._say(HTTPStatus.INTERNAL_SERVER_ERROR, " ".join(str(error).split()))
            return
        if self.headers.get("If-None-Match") == tag:
            self.send_response(HTTPStatus.NOT_MODIFIED)
            self.end_headers()
            return
        self._head(HTTPStatus.OK, "text/html; charset=utf-8", len(made), ETag=tag)
        self.wfile.write(made)

    def _film(self, path: Path) -> None:
        """A video or the part of it that is asked for: browsers need that to seek."""
        size = path.stat().st_size
        first, last = part_of(self.headers.get("Range", ""), size)
        if first > last:
            self._head(HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE, "video/mp4", 0,
                       **{"Content-Range": f"bytes */{size}"})  # fmt: skip
            return
        whole = last - first + 1 == size
        about = {"Accept-Ranges": "bytes"}
        if not whole:
            about["Content-Range"] = f"bytes {first}-{last}/{size}"
        status = HTTPStatus.OK if whole else HTTPStatus.PARTIAL_CONTENT
        self._head(status, "video/mp4", last - first + 1, **about)
        with path.open("rb") as file:
            file.seek(first)
            left = last - first + 1
            while left and (piece := file.read(min(PIECE, left))):
                self.wfile.write(piece)
                left -= len(piece)

    def _say(self, status: HTTPStatus, text: str) -> None:
        data = text.encode()
        self._head(status, "text/plain; charset=utf-8", len(data))
        self.wfile.write(data)

    def _head(self, status: HTTPStatus, kind: str, size: int, **more: str) -> None:
        self.send_response(status)
        about = {"Content-Type": kind, "Content-Length": str(size), "Cache-Control": "no-store"}
        for name, value in {**about, "X-Content-Type-Options": "nosniff", **more}.items():
            self.send_header(name, value)
        self.end_headers()


def part_of(wanted: str, size: int) -> tuple[int, int]:
    """First and last byte of the range header `wanted`; all where it asks for nothing sensible,
    first > last where it asks for what is not there."""
    match = RANGE.fullmatch(wanted.strip())
    if not match or match.groups() == ("", ""):
        return 0, size - 1
    if not match[1]:
        return max(0, size - int(match[2])), size - 1
    last = min(int(match[2]), size - 1) if match[2] else size - 1
    return int(match[1]), last


@contextmanager
def serving(view: View, port: int = 0) -> Iterator[Server]:
    """A server that answers in the background until the block ends."""
    try:
        server = Server(view, port)
    except OSError as error:
        raise OSError(f"port {port} cannot be used: {error.strerror}; leave --port out") from None
    thread = threading.Thread(target=server.serve_forever, args=(0.2,), daemon=True)
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
        view.close()
