"""Faults drawn at random, the same every time for a seed: what a soak puts a wheel through."""

from __future__ import annotations

import math
import random
from collections.abc import Collection

from rw_ekf.drivers.sim.fault_text import parse_fault
from rw_ekf.drivers.sim.faults import Fault

# How each is written; `{low~high}` is a number drawn between them, evenly in its logarithm. Behind it, how long it may
# last [s]; 0: it happens and is over.
LOTS: tuple[tuple[str, float, float], ...] = (
    ("drop:{0.02~1}", 0.1, 60.0),
    ("drop/to:{0.05~1}", 0.1, 10.0),
    ("cut/from:7:{0.1~1}", 0.1, 10.0),
    ("flip:{0.02~1}:1", 0.1, 60.0),
    ("insert:{0.05~1}:20", 0.1, 60.0),
    ("duplicate:{0.05~1}", 0.1, 60.0),
    ("dribble/from:{0.0005~0.005}", 0.1, 30.0),
    ("delay/from:{0.002~0.3}:{0.05~1}", 0.1, 30.0),
    ("reorder/from:{0.05~0.5}", 0.1, 30.0),
    ("hold/from", 0.05, 5.0),
    ("hold/from:16ms", 1.0, 60.0),
    ("silence", 0.1, 30.0),
    ("silence/cycle", 0.1, 10.0),
    ("silence/current_command", 0.1, 10.0),
    ("flood/from:{100~3000}", 0.1, 10.0),
    ("echo", 1.0, 60.0),
    ("seq:{0.05~1}", 0.1, 10.0),
    ("id:{0.05~1}", 0.1, 10.0),
    ("length:{0.05~1}", 0.1, 10.0),
    ("repeat/cycle", 0.2, 10.0),
    ("freeze:speed", 0.2, 30.0),
    ("freeze", 0.2, 30.0),
    ("value:speed={1~1500}:{0.02~0.3}", 0.1, 10.0),
    ("spike:{50~5000}:{0.02~0.3}", 0.1, 20.0),
    ("nack/current_command", 0.1, 10.0),
    ("nack-acted/current_command:4:{0.1~1}", 0.1, 10.0),
    ("flag:1", 0.5, 20.0),
    ("heat:{61~120}", 0.5, 60.0),
    ("reset", 0.0, 0.0),
    ("clock:{0.5~5000}", 0.0, 0.0),
    ("hangup", 0.1, 60.0),
    ("block", 0.1, 20.0),
)


def drawn_faults(
    seed: int, duration_s: float, mean_gap_s: float = 120.0, kinds: Collection[str] | None = None
) -> tuple[Fault, ...]:
    """Draw a schedule of faults over duration_s [s] of wheel time, in order of their beginnings.

    Between the end of one and the next there are mean_gap_s [s] on average, at least 2 s: sometimes one falls upon the
    recovery from another. kinds: draw of these words alone. Each fault's text is what `rw-ekf simulate --fault` takes.
    Raises ValueError where there is nothing to draw from.
    """
    lots = [lot for lot in LOTS if kinds is None or _word(lot[0]) in kinds]
    if not lots or not mean_gap_s > 0.0:
        raise ValueError(f"no fault to draw every {mean_gap_s} s of {kinds}")
    chance = random.Random(seed)
    drawn: list[Fault] = []
    time_s = 2.0 + chance.expovariate(1.0 / mean_gap_s)
    while time_s < duration_s:
        text, shortest_s, longest_s = chance.choice(lots)
        lasts_s = _evenly(chance, shortest_s, longest_s) if longest_s > 0.0 else 1.0
        drawn.append(parse_fault(f"{_filled(chance, text)}@{time_s:.3f}s:{lasts_s:.3f}s"))
        time_s += lasts_s + 2.0 + chance.expovariate(1.0 / mean_gap_s)
    return tuple(drawn)


def _word(text: str) -> str:
    return text.split(":", maxsplit=1)[0].split("/", maxsplit=1)[0]


def _filled(chance: random.Random, text: str) -> str:
    """The text with its numbers drawn."""
    while "{" in text:
        before, _, rest = text.partition("{")
        span, _, after = rest.partition("}")
        low, _, high = span.partition("~")
        text = f"{before}{_evenly(chance, float(low), float(high)):.4g}{after}"
    return text


def _evenly(chance: random.Random, low: float, high: float) -> float:
    return math.exp(chance.uniform(math.log(low), math.log(high)))
