"""Which sign or scale of a wire map the readings of a move contradict, and what becomes of it.

The command, its echo, the measured current, the speed and the angle describe one motion. A sign that stands alone
against the others is the wrong one. Where the speed alone contradicts the command, which of the two is turned is a
matter of what one calls forward: the speed is, so that a positive current turns the wheel forward; which is reported.
A size that two of them contradict cannot be laid on either: that is refused.

The scale of speed no line can show by itself: twice the speed is twice the gain and twice the friction, of a wheel that
might exist. So a person holds a tachometer against the wheel while it turns steadily, or says beforehand what true
speed is per reading; else nothing faster than a tenth of the limit is done, and no model is written. Where nobody can
be asked it is refused before anything moves.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from rw_ekf.commissioning.dialogue import RefusedError
from rw_ekf.commissioning.guarded_wheel import Row

_SIZE = 1.25  # by which a measured current may differ from the command: sensors and their offsets
_ECHO_SIZE = 1.03
_ANGLE_SIZE = 1.1
_LEAST_RATIOS = 8
_SMALL = 0.3  # of the largest command: below it the ratio is one of noises

READ, WRITE = "read", "write"
NAMED = {  # mistakes that are usual, true over read
    1.0: "the wire map's scale is right",
    2.0 * math.pi / 60.0: "the wheel tells rpm where the wire map says rad/s",
    60.0 / (2.0 * math.pi): "the wheel tells rad/s where the wire map says rpm",
    0.5: "the wire map's scale is twice what it should be",
    2.0: "the wire map's scale is half of what it should be",
    0.1: "the wire map's scale is ten times what it should be",
    10.0: "the wire map's scale is a tenth of what it should be",
    2.0 * math.pi: "the wheel tells turns per second where the wire map says rad/s",
    60.0: "the wheel tells turns per second where the wire map says rpm",
}
_WITHIN = 0.04  # of a named ratio: a tachometer held by hand, a reading with noise
_LARGEST = 1.0e4

UNKNOWN = (
    "the scale of the speed cannot be known from the line alone: every reading would fit a wheel of another gain. Say "
    "what true speed is per reading (--speed-ratio 1 where the wire map is known to be right), or start on a terminal "
    "and hold a tachometer against the wheel when asked. Nothing faster than a tenth of the speed limit was done"
)


class Ratios(NamedTuple):
    """Against the command, or the speed: None where the telemetry does not show it."""

    measured: float | None
    echo: float | None
    angle: float | None  # its rate over the speed


def ratios_of(rows: Sequence[Row], rest_rad_s: float) -> Ratios:
    """What a move shows of them."""
    largest = max((abs(row.command_A) for row in rows if math.isfinite(row.command_A)), default=0.0)
    measured, echo, angle = [], [], []
    for before, last, row in zip(rows, rows[1:], rows[2:], strict=False):
        if abs(last.command_A) > _SMALL * largest and abs(before.command_A - last.command_A) < 0.2 * abs(
            last.command_A
        ):
            measured += [] if row.current_A is None else [row.current_A / last.command_A]
        if abs(last.command_A) > _SMALL * largest:
            echo += [] if row.echo_A is None else [row.echo_A / last.command_A]
        turned = _turned(last, row, rest_rad_s)
        angle += [] if turned is None else [turned]
    return Ratios(
        *(float(np.median(found)) if len(found) >= _LEAST_RATIOS else None for found in (measured, echo, angle))
    )


def _turned(last: Row, row: Row, rest_rad_s: float) -> float | None:
    """Rate of the angle over the speed, where the number of turns that it made is known."""
    if last.angle_rad is None or row.angle_rad is None or last.speed_rad_s is None or row.speed_rad_s is None:
        return None
    lasts_s, speed = row.time_s - last.time_s, 0.5 * (last.speed_rad_s + row.speed_rad_s)
    if abs(speed) < rest_rad_s or not 0.0 < abs(speed) * lasts_s < 0.5 * math.pi or row.segment != last.segment:
        return None
    step = math.remainder(row.angle_rad - last.angle_rad, 2.0 * math.pi)
    return step / lasts_s / speed


def is_unsigned(forward: Sequence[Row], backward: Sequence[Row]) -> bool:
    """Whether the reading is the same way round whichever way the current drives: it shows no direction."""
    ends = [next((row.speed_rad_s for row in reversed(rows) if row.speed_rad_s), 0.0) for rows in (forward, backward)]
    return ends[0] * ends[1] > 0.0


def turned_signs(gain: float, ratios: Ratios) -> dict[tuple[str, str], float]:
    """Which fields are to be multiplied by -1, of those read and written. Raises RefusedError for odd sizes."""
    _refuse_sizes(ratios)
    against = {
        "speed": gain < 0.0,
        "measured": ratios.measured is not None and ratios.measured < 0.0,
        "echo": ratios.echo is not None and ratios.echo < 0.0,
    }
    reported = [name for name, ratio in (("measured", ratios.measured), ("echo", ratios.echo)) if ratio is not None]
    factors = {}
    if against["speed"] and reported and all(against[name] for name in reported):
        factors["current_command", WRITE] = -1.0  # the command stands alone
    else:
        keys = {"speed": "speed", "measured": "current", "echo": "current_command"}
        factors = {(keys[name], READ): -1.0 for name, is_so in against.items() if is_so}
    if ratios.angle is not None and (ratios.angle < 0.0) != (("speed", READ) in factors):
        factors["angle", READ] = -1.0
    return factors


def _refuse_sizes(ratios: Ratios) -> None:
    for name, ratio, most, fields in (
        ("the current that is measured", ratios.measured, _SIZE, "current_command and of current"),
        ("the command that telemetry tells", ratios.echo, _ECHO_SIZE, "current_command where it is written and read"),
        ("the rate of the angle", ratios.angle, _ANGLE_SIZE, "speed and of angle"),
    ):
        if ratio is not None and not 1.0 / most < abs(ratio) < most:
            beside = "the speed" if "angle" in fields else "what was commanded"
            raise RefusedError(
                f"{name} is {abs(ratio):.3g} times {beside}: one scale of the wire map is wrong, that of {fields}, and "
                "the line does not tell which. Mend it, or leave out a field of another quantity, and start again"
            )


def is_named(ratio: float) -> bool:
    """Whether a usual mistake, or none, explains it."""
    return min(abs(math.log(ratio / known)) for known in NAMED) < _WITHIN


def agreed(first: float, second: float) -> float | None:
    """The mean of two ratios measured at two speeds; None where they contradict each other."""
    return math.sqrt(first * second) if abs(math.log(first / second)) < _WITHIN else None


def named_ratio(ratio: float) -> tuple[float, str]:
    """The ratio that is meant by a measured one (true over read), and a sentence. Raises ValueError for no ratio."""
    if not math.isfinite(ratio) or not 1.0 / _LARGEST < ratio < _LARGEST:
        raise ValueError(f"a ratio of {ratio:g} is none")
    near = min(NAMED, key=lambda known: abs(math.log(ratio / known)))
    if is_named(ratio):
        return near, NAMED[near]
    return ratio, f"the true speed is {ratio:.4g} times the reading, which is no usual mistake of units"
