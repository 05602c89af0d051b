"""All compensations by their ids; each stands in one file, is described here, and is made here."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from rw_ekf.control.compensation.dmc import DynamicModelCompensation
from rw_ekf.control.compensation.pid_current import PidCurrent
from rw_ekf.control.compensation.scheme import Compensation
from rw_ekf.model.friction import Stribeck
from rw_ekf.model.state import FrictionParameters


@dataclass(frozen=True)
class WheelSheet:
    """What is known of a wheel before anything is estimated: nominal parameters, Stribeck speed, the loop's rate."""

    parameters: FrictionParameters
    stribeck: Stribeck
    rate_hz: float = 10.0


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


SCHEMES: dict[str, SchemeEntry] = {
    entry.id: entry
    for entry in (
        SchemeEntry("pid_current", "[CK13] 4.1", lambda sheet: PidCurrent(sheet.parameters.motor_gain)),
        SchemeEntry(
            "pid_tuned",
            "[CK13] 4.1, largest integral gain",
            lambda sheet: PidCurrent(sheet.parameters.motor_gain),
            largest_integral=True,
        ),
        SchemeEntry("dmc", "[CK13] 4.2 (14), (15)", lambda sheet: DynamicModelCompensation(), "estimator"),
        SchemeEntry("dmc_deterministic", "[CK13] Table 1", lambda sheet: DynamicModelCompensation(), "deterministic"),
        SchemeEntry(
            "dmc_adaptive", "ours: [CK13] 4.2 while it learns", lambda sheet: DynamicModelCompensation(), "adaptive"
        ),
        SchemeEntry(
            "dmc_diagnosed", "ours: [CK13] 4.2 with effects", lambda sheet: DynamicModelCompensation(), "diagnosed"
        ),
    )
}
