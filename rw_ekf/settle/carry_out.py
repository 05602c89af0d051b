"""A plan as what a run commands, behind a brake to rest and below a ceiling; and as a log that can be repeated."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from rw_ekf.control.commanders import Commander, ProfileController
from rw_ekf.control.from_rest import FromRest, RestLimits
from rw_ekf.control.profiles import Profile
from rw_ekf.logs.atomic import write_text
from rw_ekf.settle.settle_plan import Plan
from rw_ekf.units import rad_s_from_rpm

if TYPE_CHECKING:
    from rw_ekf.settings.schema import Configuration

MOTION_NAME = "settle-motion.csv"
_BRAKE_SHARE = 0.5  # of limits.current_A
_CEILING = 0.95  # of limits.speed_rpm
_STILL_NOISES, _STILL_S = 4.0, 1.5
_SPARE_S = 30.0


def commander_for(plan: Plan, configuration: Configuration) -> Commander:
    """The motion behind a brake to rest; no current drives the wheel above the ceiling."""
    current, period = plan.design.current_A, plan.scene.period_s
    moves = list(plan.begins())

    def law(time_s: float) -> float:
        return float(current[min(int(time_s / period + 0.5), current.size - 1)])

    def phase(time_s: float) -> str:
        return next((text for begins, text in reversed(moves) if begins <= time_s), moves[0][1])

    profile = Profile("settle", current.size * period, law, phase)
    limits, believed = configuration.limits, plan.scene.standing.explanations[0].model.parameters
    brake, top = _BRAKE_SHARE * limits.current_A, rad_s_from_rpm(limits.speed_rpm)
    slows = max(believed.motor_gain * brake + believed.coulomb, 1.0e-9)
    still = _STILL_NOISES * rad_s_from_rpm(configuration.filter.speed_noise_rpm)
    rest = FromRest(
        ProfileController(profile),
        RestLimits(
            brake_A=brake,
            let_go_rad_s=max(2.0 * slows * (period + brake / limits.slew_A_per_s), still),
            still_rad_s=still,
            still_s=_STILL_S,
            longest_s=2.0 * top / slows + _SPARE_S,
            ceiling_rad_s=_CEILING * top,
        ),
    )
    return Commander(rest, profile, rest=rest)


def write_motion(plan: Plan) -> Path:
    """The motion as a log of what is predicted, beside the diagnosis: `command.log` repeats it.

    Raises BadInputError where it cannot be written.
    """
    path = Path(plan.scene.standing.path).absolute().parent / MOTION_NAME
    predicted = zip(plan.speed_rad_s.tolist(), plan.design.current_A.tolist(), strict=True)
    rows = [f"{tick * plan.scene.period_s!r},{speed!r},{current!r}" for tick, (speed, current) in enumerate(predicted)]
    write_text(path, "\n".join(["time_s,speed_rad_s,current_command_A", *rows]) + "\n")
    return path
