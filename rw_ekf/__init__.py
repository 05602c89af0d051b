"""rw_ekf: an online estimator for reaction wheels.

bytes -> drivers -> WheelSample -> model + filter -> Tick -> sinks. See docs/ for the mathematics.

Whoever imports this gets one thread for linear algebra (docs/decisions/0005), and so do the processes started from
there. It asks through the environment, which the linear algebra reads once, when numpy is loaded: import rw_ekf before
numpy, or set the variables outside. What is set already stays.
"""

import os

__version__ = "0.1.0"

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")
