"""A run watched in a real browser while its trials come in.

Needs Chromium: run with `-m browser`.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from devtools import Page
from fake_runs import EVIL, make_run, shown, write_film

from robospa.harness import report_server as live_report
from robospa.harness.report_server import LiveReport, serving
from robospa.results.records.runs import to_line

pytestmark = pytest.mark.browser

LIVE = "document.getElementById('live').textContent"
SHOWN = "document.getElementById('count').textContent"


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Four of seven listed trials, the first filmed."""
    monkeypatch.setattr(live_report, "PAUSE_FACTOR", 0.0)
    events = ({"time": 4.0, "kind": "wrong_object", "object": "b", "index": -1, "note": EVIL},)
    records = [shown("Pick_Blocks_Size", 1, n, n > 0, candidates=2) for n in range(4)]
    records[0] = replace(records[0], video="videos/a.mp4", events=events, message=EVIL)
    folder = make_run(tmp_path / "run", records, lost=3).folder
    (folder / "videos").mkdir()
    write_film(folder / "videos" / "a.mp4", 6)
    return folder


@pytest.fixture
def page(browser: Page, run: Path) -> Iterator[Page]:
    """The run's page; afterwards nothing may have gone wrong in it."""
    browser.problems.clear()
    browser.look(1200)
    with serving(LiveReport(run)) as server:
        browser.call("Page.navigate", url=server.address)
        browser.wait("document.readyState === 'complete' && location.protocol === 'http:'")
        yield browser
        assert browser.problems == []
        browser.call("Page.navigate", url="about:blank")


def finish(run: Path, seed: int) -> None:
    """One more trial comes in."""
    with (run / "trials" / "0000.jsonl").open("a") as file:
        file.write(to_line(shown("Pick_Blocks_Size", 1, seed, True, candidates=2)))


def test_new_trials_come_in_without_losing_the_readers_place(page: Page, run: Path) -> None:
    page.wait(f"{LIVE}.startsWith('4 of 7')")
    page.run(
        "(() => { const e = document.querySelector('.filters').elements.end;"
        "e.value = 'success'; e.dispatchEvent(new Event('input', {bubbles: true})); })()"
    )
    assert page.run(SHOWN) == "1–3 of 3 trials"
    page.click("#intervals")
    kept = page.run("document.getElementById('intervals').checked")
    finish(run, 900)
    page.wait(f"{LIVE}.startsWith('5 of 7')")
    assert page.run(SHOWN) == "1–4 of 4 trials"
    assert "2 of 7 trials are missing" in page.run("document.querySelector('header').innerText")
    assert page.run("document.getElementById('intervals').checked") is kept


def test_an_open_trial_stays_open_and_its_video_can_be_sought(page: Page, run: Path) -> None:
    page.click("#list button.open")
    film = "document.querySelector('tr.detail video')"
    page.click("tr.detail .events button")
    page.wait(f"{film}.readyState >= 2 && !{film}.seeking && {film}.currentTime === 2")
    page.run(f"{film}.dataset.mine = 'yes'")
    finish(run, 901)
    page.wait(f"{LIVE}.startsWith('5 of 7')")
    assert page.run(f"{film}.dataset.mine") == "yes"
    assert EVIL in page.run("document.querySelector('tr.detail').innerText")


@pytest.mark.parametrize("width", [1200, 390])
def test_it_fits(page: Page, width: int) -> None:
    page.look(width, dark=True)
    assert page.run("document.documentElement.scrollWidth") == width
