"""Whatever watches over one run, put together: readings, state, sign, alarms; and what each may do about it."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any

from rw_ekf.clock import Clock
from rw_ekf.driver import WheelProtocol
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.estimator import Estimator
from rw_ekf.learning.run_start import GivenModel, Start
from rw_ekf.live.alarm_watch import alarm_watch_of
from rw_ekf.live.guard import SafetyLimits
from rw_ekf.live.live_wheel import LiveWheel
from rw_ekf.live.run_judge import RunJudge
from rw_ekf.live.run_states import RunStates
from rw_ekf.live.sign_check import SignCheck
from rw_ekf.live.telemetry import TelemetryCheck
from rw_ekf.numbers import plus_minus
from rw_ekf.records import Alarms, RunState, Tick
from rw_ekf.watch.current_watch import CurrentWatch
from rw_ekf.watch.sign_watch import SignWatch
from rw_ekf.watch.stuck_watch import ParameterBelief, StuckWatch
from rw_ekf.wheel.wheel_tag import WheelTag

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration

_SURE = 5.0  # standard deviations
_HUMS = 4.0  # steps or noises of a reading within which a dead line hums


class RunWatches:
    """The watches of one run on a wheel that has been opened; `live` is judged by them from here on."""

    def __init__(
        self,
        configuration: Configuration,
        protocol: WheelProtocol,
        start: Start,
        expectation: str,
        estimator: Estimator,
        live: LiveWheel,
        logger: Any,
        clock: Clock,
    ) -> None:
        """expectation: whose the expected motor gain is, as in "... what the model says"."""
        self._start = start
        self._live = live
        constants, resolution = estimator.constants, protocol.limits.speed_step_rad_s
        noise = constants.speed_noise_rad_s
        writes = configuration.command.writes
        self.step_rad_s = max(resolution, noise)  # of a reading, or its noise
        limits = SafetyLimits.of(configuration.limits)
        exact = (resolution, noise, limits.silence_s, *constants.stribeck)

        first = ParameterBelief(start.origin.prior.parameters, start.origin.prior.parameter_covariance)

        def belief() -> ParameterBelief:
            return ParameterBelief(estimator.parameters, estimator.parameter_covariance)

        self.check = TelemetryCheck(
            logger.warning,
            tuple(StuckWatch(*exact, within_rad_s=width, first=first) for width in (0.0, _HUMS * self.step_rad_s)),
            belief,
            CurrentWatch(limits.current_A) if writes else None,
            lambda: self.sign.confirmed or not configuration.command.confirm_sign,
            writes=writes,
        )
        self.states = RunStates(clock, partial(_tell_state, logger), latches=writes)
        self.sign_watch = SignWatch(start.origin.prior.parameters, constants.stribeck.omega_s, self.step_rad_s)
        self.judge = RunJudge(
            self.states,
            self.check,
            limits,
            1.0 / configuration.loop.rate_hz,
            self.sign_watch,
            belief,
            tells_temperature=protocol.limits.hottest_degC is not None,
            stribeck=None if start.setup.effects.size else constants.stribeck,
        )
        live.judged_by(self.check, lambda: self.judge.hold, self.judge.speed_limit, self.judge.slowing)
        self.sign = SignCheck(
            self.sign_watch,
            protocol.scale_places,
            expectation,
            confirmed=start.wheel.sign_confirmed,
            forbid=self._forbid if writes else None,
            found=self.check.found,
            logger=logger,
        )
        self.alarms = alarm_watch_of(configuration, constants, start.setup.inertia_kg_m2, logger, clock)

    @property
    def wheel(self) -> WheelTag:
        """The wheel, with what is known of its sign by now."""
        return replace(self._start.wheel, sign_confirmed=self.sign.confirmed)

    @property
    def doubt(self) -> str | None:
        """Why nothing of this run may be kept as learned."""
        return self.sign.doubt or self.check.doubt or self.states.forbidden

    def step(self, tick: Tick) -> Alarms:
        """Take one turn of the loop; what the alarms are."""
        self.sign.step(tick)
        self.judge.commanded(tick.command)
        return Alarms() if self.alarms is None else self.alarms.step(tick)

    def find_negative_gain(self, belief: Belief) -> None:
        """At the end: a negative motor gain is a finding where nothing of the kind was found before."""
        gain, std = belief.parameters.motor_gain, belief.parameter_std.motor_gain
        if self._live.halted is None and self.states.forbidden is None and gain + _SURE * std < 0.0:
            self.check.found(
                "negative_gain",
                f"the motor gain is estimated as {plus_minus(gain, std)} rad/s^2/A, and no "
                "wheel has a negative one: a sign in the wire map is wrong, or the readings were not the wheel's",
            )

    def _forbid(self, why: str) -> None:
        self.states.latch(why, for_good=True)
        self._live.zero_now()


def expectation_of(configuration: Configuration, given: GivenModel) -> str:
    """Say where the expected motor gain comes from."""
    if given.model is not None:
        return "the model says"
    prior = configuration.filter.prior
    named = prior is not None and prior.motor_gain is not None
    return "filter.prior.motor_gain says" if named else "the built-in prior says"


def _tell_state(logger: Any, event: str, **context: Any) -> None:
    """A change of state as an event: no warning where it is for the better."""
    well = context.get("state") in (RunState.CONNECTING, RunState.TRACKING)
    (logger.info if well else logger.warning)(event, **context)
