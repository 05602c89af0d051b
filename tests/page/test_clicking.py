"""The page in a real browser, clicked and typed at: a run that is played, a stretch that is zoomed, the stop button."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from rw_ekf.page.server import Access, Place
from tests.page.runs import RunOnDisk
from tests.page.test_server import Served
from tools.measure.browser import CHROMIUM, Browser

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine draws the page"),
]
SPAN_S = 199.9  # of 2000 rows
CHART = '.chart[role="img"]'  # the first one, over time
SEEN = "document.querySelector('.now').textContent"
DRAWN = "document.querySelectorAll('.chart canvas').length === 10"


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Browser]:
    """A headless Chromium; at its end nothing was written to the console."""
    with Browser(tmp_path / "profile") as browser:
        yield browser
        assert browser.stated == []


@pytest.fixture
def run(tmp_path: Path) -> RunOnDisk:
    """A run of 2000 rows, that nothing publishes any more."""
    run = RunOnDisk(tmp_path / "runs")
    run.add(2000)
    return run


def seen(browser: Browser) -> tuple[str, str]:
    """From when to when, as the page says it."""
    first, _, last = browser.value(SEEN).removesuffix(" since the start").partition(" to ")
    return first, last


def test_a_finished_run_is_played_from_its_start_and_paused(run: RunOnDisk, browser: Browser) -> None:
    """Play shows what was known then, and more of it later; Pause holds it; at speed 600 it ends by itself."""
    page = Served(Place([run.folder]), Access.of("127.0.0.1"))
    try:
        browser.open(page.address)
        browser.until(DRAWN)
        assert browser.until("document.querySelector('.pill').textContent") == "ended"
        assert seen(browser) == ("0:00.0", "3:19")
        browser.click(".play")
        assert browser.value("document.querySelector('.play').textContent") == "Pause"
        browser.until(f"{SEEN}.startsWith('0:00.0 to 0:0')")
        early = browser.value("shown[0].until")
        browser.until(f"shown[0].until > {early} + 1")
        browser.click(".play")
        held = browser.until("shown[0].playing === false && shown[0].until")
        assert 0.0 < held < SPAN_S
        rows = browser.value("shown[0].charts[0].plot.data[0].length")
        assert rows == pytest.approx(10.0 * held, abs=15.0)
        time.sleep(0.5)  # a clock that had gone on would show it
        assert browser.value("shown[0].until") == held
        browser.value("document.querySelector('.speed').value = '600'")
        browser.click(".play")
        browser.until("shown[0].until === null && !shown[0].playing")
        browser.until(f"{SEEN} === '0:00.0 to 3:19 since the start'")
        assert browser.value("document.querySelector('.play').textContent") == "Play"
    finally:
        page.close()


def test_keys_zoom_and_pan_the_time_line(run: RunOnDisk, browser: Browser) -> None:
    """On a chart that has the focus: + shows half of it, the arrow an earlier quarter, - twice as much, Home all."""
    page = Served(Place([run.folder]), Access.of("127.0.0.1"))
    try:
        browser.open(page.address)
        browser.until(DRAWN)
        browser.value(f"document.querySelector('{CHART}').focus()")
        for key, expected in (
            ("+", (0.25, 0.75)), ("+", (0.375, 0.625)), ("ArrowLeft", (0.3125, 0.5625)), ("-", (0.1875, 0.6875)),
            ("Home", (0.0, 1.0)),
        ):  # fmt: skip
            before = browser.value(SEEN)
            browser.key(key)
            browser.until(f"{SEEN} !== {before!r}")
            scale = browser.value("[shown[0].charts[0].plot.scales.x.min, shown[0].charts[0].plot.scales.x.max]")
            assert [(end - 100.0) / SPAN_S for end in scale] == pytest.approx(expected, abs=1e-6)
    finally:
        page.close()


def test_the_stop_button_asks_once_and_then_stops(run: RunOnDisk, browser: Browser) -> None:
    """The button alone stops nothing, nor does `Go on`; the one in the question does, once, and says how it went."""
    stops: list[int] = []

    def stop() -> dict[str, bool]:
        stops.append(1)
        return {"zero_confirmed": True}

    run.publish()
    page = Served(Place([run.folder], stop), Access.of("127.0.0.1"))
    try:
        browser.open(f"{page.address}/#token={page.token}")
        browser.until(f"{DRAWN} && !document.getElementById('stop').hidden")
        browser.click("#stop")
        browser.until("document.getElementById('sure').open")
        browser.click("#sure-no")
        browser.until("!document.getElementById('sure').open")
        assert stops == []
        browser.click("#stop")
        browser.until("document.getElementById('sure').open")
        assert stops == []
        browser.click("#sure-yes")
        browser.until("answer.textContent === 'The wheel has confirmed zero current.'")
        assert stops == [1]
    finally:
        page.close()


def test_alarms_that_are_on_are_listed_and_go_when_they_are_over(run: RunOnDisk, browser: Browser) -> None:
    """As they are published: under the state, each with its sentence; a click on one shows when it began."""
    alarm = {
        "name": "friction", "text": "since 10:20:30 UTC Coulomb friction is 40 % above", "since_s": 150.0,
        "since_utc": "2026-11-27T10:20:30Z",
    }  # fmt: skip
    run.publish(alarms=[alarm, alarm | {"name": "rubs", "text": "it rubs", "since_s": 160.0}])
    page = Served(Place([run.folder]), Access.of("127.0.0.1"))
    try:
        browser.open(page.address)
        browser.until(DRAWN)
        assert browser.value("document.querySelector('.alarms').innerText") == f"2 alarms on\n{alarm['text']}\nit rubs"
        browser.click(".alarms li:last-child button")
        browser.until(f"{SEEN} === '0:45 to 1:15 since the start'")
        run.publish()
        browser.until("document.querySelector('.alarms').innerText === 'No alarm on'")
        assert not browser.value("document.querySelector('.alarms').classList.contains('on')")
    finally:
        page.close()
