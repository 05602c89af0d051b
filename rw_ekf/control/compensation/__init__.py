"""Friction compensation: one scheme a file; an acceleration of the wheel is asked for, a current comes out."""
