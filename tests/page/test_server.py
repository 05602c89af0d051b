"""The page's server: what it answers, whom it refuses, and that nobody who is slow costs anybody anything."""

from __future__ import annotations

import asyncio
import json
import shutil
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import uvicorn

import rw_ekf
from rw_ekf.page.diagnosis_on_request import Reports, report_path
from rw_ekf.page.page_process import _listening
from rw_ekf.page.run_feed import RunFeed
from rw_ekf.page.server import Access, Place, Watcher, page_app
from rw_ekf.page.text_screen import picture_of
from tests.page.runs import RunOnDisk


class Served:
    """The page of a folder, served in this process."""

    def __init__(self, place: Place, access: Access) -> None:
        listening = _listening("127.0.0.1", 0)
        self.address = f"http://127.0.0.1:{listening.getsockname()[1]}"
        self.token = access.token
        self._server = uvicorn.Server(
            uvicorn.Config(page_app(place, access), log_level="error", lifespan="off", timeout_graceful_shutdown=1)
        )
        self._thread = threading.Thread(target=self._server.run, kwargs={"sockets": [listening]}, daemon=True)
        self._thread.start()

    def get(self, path: str, *, token: str = "", host: str = "", method: str = "GET") -> tuple[int, Any, Any]:
        """Status, headers and body (JSON as what it says)."""
        headers = {"x-token": token} | ({"host": host} if host else {})
        request = urllib.request.Request(self.address + path, headers=headers, method=method)
        try:
            with urllib.request.urlopen(request, timeout=60) as answer:
                body = answer.read()
                kind = answer.headers["content-type"]
                return answer.status, answer.headers, json.loads(body) if "json" in kind else body.decode()
        except urllib.error.HTTPError as error:
            body = error.read()
            return error.code, error.headers, json.loads(body) if body.startswith(b"{") else body.decode()

    def close(self) -> None:
        """End it."""
        self._server.should_exit = True
        self._thread.join(10)


@pytest.fixture
def run(tmp_path: Path) -> RunOnDisk:
    """A run of 200 rows that lives."""
    run = RunOnDisk(tmp_path / "runs")
    run.add(200)
    run.publish()
    run.tell(event="state", state="TRACKING", time_s=100.0, reason="readings come")
    return run


@pytest.fixture
def stops() -> list[str]:
    """What was stopped."""
    return []


@pytest.fixture
def served(run: RunOnDisk, stops: list[str]) -> Iterator[Served]:
    """Its folder's page, from which it can be stopped."""

    def stop() -> dict[str, Any]:
        stops.append("stop")
        return {"zero_confirmed": True}

    page = Served(Place([run.folder], stop), Access.of("127.0.0.1"))
    yield page
    page.close()


def test_the_page_and_its_files_fetch_nothing_from_elsewhere(served: Served) -> None:
    """Every answer has the policy that forbids it, and no file names another place to fetch from."""
    status, headers, text = served.get("/")
    assert status == 200
    assert "default-src 'none'" in headers["content-security-policy"]
    names = [part.split('"')[0] for part in text.split('"static/')[1:]]
    assert len(names) >= 5
    for name in names:
        status, headers, body = served.get(f"/static/{name}")
        assert (status, headers["x-content-type-options"]) == (200, "nosniff")
        assert 'fetch("http' not in body
        assert "@import" not in body
    assert served.get("/static/../server.py")[0] == 404
    assert served.get("/static/uPlot.LICENSE")[0] == 404


def test_a_history_and_the_list_of_runs(served: Served, run: RunOnDisk) -> None:
    """Rows, events and state of the newest run, or of one by name; wrong input is told what is wrong."""
    assert served.get("/api/runs")[2] == {"runs": [run.name], "stop": True, "wheels": 1}
    reported = served.get("/api/history")[2]
    assert len(reported["log"]["time_s"]) == 200
    assert reported["state"]["run_state"] == "TRACKING"
    assert reported["events"][0]["state"] == "TRACKING"
    assert len(served.get("/api/history?points=20&from=110&to=112")[2]["log"]["time_s"]) <= 21
    assert served.get("/api/history?points=x")[0] == 400
    status, _, body = served.get("/api/history?run=../../etc/passwd")
    assert status == 404
    assert "there is no run" in body["error"]


def test_what_is_believed_is_numbers_or_refused(served: Served) -> None:
    """Of the curve: an object of [value, sigma], finite and above zero; anything else is a mistake of who asks."""
    assert served.get("/api/curve?believed=%7B%22coulomb%22:%5B0.5,0.1%5D%7D")[0] == 200
    for odd in ("x", "3", "%5B1%5D", "%7B%22c%22:1%7D", "%7B%22c%22:%5B1,-1%5D%7D", "%7B%22c%22:%5B1,NaN%5D%7D"):
        assert served.get(f"/api/curve?believed={odd}")[0] == 400


@pytest.mark.parametrize("top", ["nan", "inf", "-inf", "x"])
def test_nobody_s_question_ends_what_others_see(served: Served, run: RunOnDisk, top: str) -> None:
    """A top that is no number is refused, and who watches goes on to get rows and curves."""
    with urllib.request.urlopen(f"{served.address}/api/live", timeout=60) as answer:
        assert answer.readline() == b": hello\n"
        assert served.get(f"/api/curve?top={top}")[0] == 400
        for _ in range(2):
            run.add(5)
            for line in answer:
                if line.startswith(b"data: ") and json.loads(line[6:])["kind"] == "rows":
                    break


def test_where_looking_fails_nobody_is_left_with_an_old_picture(
    run: RunOnDisk, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The stream ends, with the last that is published in front; whoever asks again is answered again."""
    feed = RunFeed(run.log)

    async def messages() -> list[bytes]:
        watcher = Watcher(feed)
        monkeypatch.setattr(watcher, "_tell", lambda *_: 1 / 0)
        async with watcher.client() as queue:
            task = watcher._task
            assert task is not None
            found = [await asyncio.wait_for(queue.get(), 60.0) for _ in range(2)]
            with pytest.raises(ZeroDivisionError):
                await task
            return found

    last, over = asyncio.run(messages())
    assert json.loads(last.removeprefix(b"data: "))["kind"] == "state"
    assert over == b""


def test_a_run_that_publishes_nothing_any_more_is_not_shown_as_one_that_tracks(run: RunOnDisk) -> None:
    """Its process lives and hangs: the state is stale, and since when is said; a run that has ended is not stale."""
    state = RunFeed(run.log).state()
    assert state is not None
    assert (state["alive"], state["stale"], state["reason"]) == (True, False, "readings come and are used")
    run.publish(utc="2026-11-27T10:20:47.5Z")
    state = RunFeed(run.log).state()
    assert state is not None
    assert state["stale"]
    assert "the daemon hangs, or its disk does or is full" in state["reason"]
    assert "no news, was TRACKING" in picture_of((state, "x"), 120)
    run.publish(utc="2026-11-27T10:20:47.5Z", start_ticks=1)
    state = RunFeed(run.log).state()
    assert state is not None
    assert (state["alive"], state["stale"]) == (False, False)


def test_a_watcher_tells_the_curve_as_it_is_learned(run: RunOnDisk, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a new model on disk: what new rows believe is drawn, up to the fastest that was seen."""
    monkeypatch.setattr("rw_ekf.page.server._LOOK_S", 0.01)
    monkeypatch.setattr("rw_ekf.page.server._CURVE_S", 0.02)
    model = rw_ekf.fit(rw_ekf.simulate("identification", duration_s=120.0, seed=2)).model
    model.save(run.folder / f"{run.name}.start.yaml")

    async def reported() -> dict[str, Any]:
        async with Watcher(RunFeed(run.log)).client() as queue:
            while True:
                for event in (await asyncio.wait_for(queue.get(), 60.0)).decode().split("\n\n")[:-1]:
                    message = json.loads(event.removeprefix("data: "))
                    if message["kind"] == "models":
                        run.add(200)
                    if message["kind"] == "curve":
                        return dict(message)

    curve = asyncio.run(reported())
    assert curve["now"]["speed_rad_s"][-1] == pytest.approx(44.0, abs=1.0)
    assert curve["now"]["friction_rad_s2"] != curve["began"]["friction_rad_s2"]


def test_the_runs_of_a_line_whose_wheels_have_folders_of_their_own(run: RunOnDisk, tmp_path: Path) -> None:
    """All are listed, the newest first, and how many wheels the button stops is told."""
    other = RunOnDisk(tmp_path / "elsewhere", run.name.replace("2026", "2027"))
    other.add(10)
    page = Served(Place([run.folder, other.folder], dict, wheels=2), Access.of("127.0.0.1"))
    try:
        assert page.get("/api/runs")[2] == {"runs": [other.name, run.name], "stop": True, "wheels": 2}
        assert len(page.get(f"/api/history?run={other.name}")[2]["log"]["time_s"]) == 10
    finally:
        page.close()


def test_who_was_not_sent_here_is_refused(served: Served, stops: list[str]) -> None:
    """A name that is not this machine's; a stop without the token; with it, the wheel is stopped once."""
    assert served.get("/api/runs", host="evil.example")[0] == 421
    assert served.get("/api/runs", host="localhost:99")[0] == 200
    assert served.get("/api/stop", method="POST")[0] == 403
    assert served.get("/api/stop", method="POST", token="wrong")[0] == 403
    assert served.get("/api/stop", method="POST", token="\u00e9")[0] == 403
    assert served.get("/api/stop", token=served.token)[0] == 405
    assert stops == []
    assert served.get("/api/stop", method="POST", token=served.token)[2] == {"zero_confirmed": True}
    assert stops == ["stop"]


def test_beyond_this_machine_nothing_is_told_without_the_token(run: RunOnDisk) -> None:
    """Where others can ask, each question needs it; the page itself, which says nothing, does not."""
    page = Served(Place([run.folder]), Access("0.0.0.0", "secret", wanted_always=True))
    try:
        assert page.get("/")[0] == 200
        assert page.get("/api/runs")[0] == 403
        assert page.get("/api/runs", token="secret")[0] == 200
        assert page.get("/api/runs", token="secret", host="192.0.2.7:80")[0] == 200
        assert page.get("/api/runs", token="secret", host="rebound.example")[0] == 421
        assert page.get("/api/stop", token="secret", method="POST")[0] == 404  # opened without a configuration
    finally:
        page.close()


def test_new_rows_come_to_who_is_connected(served: Served, run: RunOnDisk) -> None:
    """Rows that are written after the connection come as they are, and the state with them."""
    request = urllib.request.Request(f"{served.address}/api/live")
    with urllib.request.urlopen(request, timeout=60) as answer:
        kinds: dict[str, Any] = {}
        written = False
        for line in answer:
            if not line.startswith(b"data: "):
                continue
            message = json.loads(line[6:])
            kinds[message["kind"]] = message
            if not written:
                run.add(5)
                written = True
            if "rows" in kinds and "state" in kinds:
                break
    assert kinds["rows"]["log"]["time_s"] == pytest.approx([120.0, 120.1, 120.2, 120.3, 120.4])
    assert kinds["state"]["alive"] is True


def test_a_client_that_does_not_read_costs_a_bounded_memory(run: RunOnDisk) -> None:
    """Its queue never grows beyond what it may be behind; it is told so, and others get every message."""

    async def watched() -> tuple[list[bytes], int]:
        watcher = Watcher(None)  # type: ignore[arg-type]  # nobody looks: messages are told by hand
        slow: asyncio.Queue[bytes] = asyncio.Queue(64)
        quick: asyncio.Queue[bytes] = asyncio.Queue(64)
        watcher.clients = {slow, quick}
        got = 0
        for number in range(1000):
            watcher._tell({"kind": "rows", "number": number})
            while not quick.empty():
                quick.get_nowait()
                got += 1
        return [slow.get_nowait() for _ in range(slow.qsize())], got

    left, got = asyncio.run(watched())
    assert got == 1000
    assert len(left) <= 64
    assert b"behind" in left[0]


CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine draws the page")
@pytest.mark.parametrize("width", [390, 1440])
def test_a_browser_draws_it_without_an_error(served: Served, run: RunOnDisk, tmp_path: Path, width: int) -> None:
    """State, parameters, events and a chart for each are there, nothing is written to the console, nothing is wider."""
    assert CHROMIUM is not None
    command = [
        CHROMIUM, "--headless=new", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}",
        "--enable-logging=stderr", f"--window-size={width},1200", "--virtual-time-budget=8000", "--dump-dom",
        f"{served.address}/#token={served.token}",
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    page = done.stdout
    assert "CONSOLE" not in done.stderr, done.stderr
    assert ">TRACKING<" in page
    assert page.count('class="chart"') == 10  # five over time and speed, the friction, four parameters
    assert "motor gain [rad/s²/A]" in page
    assert "TRACKING: readings come" in page
    assert '<button id="stop" type="button">' in page
    assert 'aria-label="speed, read and believed' in page


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine draws the page")
def test_a_compensated_run_shows_what_was_asked_for_and_what_was_added(
    served: Served, run: RunOnDisk, tmp_path: Path
) -> None:
    """What went out is their sum: the last command of 0.1 cos(0.05 199) A, and 0.02 A of it added."""
    names, *rows = run.estimates.read_text().splitlines()
    run.estimates.write_text("\n".join([f"{names},compensation_A", *(f"{row},0.02" for row in rows)]) + "\n")
    command = [
        str(CHROMIUM), "--headless=new", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}",
        "--enable-logging=stderr", "--virtual-time-budget=8000", "--dump-dom", served.address,
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert "CONSOLE" not in done.stderr, done.stderr
    assert 'aria-label="under compensation: what was asked for, and what was added: -0.1065 + 0.02 A"' in done.stdout


@pytest.mark.slow
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on this machine draws the page")
def test_the_button_of_a_line_says_whom_it_stops(run: RunOnDisk, tmp_path: Path) -> None:
    """How many wheels, before it is pressed and where it asks; the newest run is shown, without an error."""
    RunOnDisk(run.folder, "2025-11-27T10-20-06Z_other")
    page = Served(Place([run.folder], dict, wheels=2), Access.of("127.0.0.1"))
    command = [
        str(CHROMIUM), "--headless=new", "--no-sandbox", "--disable-gpu", f"--user-data-dir={tmp_path / 'profile'}",
        "--enable-logging=stderr", "--virtual-time-budget=8000", "--dump-dom", f"{page.address}/#token={page.token}",
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    page.close()
    assert "CONSOLE" not in done.stderr, done.stderr
    assert done.stdout.count("Stop all 2 wheels</button>") == 2
    assert "of all 2 wheels of the line" in done.stdout
    assert ">TRACKING<" in done.stdout


def test_the_verb_says_where_the_page_is_and_ends_with_a_signal(run: RunOnDisk) -> None:
    """`rw-ekf view DIR --listen 127.0.0.1:0` prints one address, answers there, and SIGTERM ends it."""
    command = [sys.executable, "-m", "rw_ekf", "view", str(run.folder), "--listen", "127.0.0.1:0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as view:
        assert view.stdout is not None
        address, _, token = view.stdout.readline().strip().partition("#")
        assert token.startswith("token=")
        with urllib.request.urlopen(f"{address}api/runs", timeout=60) as answer:
            assert json.loads(answer.read()) == {"runs": [run.name], "stop": False, "wheels": 1}
        view.terminate()
        view.wait(20)


@pytest.mark.parametrize(
    ("words", "stated"),
    [
        (["nowhere"], "no such file or folder"),
        ([".", "--listen", "here"], "HOST:PORT"),
        ([".", "--listen", "127.0.0.1:99999"], "HOST:PORT"),
        ([".", "--listen", "203.0.113.7:8000"], "cannot be served there"),
    ],
)
def test_wrong_input_is_told_in_one_line(words: list[str], stated: str, capsys: pytest.CaptureFixture[str]) -> None:
    """With status 2, and no trace of Python."""
    from rw_ekf.cli import main

    assert main(["view", *words]) == 2
    assert stated in capsys.readouterr().err


def test_a_report_is_made_with_the_token_alone_and_is_one_link_away(served: Served, run: RunOnDisk) -> None:
    """Nobody without the token begins a diagnosis; the report that is there is served without script, by its link."""
    assert served.get("/api/report")[2] == {"report": "none"}
    assert served.get("/api/report", method="POST")[0] == 403
    made = run.folder / f"{run.name}.report" / "report.html"
    made.parent.mkdir()
    made.write_text("<h1>adequate</h1>")
    reported = served.get("/api/report")[2]
    status, headers, body = served.get(f"/{reported['link']}")
    assert (status, body) == (200, "<h1>adequate</h1>")
    assert headers.get_all("content-security-policy")[-1].startswith("sandbox; default-src 'none'")
    assert served.get("/report/guessed")[0] == 404


@pytest.mark.slow
def test_the_report_of_a_run_is_its_diagnosis(tmp_path: Path) -> None:
    """Made in a process of its own, kept beside the run; of a log that cannot be diagnosed the reason is told."""
    log = rw_ekf.simulate("identification", duration_s=200.0, seed=3)
    for name, text in (("good", None), ("torn", "time_s,speed_rpm,current_A\n0.0,x,0.1\n")):
        path = tmp_path / f"2026-11-27T10-20-06Z_{name}.csv"
        log.save(path) if text is None else path.write_text(text)
        reports = Reports()
        reports.begin(path)
        while (reported := reports.state(path))["report"] == "working":
            time.sleep(0.2)
        assert reported["report"] == ("ready" if text is None else "failed"), reported
        if text is None:
            assert "<html" in report_path(path).read_text()
        else:
            assert "is not a number" in reported["text"]
