"""All compensations by their ids; each stands in one file, is described here, and is made here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from rw_ekf.control.compensation import (
    adrc,
    command_shaping,
    disturbance_observer,
    dither,
    ekbf,
    mrac,
    pi_drag,
    pistiner,
    sliding_mode,
    speed_mode,
    walrath,
)
from rw_ekf.control.compensation.dmc import DynamicModelCompensation
from rw_ekf.control.compensation.pi_drag import CASSINI_RAD_S
from rw_ekf.control.compensation.pid_current import PidCurrent
from rw_ekf.control.compensation.predictive_crossing import PredictiveCrossing
from rw_ekf.control.compensation.scheme import Compensation
from rw_ekf.control.compensation.unmodelled_drag import SpeedNoise
from rw_ekf.errors import ConfigError
from rw_ekf.model.friction import Stribeck
from rw_ekf.model.state import FrictionParameters
from rw_ekf.plugins import added, loaded_as, refused


@dataclass(frozen=True)
class WheelSheet:
    """What is known of a wheel before anything is estimated: nominal parameters, Stribeck speed, rate of the loop.

    noise: as given to the filter; None: not known.
    """

    parameters: FrictionParameters
    stribeck: Stribeck
    rate_hz: float = 10.0
    noise: SpeedNoise | None = None


@dataclass(frozen=True)
class SchemeEntry:
    """One compensation: where it comes from, whose parameters it uses, how it is made, and within what it was tuned.

    tunable: bounds of the parameters that tools/measure/tune_schemes.py tuned, as `make` takes them.
    largest_integral: the attitude controller's integral gain is then not the scenario's but the largest that its phase
    margin allows (bench/margins.py).
    """

    id: str
    source: str  # as "[CK13] 4.2 (14), (15)"
    make: Callable[..., Compensation]  # of a WheelSheet; keywords replace tuned parameters
    parameters_from: str = "none"  # "estimator", "adaptive", "deterministic", "diagnosed" or "none"
    inner_rate_hz: float | None = None  # of a loop in the wheel's own electronics; None: the attitude loop's rate
    tunable: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    largest_integral: bool = False


def _pistiner(sheet: WheelSheet, **given: float) -> pistiner.PistinerOffset:
    parameters = sheet.parameters
    return pistiner.PistinerOffset(parameters.motor_gain, parameters.viscous, pistiner.OffsetSpeeds(**given))


def _dither(sheet: WheelSheet, wave: Callable[[float], float], base: Compensation | None = None) -> dither.Dither:
    gain, static = sheet.parameters.motor_gain, sheet.parameters.static
    base = PidCurrent(gain) if base is None else base
    return dither.Dither(base, gain, static, sheet.rate_hz, wave, dither.DitherSignal())


def _pi_drag(sheet: WheelSheet, **given: Any) -> pi_drag.PiDrag:
    return pi_drag.PiDrag(sheet.parameters, pi_drag.PiDragParameters(**given))


def _mrac(sheet: WheelSheet, **given: Any) -> mrac.Mrac:
    return mrac.Mrac(sheet.parameters, mrac.MracParameters(**given))


OWN_SCHEMES: dict[str, SchemeEntry] = {
    entry.id: entry
    for entry in (
        SchemeEntry("pid_current", "[CK13] 4.1", lambda sheet: PidCurrent(sheet.parameters.motor_gain)),
        SchemeEntry(
            "pid_tuned",
            "[CK13] 4.1, largest integral gain",
            lambda sheet: PidCurrent(sheet.parameters.motor_gain),
            largest_integral=True,
        ),
        SchemeEntry(
            "speed_mode",
            "[CK13] 1",
            lambda sheet, **given: speed_mode.SpeedMode(sheet.parameters.motor_gain, speed_mode.SpeedLoop(**given)),
            inner_rate_hz=speed_mode.RATE_HZ,
            tunable=speed_mode.TUNABLE,
        ),
        SchemeEntry("dmc", "[CK13] 4.2 (14), (15)", lambda sheet: DynamicModelCompensation(), "estimator"),
        SchemeEntry("dmc_deterministic", "[CK13] Table 1", lambda sheet: DynamicModelCompensation(), "deterministic"),
        SchemeEntry(
            "dmc_adaptive", "ours: [CK13] 4.2 while it learns", lambda sheet: DynamicModelCompensation(), "adaptive"
        ),
        SchemeEntry(
            "dmc_diagnosed", "ours: [CK13] 4.2 with effects", lambda sheet: DynamicModelCompensation(), "diagnosed"
        ),
        SchemeEntry(
            "predictive_crossing",
            "ours: the filter's propagation inverted",
            lambda sheet: PredictiveCrossing(sheet.rate_hz, sheet.noise),
            "estimator",
        ),
        SchemeEntry(
            "predictive_diagnosed",
            "ours: the same with effects",
            lambda sheet: PredictiveCrossing(sheet.rate_hz, sheet.noise),
            "diagnosed",
        ),
        SchemeEntry("pistiner_offset", "[S91] of Pistiner", _pistiner, tunable=pistiner.TUNABLE),
        SchemeEntry("dither_triangular", "[S91] claims 1 to 6", lambda sheet: _dither(sheet, dither.triangular)),
        SchemeEntry("dither_sine", "[S91] claims 1 to 6", lambda sheet: _dither(sheet, dither.sine)),
        SchemeEntry("dither_square", "[S91] claims 1 to 6", lambda sheet: _dither(sheet, dither.square)),
        SchemeEntry(
            "dither_offset",
            "[S91] figure 6: dither and Pistiner's offset",
            lambda sheet: _dither(sheet, dither.triangular, _pistiner(sheet)),
        ),
        SchemeEntry(
            "disturbance_observer",
            "Ohnishi, Shibata, Murakami 1996",
            lambda sheet, **given: disturbance_observer.DisturbanceObserver(
                sheet.parameters.motor_gain, disturbance_observer.ObserverFilter(**given)
            ),
            tunable=disturbance_observer.TUNABLE,
        ),
        SchemeEntry(
            "adrc",
            "Gao 2003, Han 2009",
            lambda sheet, **given: adrc.ActiveDisturbanceRejection(
                adrc.BareObserver(**given), sheet.parameters.motor_gain
            ),
            tunable=adrc.TUNABLE,
        ),
        SchemeEntry(
            "adrc_model",
            "Gao 2003, Han 2009, with [CK13] (1) inside",
            lambda sheet, **given: adrc.ActiveDisturbanceRejection(adrc.ModelObserver(**given)),
            "estimator",
            tunable=adrc.TUNABLE_WITH_MODEL,
        ),
        SchemeEntry(
            "sliding_mode",
            "Utkin 1977, Slotine and Li 1991",
            lambda sheet, **given: sliding_mode.SlidingMode(
                sheet.parameters.motor_gain, sheet.parameters.static, sliding_mode.SlidingSurface(**given)
            ),
            tunable=sliding_mode.TUNABLE,
        ),
        SchemeEntry("pi_drag", "[L17] II (1), bandwidth tuned", _pi_drag, tunable=pi_drag.TUNABLE),
        SchemeEntry(
            "pi_drag_cassini", "[L17] II (1), 0.01 Hz", lambda sheet: _pi_drag(sheet, bandwidth_rad_s=CASSINI_RAD_S)
        ),
        SchemeEntry(
            "pi_drag_high_gain",
            "[L17] V.1: Cassini's, doubled",
            lambda sheet: _pi_drag(sheet, bandwidth_rad_s=2.0 * CASSINI_RAD_S),
        ),
        SchemeEntry("mrac", "[L17] V.2", _mrac, tunable=mrac.TUNABLE),
        SchemeEntry(
            "mrac_raw",
            "[L17] V.2, on readings",
            lambda sheet, **given: _mrac(
                sheet, **{"bandwidth_rad_s": mrac.ON_READINGS_RAD_S, **given, "speed": "raw", "sign": "raw"}
            ),
            tunable=mrac.TUNABLE,
        ),
        SchemeEntry(
            "mrac_filtered_sign",
            "[L17] V.2, on readings, with the filter's sign",
            lambda sheet, **given: _mrac(
                sheet, speed="raw", **{"bandwidth_rad_s": mrac.WITH_FILTERED_SIGN_RAD_S, **given}
            ),
            tunable=mrac.TUNABLE,
        ),
        SchemeEntry(
            "ekbf",
            "[L17] V.4",
            lambda sheet, **given: ekbf.KalmanBucyCompensation(sheet.parameters.motor_gain, ekbf.GaussMarkov(**given)),
            tunable=ekbf.TUNABLE,
        ),
        SchemeEntry(
            "walrath",
            "[L17] V.3 (7)",
            lambda sheet, **given: walrath.Walrath(1.0 / sheet.rate_hz, walrath.LagLearning(**given)),
            "estimator",
            tunable=walrath.TUNABLE,
        ),
        SchemeEntry(
            "command_shaping",
            "[L17] V.5",
            lambda sheet, **given: command_shaping.CommandShaping(**given),
            "estimator",
            tunable=command_shaping.TUNABLE,
        ),
    )
}


def _added_schemes() -> dict[str, SchemeEntry]:
    """What installed packages register (entry points rw_ekf.compensations). Raises ConfigError."""
    found = {}
    for name, point in added("rw_ekf.compensations", OWN_SCHEMES).items():
        found[name] = loaded_as(SchemeEntry, point)
        if found[name].id != name:
            raise refused(point, f"must have the id {name!r}; found {found[name].id!r}")
    return found


SCHEMES: dict[str, SchemeEntry] = {**OWN_SCHEMES, **_added_schemes()}


def scheme_of_a_run(name: str) -> SchemeEntry:
    """A scheme by its id. Raises ConfigError for one that only the bench has."""
    entry = SCHEMES[name]
    if entry.inner_rate_hz is not None or entry.parameters_from not in ("none", "estimator"):
        raise ConfigError(
            f"compensation.scheme: {name} needs a loop inside the wheel, or parameters that a run does not have; the "
            "bench has it (`rw-ekf bench`)"
        )
    return entry
