"""`rw-ekf commission` as a process on a pseudo terminal: what it refuses, and a signal while the wheel is watched."""

from __future__ import annotations

import io
import json
import signal
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.contract import check_document
from tests.live.bench import Bench, program, rw_ekf, served_wheel, wait_for

LIMITS = ("--current-limit", "0.4", "--speed-limit", "3000", "--speed-ratio", "1")


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    """A wheel on a pty."""
    with served_wheel(tmp_path) as made:
        yield made


def arguments(bench: Bench, tmp_path: Path, *more: str) -> tuple[str, ...]:
    """The verb on the bench's wheel, with a document."""
    port, out = str(bench.directory / bench.link), str(tmp_path / "out")
    return ("commission", "--port", port, "--out", out, "--json", *more)


@pytest.mark.slow
def test_without_limits_or_an_agreement_nothing_is_written_to_the_wheel(bench: Bench, tmp_path: Path) -> None:
    """Nobody is there to be asked: status 2 naming the option each time, a document of the error, no write at all."""
    for more, option in (
        (("--yes",), "--current-limit and --speed-limit"),
        (("--yes", *LIMITS[:4]), "--speed-ratio"),
        (LIMITS, "--yes"),
    ):
        done = rw_ekf(*arguments(bench, tmp_path, *more))
        assert done.returncode == 2, done.stderr
        assert option in json.loads(done.stdout)["error"]["messages"][0]
    assert bench.recorder.writes_A() == []


@pytest.mark.slow
@pytest.mark.parametrize("name", ["SIGINT", "SIGHUP"])
def test_a_signal_ends_it_with_zero_and_its_document(bench: Bench, tmp_path: Path, name: str) -> None:
    """While the wheel is watched at rest: status 0, only zero was ever written, what was found is in the document."""
    with program(*arguments(bench, tmp_path, "--yes", *LIMITS)) as running:
        wait_for(lambda: bool(bench.recorder.writes_A()) or running.poll() is not None)
        assert running.poll() is None, running.communicate()
        running.send_signal(getattr(signal, name))
        out, errors = running.communicate(timeout=30)
    assert running.returncode == 0, errors
    document = json.loads(out)
    check_document(document)
    assert not document["done"]
    assert document["find"]["protocol"] == "sunspace-wheel"
    assert document["still"] is None
    assert set(bench.recorder.writes_A()) == {0.0}
    assert "goes on" in errors
    assert "Traceback" not in errors


def test_a_number_that_is_none_is_asked_for_again_with_the_reason(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`abc` and `-1` are told apart from a number; Enter takes what is suggested."""
    from rw_ekf.commands import commission

    monkeypatch.setattr(commission, "_is_terminal", lambda: True)
    monkeypatch.setattr("sys.stdin", io.StringIO("abc\n-1\n0.3\n\n"))
    terminal = commission.Terminal(as_json=False)
    assert terminal.number("largest current [A]", 0.2) == 0.3
    stated = capsys.readouterr().err
    assert "'abc' is no number" in stated
    assert "'-1' is not above zero" in stated
    assert terminal.number("largest current [A]", 0.2) == 0.2
