"""What the wheel may be driven to, and that somebody has agreed to it: before this step nothing but reads is done."""

from __future__ import annotations

from typing import Any

from rw_ekf.commissioning.contradicted_signs import UNKNOWN
from rw_ekf.commissioning.dialogue import RefusedError
from rw_ekf.commissioning.step_context import Work
from rw_ekf.errors import BadInputError
from rw_ekf.units import rpm_from_rad_s

_CAREFUL_A, _CAREFUL_SHARE = 0.2, 0.1  # of what the wire can carry
_CAREFUL_RPM = 2000.0
_CAREFUL_DEGC = 50.0


def ask_limits(work: Work) -> dict[str, Any]:
    """The limits, by option or by a question. Raises BadInputError where nobody is there to answer."""
    wire = work.protocol_of(work.progress["find"]["protocol"]).limits
    options, by = work.options, "the command line"
    most_A = min(-wire.current_A[0], wire.current_A[1])
    unit = wire.current_unit
    numbers: list[float] = []
    missing = []
    for option, given, question, careful in (
        ("--current-limit", options.current_limit_A, f"largest current [{unit}]",
         min(_CAREFUL_A, _CAREFUL_SHARE * most_A)),
        ("--speed-limit", options.speed_limit_rpm, "largest speed [rpm]",
         min(_CAREFUL_RPM, rpm_from_rad_s(wire.speed_rad_s[1]))),
    ):  # fmt: skip
        value = given
        if value is None:
            value, by = (
                work.dialogue.number(f"{question} that the wheel may be driven to", float(f"{careful:.2g}")),
                "a person",
            )
        if value is None:
            missing.append(option)
            continue
        numbers.append(value)
    if missing:
        raise BadInputError(
            f"{' and '.join(missing)}: give the limits within which the wheel may be moved; nobody is there to be "
            "asked, and --yes agrees to the move, not to limits that were not given"
        )
    for option, value, most, of in (
        ("--current-limit", numbers[0], most_A, unit),
        ("--speed-limit", numbers[1], rpm_from_rad_s(wire.speed_rad_s[1]), "rpm"),
    ):
        if value > most:
            raise BadInputError(f"{option} {value:g}: the wire map carries no more than {most:.5g} {of}: give less")
    heat = options.temperature_limit_degC
    if heat is None and wire.hottest_degC is not None:
        heat = min(_CAREFUL_DEGC, wire.hottest_degC)
    current_A, speed_rpm = numbers
    return {"current_A": current_A, "speed_rpm": speed_rpm, "temperature_degC": heat, "unit": unit, "by": by}


def agree_to_move(work: Work) -> None:
    """Have it agreed to that the wheel is moved within the limits. Raises RefusedError, BadInputError."""
    limits = work.progress["limits"]
    if work.progress["sign"] is None and work.options.speed_ratio is None and work.dialogue.tachometer("") is None:
        raise BadInputError(UNKNOWN)
    what = (
        f"the wheel will be moved: first a little, then for ten minutes, by up to {limits['current_A']:.4g} "
        f"{limits['unit']} and up to {limits['speed_rpm']:.4g} rpm both ways. Is it fastened, and free to turn?"
    )
    if work.options.yes:
        work.dialogue.say("limits", f"{what} Agreed to by --yes")
        return
    agreed = work.dialogue.agree(what)
    if agreed is None:
        raise BadInputError("nobody is there to agree that the wheel is moved: give --yes")
    if not agreed:
        raise RefusedError("nobody agreed that the wheel is moved: nothing was written to it")
