"""Identification from whole logs: least squares, dedicated experiments, noise by likelihood, scales of a record."""
