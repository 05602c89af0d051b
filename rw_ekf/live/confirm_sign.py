"""Whether a run begins with the small move that confirms a wheel's sign and gain, and what is said of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from rw_ekf.control.commanders import Commander
from rw_ekf.control.confirming_move import ConfirmingMove, MoveLimits
from rw_ekf.live.guard import SafetyLimits
from rw_ekf.model.state import FrictionParameters
from rw_ekf.watch.sign_watch import LONGEST_STEP_S, SignWatch

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration

_LATER = "the profile begins all the same, and what it moves is judged in the same way"
_HELD = "Only zero is written until a person has looked and says `rw-ekf run --resume`"


def confirming(
    commander: Commander,
    configuration: Configuration,
    watch: SignWatch,
    step_rad_s: float,
    latch: Callable[[str], None],
    logger: Any,
    place: str,
) -> Commander:
    """The commander behind the small move, where the configuration lets it move the wheel.

    step_rad_s: of a reading (or noise). place: where the scale of what is written stands in the wire map. latch: holds
    zero, for a reason, until a person says resume. Only for a wheel whose sign and gain were never confirmed.
    """
    period_s = 1.0 / configuration.loop.rate_hz
    stands = configuration.command.profile == "zero" and not configuration.takes_torques
    if not configuration.command.confirm_sign or stands:
        return commander
    if period_s >= LONGEST_STEP_S:
        logger.warning("sign_not_confirmed", text=f"at one reading in {period_s:g} s no small move shows it; {_LATER}")
        return commander
    limits = SafetyLimits.of(configuration.limits)
    move = ConfirmingMove(
        commander.controller,
        watch,
        watch.expected,
        MoveLimits(limits.current_A, limits.slew_A_per_s, limits.speed_rad_s, period_s, step_rad_s),
        lambda move: _say(move, watch, limits, latch, logger, place),
    )
    logger.info(
        "confirming_sign",
        text="sign and gain of this wheel were never confirmed through this wire map: before the profile it is moved a "
        f"little, by +-{move.current_A:.3g} A for a few seconds",
    )
    return replace(commander, controller=move, move=move)


def _say(
    move: ConfirmingMove, watch: SignWatch, limits: SafetyLimits, latch: Callable[[str], None], logger: Any, place: str
) -> None:
    """Say how the move ended where the watch over the sign has not said it: right, wrong and odd are its own words.

    A wheel that was not seen to move where it should have, or not as currents move one, is not driven.
    """
    if watch.is_settled:
        return
    expected = True
    if watch.opposite.is_certain:
        text = f"{watch.opposite.text(place)}."
    elif watch.pieces > 0:
        text = (
            f"{move.lasted_s:.3g} s of pulses up to {move.current_A:.3g} A showed no motion that follows from them: is "
            "the speed reading the wheel's?"
        )
    else:
        text = f"{move.current_A:.3g} A did not move the wheel"
        if move.current_A >= limits.current_A:
            text += " (limits.current_A"
            away_A = _breaks_away_A(watch.expected)
            expected = away_A <= move.current_A
            text += ")" if expected else f"; by what is believed of its friction {away_A:.3g} A would)"
        text += ": is the speed reading the wheel's, or is the wheel held fast?" if expected else f"; {_LATER}"
    logger.warning("sign_not_confirmed", text=f"{text} {_HELD}" if expected else text)
    if expected:
        latch(text)


def _breaks_away_A(believed: FrictionParameters) -> float:
    return believed.static / believed.motor_gain if believed.motor_gain > 0.0 else 0.0
