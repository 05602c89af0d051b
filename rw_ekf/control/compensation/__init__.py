"""Friction compensation: one scheme a file; an acceleration of the wheel is requested, a current comes out."""
