"""The extended Kalman filter: transition, online estimator, compiled pass over logs, smoother, consistency."""
