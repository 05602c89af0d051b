"""Tests of the watch over a running estimator."""
