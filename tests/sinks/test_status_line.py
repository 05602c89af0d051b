"""What a person sees while a run lasts: a line that fits any terminal, and elsewhere a log line now and then."""

from __future__ import annotations

import io
import os
import time

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rw_ekf import console
from rw_ekf.clock import VirtualClock
from rw_ekf.control.commanders import commander_of
from rw_ekf.records import ActiveAlarm, IssuedCommand, WheelSample, WheelState
from rw_ekf.settings.schema import CommandSection
from rw_ekf.sinks import status_line
from rw_ekf.sinks.status_line import LEGEND, StatusLine, concise, elapsed_text, status_text
from tests.live.daemon import Notes
from tests.ticks import tick_of

MEAN = WheelState(-123.456789, 15.2049123, 0.00322111, 0.5863123, 0.6037)
STD = WheelState(0.05, 0.0213, 0.000041, 0.00213, 0.0213)


def shown(line: StatusLine, time_s: float, current_A: float = -0.14000000000000001, alarms: int = 0) -> None:
    """One sample at a time of the wheel's clock."""
    on = tuple(ActiveAlarm(str(i), "text", "since", 0.0) for i in range(alarms))
    line.write(tick_of(WheelSample(time_s, MEAN.speed_rad_s), IssuedCommand(current_A), MEAN, STD, on))


class Screen(io.StringIO):
    """A terminal as standard error."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        super().__init__()
        self.columns = 80
        monkeypatch.setenv("TERM", "xterm")
        monkeypatch.setattr("sys.stderr", self)
        monkeypatch.setattr("os.get_terminal_size", lambda descriptor: os.terminal_size((self.columns, 24)))

    def isatty(self) -> bool:
        return True

    def fileno(self) -> int:
        return 2

    def take(self) -> str:
        """What has been written since."""
        text = self.getvalue()
        self.seek(0)
        self.truncate()
        return text


@pytest.mark.parametrize("columns", [20, 40, 60, 80, 100, 120, 200])
def test_the_line_is_never_as_wide_as_the_terminal(monkeypatch: pytest.MonkeyPatch, columns: int) -> None:
    """At every width, and after a change of it, each refresh stays in its row; legend and units are said once."""
    screen = Screen(monkeypatch)
    screen.columns = columns
    line = StatusLine(Notes(), VirtualClock(), lambda: 600.0, lambda time_s: "coast-downs", every_s=0.0)
    shown(line, 1000.0, alarms=2)
    legend, _, first = screen.take().rpartition("\n\r")
    refreshes = [first]
    assert " ".join(legend.split()) == LEGEND
    shown(line, 1012.3, alarms=2)
    screen.columns = 50
    shown(line, 1012.4, alarms=2)
    refreshes += screen.take().split("\r")[1:]
    line.close()
    assert screen.take() == "\n"
    texts = [text.removesuffix("\x1b[K") for text in refreshes]
    assert len(texts) == 3
    assert [len(text) < width for text, width in zip(texts, (columns, columns, 50), strict=True)] == [True] * 3
    assert texts[0].startswith("0/600 s")
    assert texts[1].startswith("12/600 s")
    if columns >= 80:
        for word in ("tracking", "-1178.9 rpm", "-140.0 mA", "2 alarms", "coast-downs"):
            assert word in texts[1]
    if columns >= 120:
        assert texts[1].endswith("k 15.20(2)  c 0.586(2)  b 0.00322(4)  s 0.60(2)")


@pytest.mark.parametrize(
    ("term", "no_color", "coloured", "moves"),
    [("xterm", "", True, True), ("xterm", "1", False, True), ("dumb", "", False, False)],
)
def test_colour_and_cursor_are_used_where_they_are_wanted(
    monkeypatch: pytest.MonkeyPatch, term: str, no_color: str, coloured: bool, moves: bool
) -> None:
    """NO_COLOR takes the colour of log lines; TERM=dumb that, the changing line and the bar, and a run logs instead."""
    screen = Screen(monkeypatch)
    monkeypatch.setattr(console, "STATUS", console.Status())
    monkeypatch.setattr(status_line, "STATUS", console.STATUS)
    monkeypatch.setenv("TERM", term)
    monkeypatch.setenv("NO_COLOR", no_color)
    console.logger().warning("event", text="said")
    assert ("\x1b[3" in screen.take()) is coloured
    with console.progress("work", 2, delay_s=0.0) as bar:
        bar.update(1)
    assert ("\r" in screen.take()) is moves
    notes = Notes()
    shown(StatusLine(notes, VirtualClock(), lambda: None, every_s=0.0, log_every_s=0.0), 5.0)
    assert ("\x1b" in screen.take()) is moves
    assert notes.events == ([] if moves else ["running"])


def test_a_pipe_is_told_how_far_the_work_is(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where no line can be taken back, progress is whole lines, later and later; short work says nothing."""
    monkeypatch.setattr(console, "_LINE_S", 0.01)
    with console.progress("work", 4, " runs") as bar:
        bar.update(3)
        time.sleep(0.2)
    stated = capsys.readouterr().err.splitlines()
    assert 1 <= len(stated) <= 4  # after 0.01, 0.03, 0.07 and 0.15 s
    assert set(stated) == {"rw-ekf: work: 3 of 4 runs, 0 s"}
    monkeypatch.setattr(console, "_LINE_S", 60.0)
    with console.progress("work", 4, " runs") as bar:
        bar.update(4)
    assert capsys.readouterr().err == ""


def test_log_lines_go_above_the_line(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is logged meanwhile stands in a row of its own, and the changing line comes back below it."""
    screen = Screen(monkeypatch)
    line = StatusLine(Notes(), VirtualClock(), lambda: None, every_s=0.0)
    shown(line, 5.0)
    screen.take()
    console.STATUS.say("said")
    assert screen.take().startswith("\r\x1b[Ksaid\n0 s  tracking")


def test_without_a_terminal_a_line_is_logged_now_and_then() -> None:
    """No terminal: an event of the log with elapsed and total time, phase, state, speed, current, estimates, alarms."""
    notes = Notes()
    line = StatusLine(notes, VirtualClock(), lambda: 30.0, lambda time_s: "creep", log_every_s=0.0)
    shown(line, 7.0)
    shown(line, 7.1)
    assert notes.events == ["running", "running"]
    reported = notes.stated[-1][1]
    assert reported["elapsed_s"] == 0.1
    assert reported["of_s"] == 30.0
    assert reported["current_mA"] == -140.0
    assert reported["motor_gain"] == "15.20(2) rad/s^2/A"
    assert (reported["phase"], reported["state"], reported["alarms"]) == ("creep", "tracking", 0)
    silent = Notes()
    shown(StatusLine(silent, VirtualClock(), lambda: None), 7.0)
    assert silent.events == []


def test_the_first_line_into_a_pipe_comes_soon() -> None:
    """Within ten seconds a run without a terminal says how it stands, and then once a minute, without readings too."""
    notes, clock, stated_s = Notes(), VirtualClock(), []
    line = StatusLine(notes, clock, lambda: None)
    while clock.monotonic() < 200.0:
        before = len(notes.events)
        shown(line, 7.0)
        if len(notes.events) > before:
            stated_s.append(round(clock.monotonic()))
        clock.sleep(0.1)
    assert stated_s == [8, 68, 128, 188]


def test_a_wheel_whose_clock_leaps_has_not_run_longer() -> None:
    """A leap of an hour, a step back and another segment count as no time."""
    notes = Notes()
    line = StatusLine(notes, VirtualClock(), lambda: None, log_every_s=0.0)
    for time_s in (10.0, 10.5, 3610.5, 3611.0, 11.0, 11.5):
        shown(line, time_s)
    assert notes.stated[-1][1]["elapsed_s"] == 1.5


@given(st.lists(st.text(st.characters(codec="ascii", exclude_characters="\n\r"), max_size=30)), st.integers(1, 150))
def test_no_text_is_wider_than_asked_for(fields: list[str], width: int) -> None:
    """Whatever the fields, the line fits."""
    assert len(status_text(fields, width)) <= width


@pytest.mark.parametrize(
    ("value", "std", "text"),
    [
        (15.2049, 0.0213, "15.20(2)"), (0.58631, 0.00096, "0.586(1)"), (15.2, 4.4, "15(4)"),
        (1523.0, 99.0, "1500(100)"), (-0.5, 0.05, "-0.50(5)"), (3.0, 0.0, "3"), (3.0, float("nan"), "3"),
        (3.22e-3, 4.1e-5, "0.00322(4)"), (0.6, 9.6, "0(10)"),
    ],
)  # fmt: skip
def test_values_have_the_digits_that_sigma_allows(value: float, std: float, text: str) -> None:
    """The value ends at the place of sigma's first digit."""
    assert concise(value, std) == text


def test_elapsed_time() -> None:
    """With and without an end."""
    assert (elapsed_text(12.4, 600.0), elapsed_text(12.4, None)) == ("12/600 s", "12 s")


def test_the_phases_of_a_profile() -> None:
    """Identification says what it is at; every other profile says its name."""
    commander = commander_of(CommandSection(profile="identification"))
    assert commander.lasts_s() == 600.0
    assert [commander.phase(t) for t in (0.0, 63.9, 64.1, 300.0, 599.9, 700.0)] == [
        "reversals", "reversals", "creep", "coast-downs", "creep", "creep",
    ]  # fmt: skip
    assert commander_of(CommandSection(profile="sine")).phase(5.0) == "sine"


def test_numbers_of_log_lines_have_six_digits(capsys: pytest.CaptureFixture[str]) -> None:
    """Currents are not shown with seventeen digits; times keep a tenth of a second."""
    console.logger("json").warning("slewed", current_A=0.30000000000000004, since_s=1234567.891, n=3)
    reported = capsys.readouterr().err
    assert '"current_A": 0.3,' in reported
    assert '"since_s": 1234567.9,' in reported
