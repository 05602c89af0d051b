"""Bytes that nobody meant: spoilt inputs through everything that reads bytes (`python -m tools.fuzz.*` for more)."""

from __future__ import annotations

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tools.fuzz.deframer import LONGEST_REST, run
from tools.fuzz.targets import TARGETS, Target

MARKS = "0123456789.,:-{}[]&*!|>'\"#~eE\n nanif"


@st.composite
def spoilt(draw: st.DrawFn, target: Target) -> bytes:
    """A seed of the target with stretches taken out, doubled, or written over; or any bytes at all."""
    content = draw(st.sampled_from(target.seeds))
    for _ in range(draw(st.integers(0, 6))):
        at = draw(st.integers(0, len(content)))
        to = draw(st.integers(at, min(at + 40, len(content))))
        what = draw(st.sampled_from(("out", "twice", "bytes", "text")))
        put = {
            "out": b"",
            "twice": 2 * content[at:to],
            "bytes": draw(st.binary(max_size=8)),
            "text": draw(st.text(MARKS, max_size=8)).encode(),
        }[what]
        content = content[:at] + put + content[to:]
    return content


@pytest.mark.parametrize("name", TARGETS)
def test_spoilt_input_is_refused_or_used(name: str) -> None:
    """Nothing but the error that is promised comes out, for seeds spoilt in many ways and for any bytes."""
    target = TARGETS[name]

    @settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck), derandomize=True)
    @given(st.one_of(spoilt(target), st.binary(max_size=300)))
    def holds(content: bytes) -> None:
        target.run(content)

    for seed in target.seeds:
        target.run(seed)
    holds()


def test_three_hundred_thousand_bytes_through_the_deframer() -> None:
    """Its invariants hold, nearly all good frames come out, and those lost were swallowed by a checksum by chance."""
    count, _ = run(300_000, seed=1)
    assert count.bytes >= 300_000
    assert count.sent > 500
    assert count.received >= 0.999 * count.sent
    assert 0 < count.longest_rest <= LONGEST_REST
    assert count.damaged > 1000
