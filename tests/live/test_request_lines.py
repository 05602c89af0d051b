"""Lines of the request socket without a socket: whole lines of any pieces, numbers or nothing, and fading."""

from __future__ import annotations

import contextlib
import json
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from rw_ekf.live.request_lines import (
    MOST_LINE_BYTES,
    MOST_LINES,
    FadingRequest,
    LineBuffer,
    line_of,
    newest_torque,
    torque_of,
)


@given(st.lists(st.binary(max_size=40)), st.lists(st.integers(1, 50), min_size=1))
def test_lines_do_not_depend_on_the_pieces_they_come_in(lines: list[bytes], sizes: list[int]) -> None:
    """However a stream is cut, the last line is the same, and so is what is left without an end."""
    sent = b"\n".join(lines)
    buffer, got, at = LineBuffer(), [], 0
    while at < len(sent):
        for size in sizes:
            got += buffer.take(sent[at : at + size])
            at += size
    *whole, rest = sent.split(b"\n")
    assert got[-MOST_LINES:] == whole[-MOST_LINES:]
    assert buffer.take(b"!\n")[-1:] == [rest + b"!"]


@given(st.integers(MOST_LINE_BYTES + 1, 4 * MOST_LINE_BYTES), st.integers(1, 5000))
def test_a_line_without_an_end_is_forgotten_and_the_next_is_heard(length: int, size: int) -> None:
    """No more is kept than a request may have; its tail does not pass for a line."""
    buffer, sent = LineBuffer(), b"x" * length + b'{"torque_Nm": 9}\n{"torque_Nm": 1}\n'
    got = [line for at in range(0, len(sent), size) for line in buffer.take(sent[at : at + size])]
    torque_Nm, _ = newest_torque(got)
    assert torque_Nm == 1.0
    assert [line for line in got if len(line) <= MOST_LINE_BYTES] == [b'{"torque_Nm": 1}']
    assert len(buffer._rest) <= MOST_LINE_BYTES


@given(st.floats(allow_nan=False, allow_infinity=False) | st.integers(-(10**300), 10**300))
def test_a_finite_number_is_a_torque(torque_Nm: float) -> None:
    """As JSON writes it, with other keys beside it."""
    assert torque_of(json.dumps({"from": "test", "torque_Nm": torque_Nm}).encode()) == float(torque_Nm)


@pytest.mark.parametrize(
    "line",
    [
        b"", b"1.0", b"[1]", b"{}", b"null", b'{"torque_Nm": null}', b'{"torque_Nm": true}', b'{"torque_Nm": "1"}',
        b'{"torque_Nm": NaN}', b'{"torque_Nm": -Infinity}', b'{"torque_Nm": 1e999}', b'{"torque_nm": 1}',
        b'{"torque_Nm": 1', b'{"torque_Nm": 1' + b"0" * 400 + b"}", b"[" * 4000, b'{"torque_Nm": ' + b"[" * 4000,
        b"\xff\xfe\x00", b"\x00" * 100, b'{"torque_Nm": 1}' + b" " * 5000, b'{"torque_Nm": ' + b"9" * 4050 + b"}",
    ],
)  # fmt: skip
def test_anything_else_is_refused_in_a_sentence(line: bytes) -> None:
    """No number that is none, no key that is misspelt, no depth, no length: ValueError alone."""
    with pytest.raises(ValueError, match="no request"):
        torque_of(line)


@given(st.binary(max_size=300))
def test_bytes_at_random_are_a_torque_or_refused(line: bytes) -> None:
    """Nothing but a finite number or a ValueError comes of any line."""
    with contextlib.suppress(ValueError):
        assert math.isfinite(torque_of(line))


def test_the_newest_request_counts_and_what_is_wrong_behind_it_is_said() -> None:
    """Garbage after a request does not hide it; empty lines are nothing."""
    assert newest_torque([b'{"torque_Nm": 1}', b'{"torque_Nm": 2}', b"", b"oops"])[0] == 2.0
    torque_Nm, wrong = newest_torque([b"oops", b"{}"])
    assert torque_Nm is None
    assert len(wrong) == 2
    assert newest_torque([]) == (None, [])


@given(st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(0.0, 10.0)), max_size=20))
def test_a_request_holds_while_it_is_fresh_and_fades_within_its_time(taken: list[tuple[float, float]]) -> None:
    """As it was for stale_s, never more than it was, zero from stale_s + fade_s on."""
    request, now_s = FadingRequest(0.5, 2.0), 0.0
    assert request.at(7.0) == 0.0
    for value, later_s in taken:
        request.take(value, now_s)
        now = now_s + later_s
        held = request.at(now)
        assert abs(held) <= abs(value)
        age_s = now - now_s  # later_s, but for what the sum rounds away
        assert age_s > 0.5 or held == value
        assert age_s < 2.5 or held == 0.0
        assert request.is_fresh(now) == (age_s <= 0.5)
        now_s = now


def test_an_answer_is_one_line_of_json_without_nan() -> None:
    """What is not a number is null."""
    line = line_of({"state": "TRACKING", "speed_rpm": math.nan, "current_A": -0.25, "compensating": False})
    assert line.endswith(b"}\n")
    assert line.count(b"\n") == 1
    assert json.loads(line) == {"state": "TRACKING", "speed_rpm": None, "current_A": -0.25, "compensating": False}
