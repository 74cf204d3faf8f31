"""The report in a real browser: nothing fails, nothing is asked of a network, all can be read."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from deploy.report.compose import compose, write
from deploy.report.runs import look_at
from tests.deploy.browser import PROGRAM, Browser
from tests.deploy.recordings import recording, run, unfinished

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(PROGRAM is None, reason="needs chromium (Debian: apt-get install chromium)"),
]
TELEPHONE, DESK = 400, 1280


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two runs, one of them of a twin that was killed, with a name to trip over."""
    first = look_at(recording(run("storm")), "<img src=x> & co", 1)
    second = recording(run("paper", "run.duration_s=0.5"), timed=False)
    runs = [first, look_at(unfinished(second), "twin", 2)]
    page, pictures = compose(runs)
    pictures.draw()
    return write(page, pictures, tmp_path_factory.mktemp("report"))[0]


@pytest.fixture(scope="module", params=[TELEPHONE, DESK])
def browser(
    request: pytest.FixtureRequest, page: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Browser]:
    with Browser(tmp_path_factory.mktemp("profile")) as browser:
        browser.open(page, request.param)
        yield browser


def test_nothing_fails_in_the_console(browser: Browser) -> None:
    told = {"Runtime.consoleAPICalled", "Runtime.exceptionThrown", "Log.entryAdded"}
    assert [event for event in browser.events if event["method"] in told] == []


def test_no_request_leaves_the_file(browser: Browser, page: Path) -> None:
    asked = [
        event["params"]["request"]["url"]
        for event in browser.events
        if event["method"] == "Network.requestWillBeSent"
    ]
    assert page.as_uri() in asked
    assert {url.partition(":")[0] for url in asked if url != page.as_uri()} <= {"data"}


def test_every_picture_is_shown(browser: Browser) -> None:
    widths = browser.evaluate("[...document.images].map(i => i.complete ? i.naturalWidth : 0)")
    assert len(widths) > 10
    assert all(widths)


def test_the_page_is_not_wider_than_the_window(browser: Browser) -> None:
    """What is wider, a table or a wide figure on a telephone, scrolls by itself."""
    assert browser.evaluate("document.documentElement.scrollWidth") <= browser.width


def test_letters_are_large_enough_to_read(browser: Browser) -> None:
    script = "[...document.querySelectorAll('p, td, th, a, dd')].map(e => getComputedStyle(e)"
    sizes = browser.evaluate(f"{script}.fontSize).map(parseFloat)")
    assert min(sizes) >= 12.0


def test_every_entry_of_the_contents_leads_to_its_section(browser: Browser) -> None:
    script = "[...document.querySelectorAll('nav a')].map(a => !!document.querySelector(a.hash))"
    found = browser.evaluate(script)
    assert len(found) > 5
    assert all(found)


def test_names_are_text_and_no_markup(browser: Browser) -> None:
    assert "<img src=x> & co" in browser.evaluate("document.querySelector('h1').textContent")
    assert browser.evaluate("document.querySelectorAll('h1 img').length") == 0


def test_a_killed_run_says_so_on_top(browser: Browser) -> None:
    warning = browser.evaluate("document.querySelector('header [role=alert]').textContent")
    assert "twin is incomplete" in warning
