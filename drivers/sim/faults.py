"""Faults of a simulated wheel and of its line: what there is, when each is at work, and how often it strikes.

Time is the wheel's, so that a schedule is the same at any speed factor and on a virtual clock. What is random about a
fault comes from a seed and from that fault's own place in the list alone.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

TO, FROM, BOTH = "to", "from", "both"  # the wheel
LINE, WHEEL, CABLE = "line", "wheel", "cable"  # where a fault works: on bytes, on what the wheel says, on the port


class Share(NamedTuple):
    """How many of what a fault could strike it does strike."""

    probability: float = 1.0
    one_of: int = 0  # every so manieth, counted; 0: drawn at random


class FaultKind(NamedTuple):
    """A word of the grammar. amounts: what may be given behind it, in order, with the defaults."""

    place: str
    way: str | None  # unless another is given; None: it has none
    amounts: dict[str, Any]
    what: str


ALL = Share()
KINDS: dict[str, FaultKind] = {
    "drop": FaultKind(LINE, BOTH, {"share": ALL}, "a message is lost"),
    "cut": FaultKind(LINE, BOTH, {"count": 5, "share": ALL}, "only the first `count` bytes of a message come through"),
    "flip": FaultKind(LINE, BOTH, {"share": ALL, "count": 1}, "`count` bits of a message are wrong"),
    "insert": FaultKind(LINE, BOTH, {"share": ALL, "count": 8}, "`count` bytes of junk before and behind a message"),
    "duplicate": FaultKind(LINE, BOTH, {"share": ALL}, "a message comes twice"),
    "dribble": FaultKind(LINE, BOTH, {"time": 0.005, "share": ALL}, "a message comes byte by byte, one each `time`"),
    "delay": FaultKind(LINE, BOTH, {"time": 0.016, "share": ALL}, "a message comes later by `time`"),
    "reorder": FaultKind(LINE, BOTH, {"share": ALL}, "a message is kept until the next one of its way has gone"),
    "hold": FaultKind(
        LINE, FROM, {"time": 0.0}, "bytes are held and come at once: every `time`, or at the end where that is 0"
    ),
    "silence": FaultKind(LINE, FROM, {}, "nothing comes through; the wheel hears, takes commands, and is not heard"),
    "flood": FaultKind(LINE, FROM, {"number": 1000.0}, "`number` bytes of junk a second"),
    "echo": FaultKind(LINE, None, {"share": ALL}, "what is sent to the wheel comes back as it is, as on two wires"),
    "seq": FaultKind(WHEEL, None, {"share": ALL, "count": 1}, "a reply bears the seq of `count` requests ago"),
    "id": FaultKind(WHEEL, None, {"share": ALL}, "a reply bears the id of another register"),
    "length": FaultKind(WHEEL, None, {"share": ALL}, "a reply has one data byte too many, with a good checksum"),
    "repeat": FaultKind(WHEEL, None, {"share": ALL}, "telemetry is the first reply of the stretch again, clock too"),
    "freeze": FaultKind(WHEEL, None, {"name": "all"}, "the field `name`, or all, stands still; the uptime goes on"),
    "value": FaultKind(WHEEL, None, {"value": None, "share": ALL}, "a field reads `value`, e.g. speed=nan, in SI"),
    "spike": FaultKind(WHEEL, None, {"number": 500.0, "share": ALL}, "the speed reads `number` rpm off, either way"),
    "nack": FaultKind(WHEEL, None, {"count": 4, "share": ALL}, "a write is refused with status `count`, and not done"),
    "nack-acted": FaultKind(WHEEL, None, {"count": 4, "share": ALL}, "a write is done, and refused all the same"),
    "residue": FaultKind(
        WHEEL, None, {"number": 0.3}, "a current of zero is acknowledged, and `number` times the last one is left on"
    ),
    "flag": FaultKind(WHEEL, None, {"count": 1}, "the flags `count` of the status register are up"),
    "heat": FaultKind(WHEEL, None, {"number": 80.0}, "the wheel is `number` degC hot"),
    "reset": FaultKind(WHEEL, None, {}, "the wheel restarts: idle, no current, uptime from 0; once a stretch"),
    "clock": FaultKind(WHEEL, None, {"time": 3600.0}, "the wheel's clock jumps by `time`; once a stretch"),
    "dead": FaultKind(
        WHEEL, None, {}, "the wheel has no power: it hears and says nothing, and comes back as from a reset"
    ),
    "serial": FaultKind(WHEEL, None, {"count": 77}, "another wheel answers: its serial number is `count`"),
    "hangup": FaultKind(CABLE, None, {}, "the port is gone, and comes back under its name"),
    "block": FaultKind(CABLE, None, {}, "the far end takes no bytes, so that output backs up"),
}


@dataclass(frozen=True)
class Fault:
    """A fault with its schedule: from start_s for lasts_s, again every period_s where there is one [s].

    share, count, number, name and time_s are the amounts of its kind; what the kind has not is of no meaning.
    """

    kind: str
    way: str | None = None
    register: str | None = None  # only in replies from, or writes to, the register of that name
    share: Share = ALL
    count: int = 0
    number: float = 0.0
    name: str = ""
    time_s: float = 0.0
    start_s: float = 0.0
    lasts_s: float = math.inf
    period_s: float | None = None
    text: str = ""

    def stretch_s(self, time_s: float) -> float | None:
        """Return when the stretch began that holds time_s [s]; None where the fault is not at work."""
        since_s = time_s - self.start_s
        if since_s < 0.0:
            return None
        began_s = self.start_s
        if self.period_s is not None:
            began_s += self.period_s * math.floor(since_s / self.period_s)
        return began_s if time_s - began_s < self.lasts_s else None

    def next_change_s(self, time_s: float) -> float:
        """Return when, after time_s [s], the fault next begins or ends; infinity where it never does."""
        if time_s < self.start_s:
            return self.start_s
        began_s = self.stretch_s(time_s)
        if began_s is not None and math.isfinite(self.lasts_s):
            return began_s + self.lasts_s
        if self.period_s is None:
            return math.inf
        return self.start_s + self.period_s * (math.floor((time_s - self.start_s) / self.period_s) + 1.0)


class FaultAtWork:
    """A fault in a run: its random numbers, its count, and what it remembers of the present stretch."""

    def __init__(self, fault: Fault, seed: str) -> None:
        self.fault = fault
        self.random = random.Random(seed)
        self.memory: dict[Any, Any] = {}
        self.struck = 0
        self._could = 0
        self._began_s: float | None = None

    def is_on(self, time_s: float) -> bool:
        """Whether it is at work at time_s [s]; what it remembers is of that stretch alone."""
        began_s = self.fault.stretch_s(time_s)
        if began_s != self._began_s:
            self._began_s = began_s
            self.memory.clear()
        return began_s is not None

    def strikes(self, time_s: float) -> bool:
        """Whether it strikes what comes by at time_s [s]; queried once for each thing that it could strike."""
        if not self.is_on(time_s):
            return False
        share = self.fault.share
        self._could += 1
        if share.one_of:
            hit = self._could % share.one_of == 0
        else:
            hit = share.probability >= 1.0 or self.random.random() < share.probability
        self.struck += hit
        return hit

    def begins(self, time_s: float) -> bool:
        """Whether a stretch of it has begun that was not queried before."""
        if not self.is_on(time_s) or "begun" in self.memory:
            return False
        self.memory["begun"] = True
        self.struck += 1
        return True


class FaultInjector:
    """The faults of one wheel. `put` may be called by another thread than the one that serves the wheel."""

    def __init__(self, faults: Iterable[Fault] = (), seed: int = 0) -> None:
        self._seed = seed
        self._count = 0
        self._at_work: tuple[FaultAtWork, ...] = ()
        self._found = _Now((), math.inf, math.inf, {}, ())
        self.put(*faults)

    def put(self, *faults: Fault) -> None:
        """Let these faults be at work and no others, from one moment to the next."""
        made = []
        for fault in faults:
            made.append(FaultAtWork(fault, f"{self._seed}/{self._count}/{fault.kind}"))
            self._count += 1
        self._at_work = tuple(made)

    def struck(self) -> dict[str, int]:
        """How often each kind has struck so far, of the faults that are there."""
        counts: dict[str, int] = {}
        for one in self._at_work:
            counts[one.fault.kind] = counts.get(one.fault.kind, 0) + one.struck
        return counts

    def by_kind(self, time_s: float) -> Mapping[str, Sequence[FaultAtWork]]:
        """Those that are at work at time_s [s] by their kind, each kind in the order given; empty where none is."""
        return self._now(time_s).by_kind

    def on(self, kind: str, time_s: float) -> Sequence[FaultAtWork]:
        """Those of a kind that are at work at time_s [s], in the order given."""
        now = self._found  # as `_now` has it, without a call: it is queried thrice for every look at a line
        if now.of is not self._at_work or not now.from_s <= time_s < now.until_s:
            now = self._now(time_s)
        return now.by_kind.get(kind, ())

    def on_line(self, way: str, register: str | None, time_s: float) -> Iterator[FaultAtWork]:
        """Those that work on messages of one way at time_s [s]; register: whose reply it is."""
        for one in self._now(time_s).on_line:
            if one.fault.way in (way, BOTH) and one.fault.register in (None, register):
                yield one

    def striking(self, kind: str, time_s: float, register: str | None = None) -> FaultAtWork | None:
        """The first fault of a kind that strikes at time_s [s] what concerns a register."""
        for one in self.on(kind, time_s):
            if one.fault.register in (None, register) and one.strikes(time_s):
                return one
        return None

    def next_change_s(self, time_s: float) -> float:
        """Return when after time_s [s] a fault next begins or ends."""
        return self._now(time_s).until_s

    def _now(self, time_s: float) -> _Now:
        """What is at work, found anew only where that may have changed: a long schedule costs nothing in between."""
        now = self._found
        if now.of is not self._at_work or not now.from_s <= time_s < now.until_s:
            every = self._at_work
            on = [one for one in every if one.is_on(time_s)]
            by_kind: dict[str, list[FaultAtWork]] = {}
            for one in on:
                by_kind.setdefault(one.fault.kind, []).append(one)
            on_line = [one for one in on if KINDS[one.fault.kind].place == LINE]
            until_s = min((one.fault.next_change_s(time_s) for one in every), default=math.inf)
            self._found = now = _Now(every, time_s, until_s, by_kind, on_line)
        return now


class _Now(NamedTuple):
    """What is at work from one time until another [s], of these faults."""

    of: tuple[FaultAtWork, ...]
    from_s: float
    until_s: float
    by_kind: Mapping[str, Sequence[FaultAtWork]]
    on_line: Sequence[FaultAtWork]
