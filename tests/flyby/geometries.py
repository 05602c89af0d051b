"""Flybys for tests: the shipped one, and random ones."""

from __future__ import annotations

import math

import numpy as np
from hypothesis import strategies as st

from rw_ekf.flyby.geometry import Flyby, Wheels


def random_flyby(seed: int, wheels: int, *, common_inertia: bool = False) -> Flyby:
    """A flyby with any spacecraft, any slew axis and wheels that span the body's axes."""
    rng = np.random.default_rng(seed)
    while True:
        axes = rng.standard_normal((3, wheels))
        axes /= np.linalg.norm(axes, axis=0)
        if np.linalg.svd(axes, compute_uv=False)[-1] > 0.2:
            break
    root = rng.uniform(-1.0, 1.0, (3, 3))
    slew = rng.standard_normal(3)
    start = rng.uniform(0.2, 1.4)
    inertia = np.full(wheels, 0.1) if common_inertia else rng.uniform(0.05, 0.3, wheels)
    return Flyby(
        wheels=Wheels(tuple(map(str, range(wheels))), axes, inertia),
        inertia_kg_m2=1.0e3 * (root @ root.T + np.eye(3)),
        slew_axis=slew / np.linalg.norm(slew),
        miss_distance_m=float(rng.uniform(5e5, 5e6)),
        speed_m_s=float(rng.uniform(1e3, 2e4)),
        start_rad=float(start),
        end_rad=float(rng.uniform(start + 0.3, math.pi - 0.1)),
    )


flybys = st.builds(random_flyby, st.integers(0, 10_000), st.integers(3, 6))


def random_rates(flyby: Flyby, seed: int, size_rad_s: float = 100.0) -> list[float]:
    """Rates of all wheels [rad/s]."""
    return [float(rate) for rate in np.random.default_rng(seed).uniform(-size_rad_s, size_rad_s, len(flyby.wheels))]
