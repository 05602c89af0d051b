"""Simulated runs whose truth is known, for measurements and tests alike: readings, priors, and the Cramer-Rao bound."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from rw_ekf.arrays import Float64Array
from rw_ekf.course.course import Course
from rw_ekf.course.free_run import FreeRun, free_run
from rw_ekf.filter.belief import DEFAULT_PRIOR, Belief
from rw_ekf.filter.constants import DEFAULT_ACCELERATION_NOISE, FilterConstants, filter_constants
from rw_ekf.model.friction import LAW_CODES, Stribeck
from rw_ekf.model.state import CK13_STATISTICAL, PARAMETER_COUNT, FrictionParameters
from rw_ekf.units import RAD_S_PER_RPM
from rw_ekf.wheel.effect_table import NO_EFFECTS

OMEGA_S = 4.0 * RAD_S_PER_RPM
INSIDE = 1.959964  # sigmas of a 95 % interval
PUBLISHED = ("P1", "P2", "S1", "S2", "S3", "S4", "S5")


@dataclass(eq=False, frozen=True)
class Run:
    """A simulated run: what is true and what was read, (n,) each."""

    time_s: Float64Array
    current_A: Float64Array
    speed_rad_s: Float64Array
    reading_rad_s: Float64Array
    parameters: FrictionParameters = CK13_STATISTICAL

    @property
    def course(self) -> Course:
        """The run as the filter sees it."""
        return Course.of(self.time_s, self.reading_rad_s, self.current_A)


def constants_for(noise_rpm: float = 1.0, law: str = "gauss", acceleration_rpm: float | None = None) -> FilterConstants:
    """Filter constants with the default process noise, or one in rpm per sqrt(s)."""
    quiet = DEFAULT_ACCELERATION_NOISE if acceleration_rpm is None else acceleration_rpm * RAD_S_PER_RPM
    return filter_constants(OMEGA_S, law, speed_noise_rad_s=noise_rpm * RAD_S_PER_RPM, acceleration_noise=quiet)


def prior_drawn_around(truth: FrictionParameters, seed: int, share: float = 0.5) -> Belief:
    """The default prior, its mean drawn around the truth with `share` of its own standard deviation."""
    covariance = DEFAULT_PRIOR.parameter_covariance
    drawn = np.linalg.cholesky(covariance) @ np.random.default_rng(1000 + seed).standard_normal(PARAMETER_COUNT)
    return Belief.of_known(np.array(truth) + share * drawn, covariance)


def free_run_of(
    course: Course,
    first_speed_rad_s: float,
    parameters: FrictionParameters = CK13_STATISTICAL,
    law: str = "gauss",
    *,
    with_jacobian: bool = False,
) -> FreeRun:
    """A wheel without effects run free over a whole course."""
    start, stribeck = np.array([[first_speed_rad_s, *parameters]]), Stribeck(OMEGA_S, LAW_CODES[law])
    first, last = np.array([0]), np.array([course.samples - 1])
    return free_run(course, NO_EFFECTS, stribeck, start, first, last, keep_path=True, with_jacobian=with_jacobian)


def cramer_rao_std(run: Run, noise_rpm: float, law: str = "gauss") -> Float64Array:
    """Lower bound of the standard deviations of k, b, c, s from one run, (4,), its first speed unknown, no prior."""
    found = free_run_of(run.course, float(run.speed_rad_s[0]), run.parameters, law, with_jacobian=True)
    return bound_from(found.jacobian, noise_rpm)


def bound_from(jacobian: Float64Array, noise_rpm: float) -> Float64Array:
    """Square roots of the diagonal of the inverse information, parameters only; scaled before inversion."""
    weighted = jacobian / (noise_rpm * RAD_S_PER_RPM)
    scale = np.linalg.norm(weighted, axis=0)
    scale[scale == 0.0] = 1.0
    information = (weighted / scale).T @ (weighted / scale)
    return np.asarray(np.sqrt(np.diag(np.linalg.pinv(information, rcond=1e-13)))[1:] / scale[1:])
