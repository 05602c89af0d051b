"""Measurements: the estimator, the daemon, the watch, the time to start."""
