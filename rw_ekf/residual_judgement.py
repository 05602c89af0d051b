"""Whether what a fit leaves of a log is noise: tested on every log that is replayed, and at the end of a run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from rw_ekf.course.course import Course
from rw_ekf.filter import gating
from rw_ekf.filter.belief import Belief
from rw_ekf.filter.consistency import MIN_SAMPLES, Consistency, consistency_of
from rw_ekf.filter.log_filter import filter_log
from rw_ekf.filter.parameters_held import frozen, without_drift
from rw_ekf.identify.least_squares import least_squares
from rw_ekf.identify.record_scale import busiest
from rw_ekf.likelihood.log_fit import consistency_of_fit, fit_log
from rw_ekf.model.state import COULOMB, STATE_SIZE, STATIC
from rw_ekf.starting_point import FilterSetup

JUDGED_SAMPLES = 8_000  # of a long log, so many in which the speed changes most decide whether the residual is noise
_JUDGED_PLAIN = 2_000  # the same in plain Python


def judge_log(course: Course, setup: FilterSetup, belief: Belief, most_samples: int = JUDGED_SAMPLES) -> Consistency:
    """Whether what a fit of the four parameters leaves of the log is noise (docs/decisions/0012).

    Judged at the log's own noises, where a wrong model does not pass for a noisy one; that the noises are other than
    the setup's is distinguished from that. A model with effects is judged where the filter ended. Where one fit from
    there, along the readings, clearly leaves noise, that is the answer; where not, the likeliest of several is tested.
    """
    if setup.fit_of_record is not None:
        return consistency_of_fit(setup.fit_of_record, setup.constants)
    head = busiest(course, most_samples)
    if np.count_nonzero(np.isfinite(head.speed_rad_s)) < MIN_SAMPLES:
        return consistency_of(np.zeros(0), np.zeros(0), np.zeros(0, dtype=bool))
    found = belief.parameters
    walk = setup.constants.dry_walk
    if setup.effects.terms or walk > 0.0:
        head = course.window(0, most_samples)
        mean, covariance = frozen(found, belief.mean)
        if walk > 0.0:  # dry friction is followed from where it was at the beginning
            dry = slice(COULOMB, STATIC + 1)
            mean[dry], covariance[dry, dry] = setup.prior.mean[dry], setup.prior.covariance[dry, dry]
        steady = replace(setup, constants=without_drift(setup.constants)._replace(dry_walk=walk))
        turning = STATE_SIZE + np.flatnonzero(steady.effect_drift)  # and so is a phase that is lost with the angle
        mean[turning] = setup.prior.mean[turning]
        covariance[np.ix_(turning, turning)] = setup.prior.covariance[np.ix_(turning, turning)]
        run = filter_log(head, steady.constants, mean, covariance, setup.effects, steady.effect_drift)
        return consistency_of(run.innovation_rad_s, run.innovation_variance, run.outcome == gating.UPDATED)
    near = fit_log(head, setup.constants, setup.prior.core, found, effort="least")
    judged = consistency_of_fit(near, setup.constants)
    if judged.is_clearly_noise:
        return judged
    starts = [found, found._replace(static=found.coulomb), found._replace(static=1.35 * found.coulomb)]
    start = least_squares(head, setup.constants, setup.prior.core, starts=starts).parameters
    return consistency_of_fit(fit_log(head, setup.constants, setup.prior.core, start), setup.constants)


def consistency_now(course: Course, setup: FilterSetup, belief: Belief) -> tuple[Consistency, int]:
    """`judge_log` without ever waiting for a compiler, and the samples it looked at.

    Where the cache of compiled routines is cold, the same functions run as plain Python over fewer samples: some four
    seconds on a desktop computer.
    """
    from rw_ekf import compile_ahead
    from rw_ekf.compiled import interpreted

    needed = (*compile_ahead.FILTER, *compile_ahead.EFFECTS) if setup.effects.terms else compile_ahead.FIT
    if not compile_ahead.cold(needed):
        return judge_log(course, setup, belief), min(JUDGED_SAMPLES, course.time_s.size)
    with interpreted():
        return judge_log(course, setup, belief, _JUDGED_PLAIN), min(_JUDGED_PLAIN, course.time_s.size)
