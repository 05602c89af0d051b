"""filterpy without the parts of SciPy that a wheel's filter never calls: they come when somebody asks for them."""

from __future__ import annotations

import subprocess
import sys

import pytest

LATER = """
import math, sys
import numpy as np
from rw_ekf.filter.ekf import WheelEkf
assert not {"scipy.stats", "scipy.ndimage"} & set(sys.modules)

from filterpy.discrete_bayes import predict
from filterpy.kalman import ExtendedKalmanFilter
from filterpy.stats import norm_cdf
assert issubclass(WheelEkf, ExtendedKalmanFilter)
plain = ExtendedKalmanFilter(2, 1)
plain.x = np.zeros((2, 1))
plain.update(np.array([[1.0]]), lambda x: np.array([[1.0, 0.0]]), lambda x: x[:1])
print(plain.log_likelihood + 0.5 * (math.log(2.0 * math.pi * 2.0) + 0.5))  # S = 2, y = 1
print(norm_cdf((-1.0, 1.0), 0.0, 1.0) - math.erf(math.sqrt(0.5)))
print(abs(predict([0.1, 0.8, 0.1], 1, [0.1, 0.8, 0.1]) - [0.17, 0.17, 0.66]).max())  # by hand, round a circle

import scipy.ndimage, scipy.stats
assert scipy.stats.t.cdf(0.0, 3) == 0.5 and scipy.ndimage.shift([1.0, 2.0], 1)[1] == 1.0
"""
BEFORE = """
import scipy.stats
from rw_ekf.filter.ekf import WheelEkf
import filterpy.stats.stats as theirs
assert theirs.norm is scipy.stats.norm
print(0.0)
"""


@pytest.mark.parametrize("program", [LATER, BEFORE])
def test_what_filterpy_takes_of_scipy_is_there_when_it_is_used(program: str) -> None:
    """Not at import; its densities are then those of the textbook, and SciPy's own modules are themselves."""
    done = subprocess.run([sys.executable, "-W", "error", "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert [float(line) for line in done.stdout.split()] == pytest.approx([0.0] * done.stdout.count("\n"), abs=1e-9)
