"""A model run freely over a record, as a trajectory to linearise along."""

from __future__ import annotations

import math

import numpy as np

from rw_ekf.course.free_run import free_run
from rw_ekf.likelihood.linearisation import Noise
from rw_ekf.likelihood.model_vector import Model
from rw_ekf.likelihood.one_step import Record, Trajectory, state_vector
from rw_ekf.model.state import SPEED


def free_trajectory(record: Record, model: Model, trajectory: Trajectory, noise: Noise) -> Trajectory:
    """Each stretch run freely from the first speed that a trajectory has there, which stands where none is run."""
    n, model = record.follows.size, model.with_laws_as_curves
    first = np.flatnonzero(~record.follows)
    last = np.append(first[1:], n) - 1
    states = np.tile(state_vector(model.coefficients, model.effects), (first.size, 1))
    states[:, SPEED] = trajectory.speed[first]
    path = free_run(record.course, model.effects, model.stribeck, states, first, last, keep_path=True).path_rad_s
    return trajectory.along(path, math.sqrt(noise.variance))
