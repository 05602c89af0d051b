"""A wheel behind its guard for the time of one step: moves one after another, every reading and command kept.

A move is a generator that takes samples and yields the current to request after each. Whatever ends a move or a step,
zero is written; the line is closed behind a zero that the wheel has confirmed.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, NamedTuple, Self

from rw_ekf.attach.opening import opener
from rw_ekf.clock import Clock
from rw_ekf.commissioning.dialogue import RefusedError, Stopped
from rw_ekf.driver import WheelProtocol
from rw_ekf.errors import DriverError
from rw_ekf.live.guard import SafetyLimits
from rw_ekf.live.live_wheel import LiveWheel, Place
from rw_ekf.live.port_claim import PortClaim
from rw_ekf.live.stop_signal import StopSignal
from rw_ekf.live.telemetry import IDENTITY_UNKNOWN
from rw_ekf.records import Estimate, IssuedCommand, LinkState, Outcome, Reading, Tick, WheelSample, WheelState
from rw_ekf.units import rpm_from_rad_s
from rw_ekf.watch.sign_watch import OppositeTold

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration

Move = Generator[float, WheelSample, None]
_DEAD_AFTER_S = 3.0  # without an answer: a wheel that has gone, and no hiccup of the line
_RUNS_AWAY = 2.0  # times the ceiling: it still runs faster though zero is written


def not_confirmed(configuration: str | Path) -> str:
    """What to do about a wheel that has not confirmed zero. configuration: the file that a stop takes."""
    return (
        "the wheel did not confirm zero current: it may still carry its last one. Run `rw-ekf stop --config "
        f"{configuration}`, or cut its power"
    )


class OppositeError(RefusedError):
    """The current that telemetry reports has the other sign than the one that was written."""


class Row(NamedTuple):
    """A reading and the command that followed it."""

    time_s: float
    speed_rad_s: float | None
    current_A: float | None
    echo_A: float | None  # the command as telemetry reports it
    angle_rad: float | None
    segment: int
    command_A: float
    delay_s: float  # after time_s
    known: bool  # whether the wheel confirmed the command
    host_s: float = 0.0  # when it had come and been answered, by the computer's clock


class Bench:
    """One step at the wheel."""

    def __init__(
        self,
        configuration: Configuration,
        protocol: WheelProtocol,
        clock: Clock,
        stop: StopSignal,
        warn: Callable[..., None],
        *,
        rate_hz: float,
        step_rad_s: float = 0.0,
        ceiling_rad_s: float = float("inf"),
        configuration_file: str | Path = "F",
    ) -> None:
        """step_rad_s: resolution or noise of a reading. ceiling_rad_s: above it nothing but zero is requested.

        configuration_file: what stops the wheel by another program.
        """
        self._configuration, self._configuration_file = configuration, configuration_file
        self._protocol = protocol
        self.clock = clock
        self._stop = stop
        self._warn = warn
        self.rate_hz = rate_hz
        self._step = step_rad_s
        self.ceiling_rad_s = ceiling_rad_s
        self._claim = PortClaim(configuration.wheel.port, clock)
        self._live: LiveWheel | None = None
        self._opposite = OppositeTold()
        self._driven = False  # whether the move has requested a current
        self._began_s = self._unknown_since_s = 0.0
        self.lasted_s = 0.0

    def __enter__(self) -> Self:
        """Open the line and write zero. Raises DriverError."""
        if self._stop.requested is not None:
            raise Stopped
        self._claim.__enter__()
        try:
            self._live = LiveWheel(
                Place(opener(self._configuration, self._protocol, self.clock)),
                SafetyLimits.of(self._configuration.limits),
                self.rate_hz,
                self._stop,
                self.clock,
                note=self._note,
                speed_step_rad_s=max(self._protocol.limits.speed_step_rad_s, self._step),
            )
        except BaseException:
            self._claim.release()
            raise
        self._began_s = self.clock.monotonic()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        confirmed = self.live.close()
        self._claim.release()
        self.lasted_s = self.clock.monotonic() - self._began_s
        if not confirmed:
            text = not_confirmed(self._configuration_file)
            if error is None or isinstance(error, Stopped):
                raise DriverError(text)
            self._warn("zero_not_confirmed", text=text)

    @property
    def live(self) -> LiveWheel:
        """The wheel; only between entering and leaving."""
        assert self._live is not None
        return self._live

    def run(self, move: Move, at_most_s: float) -> list[Row]:
        """Go through a move, or so much of it; then zero. Raises Stopped, RefusedError, DriverError."""
        rows: list[Row] = []
        self._driven = False
        try:
            next(move)
            for reading in self.live.readings(lambda: at_most_s):
                self._look(reading)
                if reading.sample is not None:
                    try:
                        rows.append(self._turn(move, reading.sample, reading.link))
                    except StopIteration:
                        break
        finally:
            self.live.zero_now()
        if self.live.halted is not None:
            raise RefusedError(self.live.halted)
        if self._stop.requested is not None:
            raise Stopped
        return rows

    def _note(self, event: str, **context: object) -> None:
        """What the live wheel has to report, but for ramps: every pulse begins with one."""
        if event != "command_changed" or context.get("reason") not in (None, "slew"):
            self._warn(event, **context)

    def _turn(self, move: Move, sample: WheelSample, link: LinkState) -> Row:
        speed, wanted_A = sample.speed_rad_s, 0.0
        if speed is not None:
            wanted_A = move.send(sample)
            held = abs(speed) > self.ceiling_rad_s or self.live.check.hold is not None
            wanted_A = 0.0 if held else wanted_A
            self._driven = self._driven or wanted_A != 0.0
        issued = self.live.issue(lambda tick: wanted_A, _tick(sample, link))
        self._hold_against(issued)
        known = issued is not None and issued.acknowledged
        if speed is None and issued is None:
            known = True  # a reading was missed: what was commanded before remains in force
        return Row(
            sample.time_s,
            speed,
            sample.current_A,
            sample.current_command_A,
            sample.angle_rad,
            sample.segment,
            float("nan") if issued is None else issued.current_A,
            0.0 if issued is None else issued.delay_s,
            known,
            self.clock.monotonic(),
        )

    def _hold_against(self, issued: IssuedCommand | None) -> None:
        """Raise where the sign of what is written is not that of what is reported."""
        self._opposite.add(issued)
        if self._opposite.is_certain:
            place = self._protocol.scale_places.get("current", self._configuration.wheel.protocol)
            raise OppositeError(self._opposite.text(place))

    def _look(self, reading: Reading) -> None:
        """Raise where the wheel is no longer there, or must not be driven on."""
        if reading.link in (LinkState.SILENT, LinkState.DOWN) and reading.quiet_s > _DEAD_AFTER_S:
            raise DriverError(
                f"{self._configuration.wheel.port}: the wheel stopped answering {reading.quiet_s:.2g} s ago; zero was "
                "tried. Look at its supply and its cable, then start again: what was found until here is kept"
            )
        why, now_s = self.live.check.hold, self.clock.monotonic()
        if why != IDENTITY_UNKNOWN:
            self._unknown_since_s = now_s
        if why == IDENTITY_UNKNOWN and (self._driven or now_s - self._unknown_since_s > _DEAD_AFTER_S):
            # Before any current it is waited for, as it answers in a turn or two; a move cannot continue behind a hold.
            about = "after a silence it answers, and does not say at once which wheel it is: start again"
            raise RefusedError(f"the wheel must not be driven: {about}")
        if why not in (None, IDENTITY_UNKNOWN):
            raise RefusedError(f"the wheel must not be driven: {'; '.join(self.live.check.findings) or why}")
        speed = None if reading.sample is None else reading.sample.speed_rad_s
        if speed is not None and abs(speed) > _RUNS_AWAY * self.ceiling_rad_s:
            raise RefusedError(
                f"the wheel reads {rpm_from_rad_s(speed):.4g} rpm, beyond what this step may reach: zero is written"
            )


def _tick(sample: WheelSample, link: LinkState) -> Tick:
    """A turn of the loop in which nothing but the reading is known."""
    speed = sample.speed_rad_s if sample.speed_rad_s is not None else 0.0
    state = WheelState(speed, 0.0, 0.0, 0.0, 0.0)
    return Tick(sample, Estimate(sample.time_s, Outcome.UPDATED, state, state), link=link)


def zero() -> Move:
    """Request no current."""
    while True:
        yield 0.0
