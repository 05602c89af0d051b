"""Sign and size of the motor gain, in the loop: neither a wrong sign nor an odd size is driven on.

`confirming` begins a run with the small move that shows them, `SignCheck` watches over them from then on.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from rw_ekf.control.commanders import Commander
from rw_ekf.control.confirming_move import ConfirmingMove, MoveLimits
from rw_ekf.live.guard import SafetyLimits
from rw_ekf.model.state import FrictionParameters
from rw_ekf.numbers import plus_minus
from rw_ekf.records import Tick
from rw_ekf.watch.sign_watch import LONGEST_STEP_S, SignWatch

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration

WRONG_SIGN = "wrong_sign"
ODD_GAIN = "odd_gain"


class SignCheck:
    """Feeds the watch with what was commanded and read, and says what it finds, once."""

    def __init__(
        self,
        watch: SignWatch,
        places: Mapping[str, str],
        expectation: str,
        *,
        confirmed: bool,
        forbid: Callable[[str], None] | None,
        found: Callable[[str, str], None],
        logger: Any,
    ) -> None:
        """places: where the scales of "speed" and "current" stand in the wire map. expectation: whose the gain is.

        confirmed: by an earlier run. forbid: holds zero for the rest of the run; None where it does not drive the
        wheel. found: takes a finding for the document.
        """
        self._watch = watch
        self._places = places
        self._expectation = expectation
        self._forbid = forbid
        self._found = found
        self._logger = logger
        self._stated: dict[str, str] = {}
        self._confirmed = confirmed

    @property
    def confirmed(self) -> bool:
        """Whether a motion of this wheel has shown sign and size of its gain, in this run or before, and none else."""
        return self._confirmed and not self._stated

    @property
    def doubt(self) -> str | None:
        """What was found to be wrong; None if nothing."""
        return next(iter(self._stated.values()), None)

    def step(self, tick: Tick) -> None:
        """Take one turn of the loop."""
        pieces = self._watch.pieces
        self._watch.add(tick)
        if self._watch.pieces == pieces:
            return
        if self._watch.is_wrong and WRONG_SIGN not in self._stated:
            text = self._wrong_sign()
            self._tell(WRONG_SIGN, text)
            if self._forbid is not None:
                self._forbid(text)
        factor = self._watch.odd_factor
        if factor is not None and not self._stated:
            text = self._odd_gain(factor)
            self._tell(ODD_GAIN, text)
            if self._forbid is not None:
                self._forbid(text)
        if not self._confirmed and not self._stated and self._watch.is_right:
            self._confirmed = True
            gain, std = self._watch.gain
            text = f"a positive current turns the wheel forward: its motor gain is {plus_minus(gain, std)} rad/s^2/A"
            self._logger.info("sign_confirmed", text=text)

    def _tell(self, event: str, text: str) -> None:
        self._stated[event] = text
        self._logger.warning(event, text=text)
        self._found(event, text)

    def _wrong_sign(self) -> str:
        gain, std = self._watch.gain
        speed, current = self._scales()
        return (
            f"a positive current turns the wheel backward: its motor gain is {plus_minus(gain, std)} rad/s^2/A. One "
            f"sign in the wire map is wrong: turn the one at {current} or the one at {speed}, whichever is not as the "
            f"wheel has it; readings cannot tell which.{self._held}"
        )

    @property
    def _held(self) -> str:
        return " Only zero is written for the rest of the run." if self._forbid is not None else ""

    def _odd_gain(self, factor: float) -> str:
        gain, std = self._watch.gain
        speed, current = self._scales()
        size = f"{factor:.3g} times" if factor > 1.0 else f"1/{1.0 / factor:.3g} of"
        return (
            f"the motor gain is {plus_minus(gain, std)} rad/s^2/A, {size} what {self._expectation}: is a scale of "
            f"the wire map wrong, {current} or {speed}? If the wheel is like that, give filter.prior.motor_gain, and "
            f"wheel.inertia_kg_m2, on which every torque depends.{self._held}"
        )

    def _scales(self) -> tuple[str, str]:
        places = self._places
        return places.get("speed", "the scale of speed"), places.get("current", "the scale of current_command")


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
    """Report how the move ended where the watch over the sign has not: right, wrong and odd are its own words.

    A wheel that was not seen to move where it should have, or not as currents move one, is not driven.
    """
    if watch.is_settled:
        return
    expected = True
    if watch.opposite.is_certain:
        text = f"{watch.opposite.text(place)}."
    elif watch.lost_s > watch.used_s + watch.quiet_s:
        whole_s = watch.lost_s + watch.used_s + watch.quiet_s
        text = (
            f"lost replies spoilt {watch.lost_s:.2g} of {whole_s:.2g} s of pulses up to {move.current_A:.3g} A, and "
            "the rest does not show what a current does: see to the line."
        )
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
