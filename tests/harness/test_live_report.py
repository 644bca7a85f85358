"""The page of a run that goes on: what is served to whom, and that it follows the records."""

import http.client
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path

import pytest
from fake_runs import EVIL, make_run, shown

from robospa.harness import report_server as live_report
from robospa.harness.report_server import LiveReport, ReportServer, byte_range, serving
from robospa.results.records.manifest import RunError
from robospa.results.records.runs import film_name, to_line

pytestmark = pytest.mark.usefixtures("no_figures")

FILM = bytes(range(200))
RECORDS = [shown("Pick_Blocks_Size", 1, n, n < 3, candidates=2) for n in range(4)]
NEW = to_line(replace(RECORDS[0], key=replace(RECORDS[0].key, seed=900)))


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Four of six listed trials are there, one filmed."""
    monkeypatch.setattr(live_report, "PAUSE_FACTOR", 0.0)
    records = [replace(RECORDS[0], video="videos/a.mp4", message=EVIL), *RECORDS[1:]]
    folder = make_run(tmp_path / "run", records, lost=2).folder
    (folder / "videos").mkdir()
    (folder / "videos" / "a.mp4").write_bytes(FILM)
    return folder


@pytest.fixture
def server(run: Path) -> Iterator[ReportServer]:
    with serving(LiveReport(run)) as found:
        yield found


def ask(
    server: ReportServer, path: str, method: str = "GET", **headers: str
) -> tuple[int, dict[str, str], bytes]:
    """Status, headers and body of an answer."""
    given = {name.replace("_", "-"): value for name, value in headers.items()}
    line = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=30)
    with closing(line) as connection:
        connection.request(method, path, headers=given)
        answer = connection.getresponse()
        return answer.status, dict(answer.headers), answer.read()


def test_the_page_follows_the_records_and_writes_nothing(run: Path, server: ReportServer) -> None:
    before = sorted(path.name for path in run.rglob("*"))
    status, headers, body = ask(server, "/")
    text = body.decode()
    assert status == 200 and "2 of 6 trials are missing" in text
    assert "<script>alert" not in text
    assert ask(server, "/", If_None_Match=headers["ETag"])[0] == 304
    with (run / "trials" / "0000.jsonl").open("a") as file:
        file.write(NEW)
    status, changed, body = ask(server, "/", If_None_Match=headers["ETag"])
    assert status == 200 and "1 of 6 trials are missing" in body.decode()
    assert changed["ETag"] != headers["ETag"]
    assert sorted(path.name for path in run.rglob("*")) == before


def test_a_film_that_follows_its_record_changes_the_page(run: Path, server: ReportServer) -> None:
    record = replace(RECORDS[1], video=film_name(RECORDS[1].key))
    (run / "trials" / "0000.jsonl").write_text("".join(map(to_line, [record, *RECORDS[2:]])))
    _, headers, body = ask(server, "/")
    assert '"film": "owed"' in body.decode() and record.video not in body.decode()
    (run / record.video).write_bytes(FILM)
    status, _, body = ask(server, "/", If_None_Match=headers["ETag"])
    assert status == 200 and record.video in body.decode()
    assert '"film":' not in body.decode()


def test_a_trial_in_3d_is_for_the_pages_own_button(
    server: ReportServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    started = []
    real = subprocess.Popen

    def popen(command: list[str], **more: object) -> object:
        started.append(command)
        said = "nothing is there" if "x" in command else "It is at http://127.0.0.1:5 (Ctrl-C)"
        return real([sys.executable, "-c", f"print({said!r})"], **more)  # type: ignore[call-overload]

    monkeypatch.setattr(subprocess, "Popen", popen)
    own = {"Origin": server.address.rstrip("/")}
    status, headers, _ = ask(server, "/3-D/Pick-L1-3", "POST", **own)
    assert (status, headers["Location"]) == (303, "http://127.0.0.1:5")
    assert started[0][-3:] == ["--", str(server.report.folder), "Pick-L1-3"]
    assert ask(server, "/3-D/x", "POST", **own)[::2] == (500, b"nothing is there")
    assert ask(server, "/else/x", "POST", **own)[0] == 404
    assert ask(server, "/3-D/x", "POST", Origin="http://evil.org")[0] == 403
    assert ask(server, "/3-D/x", "POST")[0] == 403 and len(started) == 2


def test_a_page_that_took_long_is_given_again_for_a_while(
    run: Path, server: ReportServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(live_report, "PAUSE_FACTOR", 1e6)
    path = run / "trials" / "0000.jsonl"
    whole = path.read_bytes()
    path.write_bytes(whole + NEW.encode())
    first = ask(server, "/")[2]
    path.write_bytes(whole)
    assert ask(server, "/")[2] == first


def test_videos_are_served_whole_and_in_parts(server: ReportServer) -> None:
    assert ask(server, "/videos/a.mp4")[::2] == (200, FILM)
    status, headers, body = ask(server, "/videos/a.mp4", Range="bytes=10-19")
    assert (status, body) == (206, FILM[10:20])
    assert headers["Content-Range"] == "bytes 10-19/200"
    assert ask(server, "/videos/a.mp4", Range="bytes=500-")[0] == 416


def test_ranges() -> None:
    for whole in ("", "bytes=0-", "bytes=1-2,4-5", "lines=1-2"):
        assert byte_range(whole, 200) == (0, 199)
    parts = [byte_range(f"bytes={wanted}", 200) for wanted in ("-50", "5-9999", "9-5")]
    assert parts == [(150, 199), (5, 199), (9, 5)]


PATHS = "run.json videos/../run.json videos/%2e%2e/run.json videos/ /etc/passwd trials/0000.jsonl"
VIDEOS = "%2fetc%2fpasswd none.mp4 link.mp4"


def test_nothing_else_is_served(run: Path, server: ReportServer, tmp_path: Path) -> None:
    """A link out of the run is not followed."""
    (tmp_path / "secret.mp4").write_bytes(b"x")
    (run / "videos" / "link.mp4").symlink_to(tmp_path / "secret.mp4")
    for path in [*PATHS.split(), *(f"videos/{name}" for name in VIDEOS.split())]:
        assert ask(server, f"/{path}")[0] == 404, path


def test_other_names_of_this_machine_are_refused(server: ReportServer) -> None:
    assert ask(server, "/", Host="evil.example")[0] == 403
    assert ask(server, "/", Host=f"localhost:{server.server_port}")[0] == 200


def test_records_that_contradict_each_other_are_reported(run: Path, server: ReportServer) -> None:
    other = replace(RECORDS[1], digest="other")
    (run / "trials" / "0001.jsonl").write_text(to_line(other))
    status, _, body = ask(server, "/")
    assert status == 500 and b"two different records" in body


def test_what_is_no_run_is_refused(tmp_path: Path) -> None:
    with pytest.raises(RunError, match=r"is not a run: it has no run\.json$"):
        LiveReport(tmp_path)
    (tmp_path / "demo" / "mistakes").mkdir(parents=True)
    (tmp_path / "demo" / "mistakes" / "run.json").touch()
    with pytest.raises(RunError, match=r"runs in it are .*demo/mistakes$"):
        LiveReport(tmp_path)
