"""A run's report at an address of this machine, up to date while the run goes on.

The page is made again when records change, but takes a sixth of one core at most; nothing is
written into the run's folder. The server listens on 127.0.0.1 only, answers only requests that name
it so (a page from elsewhere cannot read it through another name), and serves two things: the page
and the run's videos. A button of that very page has a trial played in 3-D by a process of its own.
"""

import hashlib
import re
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from http import HTTPStatus
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from socket import socket
from tempfile import TemporaryDirectory
from urllib.parse import unquote

from robospa.results.figures.series import DrawnFigure
from robospa.results.records.manifest import MANIFEST, RunError, no_run
from robospa.results.records.runs import TRIALS, VIDEOS, Run, read_run
from robospa.results.report.page import FIGURES, page
from robospa.results.report.report import draw_figures, make_report
from robospa.results.scoring.safety import SAFETY

FORMATS = ("svg",)
PAUSE_FACTOR = 5.0
"""After the page was made it is not made again for so many times as long as that took."""
FIGURES_SECONDS = 60.0
"""The figures are drawn no more often than that while the run goes on."""
VIEWER_MINUTES = 120
Inputs = tuple[tuple[str, int, int], ...]
"""Names, sizes [bytes] and times [ns] of the files that the page is made from."""


class LiveReport:
    """The page of the run in `folder`, made when it is asked for and something has changed."""

    def __init__(self, folder: Path, published: tuple[str, ...] = ()) -> None:
        """Raises RunError if there is no run in `folder`."""
        self.folder = folder
        self._published = published
        self._lock = threading.Lock()
        self._drawn_folder = TemporaryDirectory(prefix="robospa-view-")
        self._inputs: Inputs = ()
        self._page, self._tag = b"", ""
        self._earliest = 0.0
        self._drawings: list[DrawnFigure] = []
        self._drawn_at = -FIGURES_SECONDS
        self._viewer: subprocess.Popen[str] | None = None
        self._viewer_lock = threading.Lock()
        self.read()

    def close(self) -> None:
        """Remove the drawn figures and end the viewer."""
        if self._viewer is not None:
            self._viewer.terminate()
            self._viewer.wait()
        self._drawn_folder.cleanup()

    def in_3d(self, trial: str) -> str:
        """The address at which `trial` is played in 3-D from now on, in place of the one before;
        raises RunError with the reason if it cannot be."""
        with self._viewer_lock:
            if self._viewer is not None:
                self._viewer.terminate()
                self._viewer.wait()
            command = [sys.executable, "-m", "robospa", "view", "--minutes", f"{VIEWER_MINUTES}"]
            self._viewer = subprocess.Popen(
                [*command, "--", str(self.folder), trial],
                stdout=subprocess.PIPE,
                stderr=subprocess.STDOUT,
                text=True,
            )
            assert self._viewer.stdout is not None
            said = ""
            for line in self._viewer.stdout:
                if found := re.search(r"is at (http://127\.0\.0\.1:\d+)", line):
                    return found[1]
                said = line
            raise RunError(said.strip() or f"{trial} cannot be shown in 3-D")

    def read(self) -> tuple[bytes, str]:
        """The page as it is now, and a tag that changes with it; raises RunError."""
        with self._lock:
            inputs = self._list_inputs()
            if inputs != self._inputs and time.monotonic() >= self._earliest:
                started = time.monotonic()
                self._page = self._make(read_run(self.folder)).encode()
                self._tag = f'"{hashlib.sha256(self._page).hexdigest()[:24]}"'
                self._inputs = inputs
                self._earliest = time.monotonic() + PAUSE_FACTOR * (time.monotonic() - started)
            return self._page, self._tag

    def _list_inputs(self) -> Inputs:
        found = []
        trials = sorted((self.folder / TRIALS).glob("*.jsonl"))
        for path in (*(self.folder / name for name in (MANIFEST, VIDEOS, SAFETY)), *trials):
            try:
                status = path.stat()
            except FileNotFoundError:
                continue
            found.append((path.name, status.st_size, status.st_mtime_ns))
        if not found:
            raise no_run(self.folder)
        return tuple(found)

    def _make(self, run: Run) -> str:
        report = make_report(run, self._published)
        drawn = Path(self._drawn_folder.name)
        if not run.without_result or time.monotonic() >= self._drawn_at + FIGURES_SECONDS:
            (drawn / FIGURES).mkdir(exist_ok=True)
            self._drawings = draw_figures(
                report.runs, report.columns, drawn / FIGURES, FORMATS, report.failures
            )
            self._drawn_at = time.monotonic()
        return page(report, self._drawings, self.folder, drawn=drawn, formats=(), live=True)

    def video(self, name: str) -> Path | None:
        """The run's video of that name; None if there is none."""
        home = (self.folder / VIDEOS).resolve()
        path = (home / name).resolve()
        return path if path.parent == home and path.suffix == ".mp4" and path.is_file() else None


CONNECTIONS = 16
BLOCK_BYTES = 1 << 18
RANGE = re.compile(r"bytes=(\d*)-(\d*)")
Request = socket | tuple[bytes, socket]


class ReportServer(ThreadingHTTPServer):
    """Serves one report on the loopback device to a bounded number of connections."""

    daemon_threads = True
    allow_reuse_address = True

    def __init__(self, report: LiveReport, port: int = 0) -> None:
        self.report = report
        self._free = threading.Semaphore(CONNECTIONS)
        super().__init__(("127.0.0.1", port), _Handler)

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.server_port}/"

    def process_request(self, request: Request, client_address: object) -> None:
        """One more connection, or none if there are too many."""
        if not self._free.acquire(blocking=False):
            self.shutdown_request(request)
            return
        super().process_request(request, client_address)

    def process_request_thread(self, request: Request, client_address: object) -> None:
        """Count the connection as long as it lasts."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Request, client_address: object) -> None:
        """A browser that went away is no fault."""


class _Handler(BaseHTTPRequestHandler):
    server: ReportServer
    timeout = 30
    protocol_version = "HTTP/1.0"

    def _is_ours(self, name: str, start: str = "") -> bool:
        """Whether the header `name` is this server's address; answers the request if not."""
        port = self.server.server_port
        if self.headers.get(name) in (f"{start}127.0.0.1:{port}", f"{start}localhost:{port}"):
            return True
        self._send_text(HTTPStatus.FORBIDDEN, "this server is for this machine only")
        return False

    def do_POST(self) -> None:
        """A trial in 3-D, asked for by a button of the page itself."""
        if not (self._is_ours("Host") and self._is_ours("Origin", "http://")):
            return
        start, _, trial = unquote(self.path).rpartition("/")
        if start != "/3-D":
            self._send_text(HTTPStatus.NOT_FOUND, "there is nothing of that name")
            return
        try:
            address = self.server.report.in_3d(trial)
        except RunError as error:
            self._send_text(HTTPStatus.INTERNAL_SERVER_ERROR, str(error))
            return
        self._send_head(HTTPStatus.SEE_OTHER, "text/plain", 0, Location=address)

    def do_GET(self) -> None:
        if not self._is_ours("Host"):
            return
        path = unquote(self.path.partition("?")[0])
        if path == "/":
            self._send_page()
        elif path.startswith(f"/{VIDEOS}/") and (
            video := self.server.report.video(path.removeprefix(f"/{VIDEOS}/"))
        ):
            self._send_video(video)
        else:
            self._send_text(HTTPStatus.NOT_FOUND, "there is nothing of that name")

    def log_message(self, format: str, *args: object) -> None:
        """Print nothing."""

    def _send_page(self) -> None:
        try:
            body, tag = self.server.report.read()
        except (RunError, ValueError) as error:
            self._send_text(HTTPStatus.INTERNAL_SERVER_ERROR, " ".join(str(error).split()))
            return
        if self.headers.get("If-None-Match") == tag:
            self.send_response(HTTPStatus.NOT_MODIFIED)
            self.end_headers()
            return
        self._send_head(HTTPStatus.OK, "text/html; charset=utf-8", len(body), ETag=tag)
        self.wfile.write(body)

    def _send_video(self, path: Path) -> None:
        """A video or the part of it that is asked for: browsers need that to seek."""
        size = path.stat().st_size
        first, last = byte_range(self.headers.get("Range", ""), size)
        if first > last:
            missing = {"Content-Range": f"bytes */{size}"}
            status = HTTPStatus.REQUESTED_RANGE_NOT_SATISFIABLE
            self._send_head(status, "video/mp4", 0, **missing)
            return
        headers = {"Accept-Ranges": "bytes"}
        status = HTTPStatus.OK
        if last - first + 1 < size:
            headers["Content-Range"] = f"bytes {first}-{last}/{size}"
            status = HTTPStatus.PARTIAL_CONTENT
        self._send_head(status, "video/mp4", last - first + 1, **headers)
        with path.open("rb") as file:
            file.seek(first)
            left = last - first + 1
            while left and (block := file.read(min(BLOCK_BYTES, left))):
                self.wfile.write(block)
                left -= len(block)

    def _send_text(self, status: HTTPStatus, text: str) -> None:
        data = text.encode()
        self._send_head(status, "text/plain; charset=utf-8", len(data))
        self.wfile.write(data)

    def _send_head(self, status: HTTPStatus, kind: str, size: int, **more: str) -> None:
        self.send_response(status)
        common = {"Content-Type": kind, "Content-Length": str(size), "Cache-Control": "no-store"}
        for name, value in {**common, "X-Content-Type-Options": "nosniff", **more}.items():
            self.send_header(name, value)
        self.end_headers()


def byte_range(header: str, size: int) -> tuple[int, int]:
    """First and last byte that a Range `header` asks for; all of them if it is not understood,
    first > last if it asks for bytes that are not there."""
    match = RANGE.fullmatch(header.strip())
    if not match or match.groups() == ("", ""):
        return 0, size - 1
    if not match[1]:
        return max(0, size - int(match[2])), size - 1
    last = min(int(match[2]), size - 1) if match[2] else size - 1
    return int(match[1]), last


@contextmanager
def serving(report: LiveReport, port: int = 0) -> Iterator[ReportServer]:
    """A server that answers in the background until the block ends."""
    try:
        server = ReportServer(report, port)
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
        report.close()
