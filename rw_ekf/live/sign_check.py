"""The watch over sign and size of the motor gain, in the loop: neither a wrong sign nor an odd size is driven on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from rw_ekf.numbers import plus_minus
from rw_ekf.records import Tick
from rw_ekf.watch.sign_watch import SignWatch

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
        self._said: dict[str, str] = {}
        self._confirmed = confirmed

    @property
    def confirmed(self) -> bool:
        """Whether a motion of this wheel has shown sign and size of its gain, in this run or before, and none else."""
        return self._confirmed and not self._said

    @property
    def doubt(self) -> str | None:
        """What was found to be wrong; None if nothing."""
        return next(iter(self._said.values()), None)

    def step(self, tick: Tick) -> None:
        """Take one turn of the loop."""
        pieces = self._watch.pieces
        self._watch.add(tick)
        if self._watch.pieces == pieces:
            return
        if self._watch.is_wrong and WRONG_SIGN not in self._said:
            text = self._wrong_sign()
            self._tell(WRONG_SIGN, text)
            if self._forbid is not None:
                self._forbid(text)
        factor = self._watch.odd_factor
        if factor is not None and not self._said:
            text = self._odd_gain(factor)
            self._tell(ODD_GAIN, text)
            if self._forbid is not None:
                self._forbid(text)
        if not self._confirmed and not self._said and self._watch.is_right:
            self._confirmed = True
            gain, std = self._watch.gain
            text = f"a positive current turns the wheel forward: its motor gain is {plus_minus(gain, std)} rad/s^2/A"
            self._logger.info("sign_confirmed", text=text)

    def _tell(self, event: str, text: str) -> None:
        self._said[event] = text
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
