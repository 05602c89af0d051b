"""Whether noise is one and the same: what a poor sensor does is told, honest noise is not accused."""

from __future__ import annotations

import numpy as np
import pytest

from rw_ekf.arrays import Float64Array
from rw_ekf.filter.noise_evenness import unevenness

N = 4000


def speeds(rng: np.random.Generator) -> Float64Array:
    return 100.0 * np.sin(np.arange(N) / 300.0 + rng.uniform(0.0, 6.0))


def test_honest_noise_is_not_accused() -> None:
    """None of 500 records of normal noise, of 300 readings to 4,000, is called uneven."""
    rng = np.random.default_rng(1)
    for i in range(500):
        n = N if i % 2 else 300
        assert unevenness(3.0 * rng.standard_normal(n) + 0.2, speeds(rng)[:n]) is None


@pytest.mark.parametrize(
    ("words", "kind"),
    [("loses counts", "lost"), ("the faster", "speed"), ("long tails", "levels"), ("no tails", "grid")],
)
def test_a_poor_sensor_is_told(words: str, kind: str) -> None:
    """Counts lost in a tenth of the readings, noise that grows with speed, has two levels, or is rounding."""
    rng = np.random.default_rng(2)
    speed, z = speeds(rng), rng.standard_normal(N)
    white = {
        "lost": z - 2.0 * np.sign(speed) * (rng.random(N) < 0.1),
        "speed": z * (0.5 + np.abs(speed) / 100.0),
        "levels": z * np.where(np.arange(N) // 200 % 2, 0.5, 1.5),
        "grid": rng.uniform(-1.0, 1.0, N),
    }[kind]
    assert words in str(unevenness(white, speed))
