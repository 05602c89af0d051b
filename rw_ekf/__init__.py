"""rw_ekf: an online estimator for reaction wheels.

bytes -> drivers -> WheelSample -> model + filter -> StepResult -> sinks. See docs/ for the mathematics.
"""

__version__ = "0.1.0"
