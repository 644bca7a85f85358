"""The report in a real browser: opened from disk, clicked, filtered, sorted, sought.

Needs Chromium: run with `-m browser`.
"""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from devtools import Page
from fake_runs import EVIL, make_run, shown, write_film

from robospa.results.report.page import write_report
from robospa.results.report.report import make_report

pytestmark = pytest.mark.browser

EVENTS = (
    {"time": 2.0, "kind": "grasped", "object": "object_1", "index": -1, "note": ""},
    {"time": 4.0, "kind": "wrong_object", "object": "object_1", "index": -1, "note": EVIL},
)
COUNT = 130
ROWS = "[...document.querySelectorAll('#list tr.row')].map(r => [...r.cells].map(c => c.innerText))"
SHOWN = "document.getElementById('count').textContent"


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """130 trials of two tasks, the second of them filmed; 30 failed."""
    folder = tmp_path_factory.mktemp("browser")
    records = [
        shown("Pick_Blocks_Size", 1, n, n >= 30, candidates=2, instruction=f"take {n} {EVIL}")
        for n in range(COUNT - 10)
    ]
    records += [shown("Press_Stapler_Repeat", 2, n, True, steps=n) for n in range(10)]
    records[1] = replace(records[1], video="videos/a b#1.mp4", events=EVENTS)
    run = make_run(folder / "run", records)
    (folder / "run" / "videos").mkdir()
    write_film(folder / "run" / "videos" / "a b#1.mp4", 6)
    return write_report(make_report(run, ["RDT", "X-VLA"]), folder / "report") / "report.html"


@pytest.fixture(scope="module")
def two_runs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A report of two runs of the same three seeds; the first seed is filmed in both."""
    folder = tmp_path_factory.mktemp("two")
    runs = []
    for name, good in (("one", False), ("two", True)):
        records = [shown("Pick_Blocks_Size", 1, n, good, candidates=2) for n in range(3)]
        records[0] = replace(records[0], video="videos/a.mp4")
        runs.append(make_run(folder / name, records))
        (folder / name / "videos").mkdir()
        write_film(folder / name / "videos" / "a.mp4", 6)
    return write_report(make_report(runs), folder / "report") / "report.html"


@pytest.fixture
def page(browser: Page, report: Path) -> Iterator[Page]:
    """The report freshly opened; afterwards nothing may have gone wrong in it."""
    browser.problems.clear()
    browser.look(1200)
    browser.open(report)
    yield browser
    assert browser.problems == []


def choose(page: Page, name: str, value: str) -> None:
    """Choose in a filter as a user does."""
    page.run(
        f"(() => {{ const e = document.querySelector('.filters').elements['{name}'];"
        f"e.value = '{value}'; e.dispatchEvent(new Event('input', {{bubbles: true}})); }})()"
    )


def test_nothing_is_loaded_from_elsewhere(page: Page, report: Path) -> None:
    page.wait("document.querySelector('.films video').readyState >= 1")
    base = report.parent.resolve().as_uri()
    assert [url for url in page.requested() if not url.startswith((base, "data:"))] == []


def test_text_from_outside_stays_text(page: Page) -> None:
    page.click("#list button.open")
    assert EVIL in page.run("document.querySelector('tr.detail').innerText")
    assert EVIL in page.run("document.querySelector('h1').innerText")
    assert page.run("document.querySelectorAll('script').length") == 2


def test_pages_of_the_list(page: Page) -> None:
    assert page.run(SHOWN) == f"1–25 of {COUNT} trials"
    assert page.run("document.getElementById('back').disabled")
    page.click("#next")
    assert page.run(SHOWN) == f"26–50 of {COUNT} trials"
    assert len(page.run(ROWS)) == 25
    page.click("#back")
    assert page.run(SHOWN) == f"1–25 of {COUNT} trials"


def test_filters_work_together_and_are_cleared(page: Page) -> None:
    choose(page, "end", "step limit")
    assert page.run(SHOWN) == "1–25 of 30 trials"
    choose(page, "failure", "target_grounding")
    assert page.run(SHOWN) == "1–1 of 1 trials"
    choose(page, "task", "Press_Stapler_Repeat")
    assert page.run(SHOWN) == "no trial matches"
    page.click("button[type=reset]")
    page.wait(f"{SHOWN} === '1–25 of {COUNT} trials'")


def test_text_search_needs_every_word(page: Page) -> None:
    choose(page, "text", "TAKE 17 size")
    assert [row[2] for row in page.run(ROWS)] == ["17", "117"]
    choose(page, "text", "wrong object_1")
    assert [row[2] for row in page.run(ROWS)] == ["1"]


def test_a_failure_types_button_lists_its_trials(page: Page) -> None:
    page.click(".of-kind[data-kind=target_grounding]")
    page.wait(f"{SHOWN} === '1–1 of 1 trials'")
    assert page.run(ROWS)[0][4] == "target grounding"


def test_what_a_run_is_and_how_good_stands_on_the_first_screen(page: Page) -> None:
    page.look(1280, 860)
    for part in ("header .lead", ".card .big", ".of-kind", ".panels figure", "#videos h2"):
        found = f"[...document.querySelectorAll('{part}')]"
        bottoms = page.run(f"{found}.map(e => e.getBoundingClientRect().bottom)")
        assert 0 < max(bottoms) <= 860, part


def test_columns_sort_both_ways(page: Page) -> None:
    choose(page, "level", "2")
    steps = "#list th[data-name=steps] button"
    page.click(steps)
    assert [row[6] for row in page.run(ROWS)] == [str(n) for n in range(10)]
    page.click(steps)
    assert [row[6] for row in page.run(ROWS)] == [str(n) for n in reversed(range(10))]
    assert page.run("document.querySelector('[data-name=steps]').ariaSort") == "descending"


def test_the_keyboard_alone_opens_a_trial_and_moves_on(page: Page) -> None:
    page.run("document.querySelector('#list button.open').focus()")
    page.press("ArrowDown", 40)
    page.press("Enter", 13, "\r")
    assert page.run("document.activeElement.ariaExpanded") == "true"
    assert page.run("document.querySelector('tr.open').rowIndex") == 2
    page.press("Enter", 13, "\r")
    assert page.run("document.querySelector('tr.detail')") is None


@pytest.mark.parametrize("place", [".films", "tr.detail"])
def test_an_event_seeks_the_video_to_its_moment(page: Page, place: str) -> None:
    choose(page, "video", "yes")
    page.click("#list button.open")
    page.click(f"{place} .events li:nth-child(2) button")
    film = f"document.querySelector('{place} video')"
    page.wait(f"{film}.readyState >= 2 && !{film}.seeking")
    assert page.run(f"{film}.currentTime") == pytest.approx(4.0 / 2)
    page.wait(f"document.querySelector('{place} [aria-current=true]')?.dataset.time === '4'")
    page.run(f"{film}.currentTime = 0")
    page.wait(f"{film}.currentTime === 0 && !{film}.seeking")
    page.click(f"{place} .jump")  # beside the failure's evidence
    at = page.run("data.trials[1].at")
    page.wait(f"{film}.currentTime === {at / 2} && !{film}.seeking")


@pytest.mark.parametrize("width", [1200, 390])
@pytest.mark.parametrize("dark", [False, True])
def test_both_themes_and_widths(page: Page, width: int, dark: bool) -> None:
    page.look(width, dark=dark)
    page.click("#list button.open")
    for element in ("details", "tr.detail"):
        page.run(f"document.querySelectorAll('{element}').forEach(e => {{ e.open = true; }})")
    assert page.run("document.documentElement.scrollWidth") == width
    ground = page.run("getComputedStyle(document.body).backgroundColor")
    assert (ground == "rgb(255, 255, 255)") is not dark


def test_the_theme_can_be_chosen(page: Page) -> None:
    ground = "getComputedStyle(document.body).backgroundColor"
    light = page.run(ground)
    page.click("#theme")
    assert page.run(ground) == light
    page.click("#theme")
    assert page.run(ground) != light
    page.click("#theme")
    assert page.run(ground) == light


def test_intervals_are_shown_if_asked(page: Page) -> None:
    after = "getComputedStyle(document.querySelector('td[data-interval]'), '::after').content"
    assert page.run(after) == "none"
    page.click("#intervals")
    assert page.run(after).startswith('"[')


def test_an_address_leads_to_the_same_trials_and_the_opened_one(page: Page) -> None:
    choose(page, "task", "Press_Stapler_Repeat")
    page.click("#list button.open")
    named = page.run("location.hash")
    assert named == "#task=Press_Stapler_Repeat&trial=0+Press_Stapler_Repeat+2+0"
    page.run("window.before = true")
    page.call("Page.reload")
    page.wait("!window.before && document.readyState === 'complete'")
    assert page.run(SHOWN) == "1–10 of 10 trials"
    assert page.run("document.querySelector('tr.open').dataset.trial").endswith(" 2 0")
    page.run("document.querySelector('.filters button[type=reset]').click()")
    page.wait(f"{SHOWN}.endsWith('of {COUNT} trials')")
    assert "task" not in page.run("location.hash")


def test_an_address_leads_to_a_trial_of_a_later_page(page: Page) -> None:
    page.run("location.hash = 'trial=0 Pick_Blocks_Size 1 119'")
    page.wait("!!document.querySelector('tr.open')")
    assert page.run("document.querySelector('tr.open').dataset.trial").endswith(" 1 119")
    page.run("location.hash = 'summary'")  # the sections' own addresses go on working
    assert page.run("document.querySelectorAll('tr.open').length") == 1


def test_a_film_shows_its_first_frame_and_plays_at_the_chosen_speed(page: Page) -> None:
    film = "document.querySelector('.films video')"
    at = page.run("data.trials[1].at")
    assert page.run(f"{film}.src").endswith(f"#t={at / 2:.2f}"), "the failure's moment"
    page.run(
        "(() => { const s = document.querySelector('.films .speed select'); s.value = '4';"
        "s.dispatchEvent(new Event('change')); })()"
    )
    assert page.run(f"{film}.playbackRate") == 4


def test_a_trial_stands_beside_the_same_scene_in_the_other_run(page: Page, two_runs: Path) -> None:
    page.open(two_runs)
    page.click("#list button.open")
    ends = "[...document.querySelectorAll('.side h4 .end')].map(e => e.innerText)"
    assert page.run(ends) == ["step limit", "success"]
    tops = "[...document.querySelectorAll('.side video')].map(v => v.getBoundingClientRect().top)"
    assert len(set(page.run(tops))) == 1
    assert len(page.run(tops)) == 2
    page.click(".together")
    page.wait("[...document.querySelectorAll('.side video')].every(v => !v.paused || v.ended)")
    page.look(390)
    assert page.run("document.documentElement.scrollWidth") == 390


def test_a_trial_that_the_other_run_filmed_not_has_no_button(page: Page, two_runs: Path) -> None:
    page.open(two_runs)
    choose(page, "text", "2")
    page.click("#list button.open")
    assert page.run("document.querySelectorAll('.side > div').length") == 2
    assert page.run("document.querySelector('.together')") is None
    code = "document.querySelector('.side code').innerText"
    folder = two_runs.parent.parent / "one"
    assert page.run(code) == f"robospa view {folder} Pick_Blocks_Size-L1-2"


def test_a_flipped_pair_stands_side_by_side_once_its_axis_is_opened(
    page: Page, tmp_path: Path
) -> None:
    clean = shown("Pick_Blocks_Size", 1, 5, True, candidates=2, video="videos/a.mp4")
    other = shown("Pick_Blocks_Size", 1, 5, False, candidates=2)
    other = replace(other, key=replace(other.key, mode="randomized:blur=4"))
    run = make_run(tmp_path / "run", [clean, other], settings={"profile": True})
    (tmp_path / "run" / "videos").mkdir()
    write_film(tmp_path / "run" / "videos" / "a.mp4", 2)
    page.open(write_report(make_report(run), tmp_path / "report") / "report.html")
    assert page.run("document.querySelectorAll('.pairs video').length") == 0
    page.click(".pairs summary")
    page.wait("document.querySelectorAll('.pairs .side video').length === 1")
    text = page.run("document.querySelector('.pairs').innerText")
    for part in ("clean: success", "blur=4: step limit", "--film makes it", other.key.slug):
        assert part in text
