"""A second plant, from outside the project: MuJoCo's, a wheel on a hinge behind its `dcmotor` actuator.

What MuJoCo has of its own is used as it is: friction loss (a soft constraint, s = c), LuGre friction with a Stribeck
curve, cogging, polynomial damping, winding inductance, command delay, and a winding that warms and whose resistance
rises. The actuator's feed-forward input asks for a torque; its drive compensates the back-EMF, so that torque is
proportional to a current, as in the wheel's own drive. Needs `pip install mujoco`.
"""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.drivers.sim.plant_batch import PlantRun
from rw_ekf.units import RAD_S_PER_RPM
from tools.proof.cases import Case, Expectation, draw_wheel
from tools.proof.sizes import SHARES, draw_size, reach_of

INERTIA_KG_M2 = 1.5e-3
_STEPS_PER_S = 2000
_LUGRE_STEPS_PER_S = 5000  # its bristle is integrated to first order
_STIFF = 5.0e-4  # rad: the deflection of a bristle too stiff to be seen at 10 Hz
_DAMPING_RATIO = 0.3
_AMBIENT_DEGC = 20.0

# What is asked of MuJoCo -> what must be named for it.
KINDS: dict[str, tuple[str, ...]] = {
    "healthy": (),
    "healthy_stribeck": (),
    "cogging": ("torque_ripple",),
    "constant_torque": ("offset_torque",),
    "quadratic_damping": ("quadratic_drag",),
    "cubic_damping": ("cubic_drag",),
    "inductance": ("actuator_lag",),
    "delay": ("transport_delay",),
    "lugre": ("presliding_hysteresis",),
    "warm_winding": ("motor_gain_temperature",),
    "unbalanced": ("torque_ripple",),
}
_RUNGS_S = (0.05, 0.10, 0.02)  # inductance and delay
_RUNGS_RAD = (0.03, 0.10, 0.01)  # LuGre


def foreign_case(mark: str, number: int, seed: int, draws: np.random.Generator) -> Case:
    """One of KINDS after the other, then the next size."""
    kind = list(KINDS)[number % len(KINDS)]
    rung = (number // len(KINDS)) % len(SHARES)
    expected = KINDS[kind]
    expects: Expectation = "effects" if expected else "adequate"
    wheel = draw_wheel(draws, 0.05)
    if kind not in {"healthy_stribeck", "lugre"}:
        wheel = wheel._replace(static=wheel.coulomb)
    reach = reach_of(wheel, "identification", 1)
    size = draw_size(draws, rung)
    torque = size.share * wheel.coulomb
    amount = {
        "cogging": torque,
        "unbalanced": torque,
        "constant_torque": torque * (1.0 if draws.random() < 0.5 else -1.0),
        "quadratic_damping": torque / reach.top_speed_rad_s**2,
        "cubic_damping": torque / reach.top_speed_rad_s**3,
        "inductance": _RUNGS_S[rung] * size.jitter,
        "delay": _RUNGS_S[rung] * size.jitter,
        "lugre": _RUNGS_RAD[rung] * size.jitter,
        "warm_winding": 0.02 * size.share,  # 1/K
    }.get(kind, 0.0)
    return Case(
        name=f"{mark}-{number:03d}-{kind}",
        mark=mark,
        expects=expects,
        expected=expected,
        effects=(f"{kind}:{amount!r}",),
        wheel=wheel,
        profile="identification",
        profile_seed=1,
        seed=int(draws.integers(1 << 30)),
        noise_rpm=1.0,
        delay_s=0.0,
        telemetry=kind == "warm_winding",
        angle="counted" if kind in {"cogging", "unbalanced"} and draws.random() < 0.7 else "none",
        size_percent=100.0 * SHARES[rung] if expected else None,
        plant="mujoco",
    )


def model_text(case: Case) -> str:
    """The wheel as MJCF."""
    kind, amount = _kind(case)
    wheel, j = case.wheel, INERTIA_KG_M2
    damping = [wheel.viscous * j, 0.0, 0.0]
    if kind == "quadratic_damping":
        damping[1] = amount * j
    if kind == "cubic_damping":
        damping[2] = amount * j
    bristle = kind in {"lugre", "healthy_stribeck"}
    friction, motor = "", ""
    if bristle:
        stiffness = wheel.static / (amount if kind == "lugre" else _STIFF)
        damper = 2.0 * _DAMPING_RATIO * np.sqrt(stiffness)
        numbers = (stiffness * j, damper * j, wheel.coulomb * j, wheel.static * j, wheel.stribeck_speed_rad_s)
        motor = f'lugre="{_text(numbers)}"'
    else:
        # Stiff enough that a wheel at rest creeps by less than 1e-6 rpm.
        friction = f'frictionloss="{wheel.coulomb * j!r}" solreffriction="0.001 1" solimpfriction="0.9999 0.9999 0.001"'
    if kind == "cogging":
        phase = 2.0 * np.pi * (case.seed % 1000) / 1000.0
        motor += f' cogging="{_text((amount * j, 1.0, phase))}"'
    if kind == "inductance":
        motor += f' inductance="0 {amount!r}"'
    if kind == "delay":
        motor += f' delay="{amount!r}" nsample="{int(np.ceil(amount * _rate(case))) + 2}"'
    if kind == "warm_winding":
        motor += f' thermal="{_text((6.0, 0.0, 120.0, amount, _AMBIENT_DEGC, _AMBIENT_DEGC))}"'
    gravity = "-9.81 0 0" if kind == "unbalanced" else "0 0 0"
    arm_m = amount * j / 9.81 if kind == "unbalanced" else 0.0  # of 1 kg
    # MuJoCo adds mass * arm^2 to the inertia about the axis: below 1e-8 kg m^2 here.
    torque_constant = wheel.motor_gain * j
    return f"""<mujoco>
  <option timestep="{1.0 / _rate(case)!r}" gravity="{gravity}" integrator="implicitfast"/>
  <worldbody><body>
    <joint name="axis" type="hinge" axis="0 0 1" damping="{_text(damping)}" {friction}/>
    <inertial pos="0 {arm_m!r} 0" mass="1" diaginertia="{j} {j} {j}"/>
  </body></worldbody>
  <actuator><dcmotor joint="axis" motorconst="{torque_constant!r} {torque_constant!r}"
    resistance="{_RESISTANCE_OHM}" input="ff" {motor}/></actuator>
</mujoco>"""


_RESISTANCE_OHM = 20.0


def foreign_run(case: Case, time_s: Float64Array, current_A: Float64Array) -> PlantRun:
    """Run MuJoCo's wheel through the currents; the readings get their noise here."""
    mujoco = importlib.import_module("mujoco")
    kind, amount = _kind(case)
    model = mujoco.MjModel.from_xml_string(model_text(case))
    data = mujoco.MjData(model)
    if kind == "constant_torque":
        data.qfrc_applied[0] = -amount * INERTIA_KG_M2
    if kind == "warm_winding":
        data.act[model.actuator_actadr[0]] = 0.0  # its state is the rise above ambient
    rows = _advance(mujoco, model, data, case, time_s, current_A)
    noise = np.random.default_rng(case.seed).standard_normal(time_s.size) * case.noise_rpm * RAD_S_PER_RPM
    return PlantRun(
        time_s=time_s,
        current_command_A=current_A,
        command_delay_s=0.0,
        measured_speed_rad_s=rows[:, 0] + noise,
        speed_rad_s=rows[:, 0].copy(),
        temperature_degC=rows[:, 2].copy(),
        angle_rad=rows[:, 1].copy(),
        current_A=current_A.copy(),
        parameters=case.wheel,
    )


def _advance(
    mujoco: Any, model: Any, data: Any, case: Case, time_s: Float64Array, current_A: Float64Array
) -> Float64Array:
    """Speed [rad/s], angle [rad] and winding temperature [degC] at each sample, (n, 3)."""
    rows = np.empty((time_s.size, 3))
    warm = _kind(case)[0] == "warm_winding"
    torque_per_A = case.wheel.motor_gain * INERTIA_KG_M2
    step_s = 1.0 / _rate(case)
    for i in range(time_s.size):
        rise = float(data.act[model.actuator_actadr[0]]) if warm else 0.0
        rows[i] = data.qvel[0], data.qpos[0], _AMBIENT_DEGC + rise
        data.ctrl[0] = torque_per_A * current_A[i]
        if i + 1 < time_s.size:
            mujoco.mj_step(model, data, round((time_s[i + 1] - data.time) / step_s))
    return rows


def _kind(case: Case) -> tuple[str, float]:
    kind, _, amount = case.effects[0].partition(":")
    return kind, float(amount)


def _rate(case: Case) -> int:
    return _LUGRE_STEPS_PER_S if _kind(case)[0] in {"lugre", "healthy_stribeck"} else _STEPS_PER_S


def _text(numbers: tuple[float, ...] | list[float]) -> str:
    return " ".join(repr(float(number)) for number in numbers)
