"""Excitation profiles: the current to command, as a pure function of time and a seed. Standard library only.

P1, P2     the random sines and random steps of [CK13]          S1 ... S5  the five signals of [F12], Table 1
identification  our own, 600 s: excites what the others leave in the dark
sine, zero, steps, random-sines  for every day, shaped by amplitude, period, bias and seed
"""

from rw_ekf.control.profiles.make_profile import PROFILE_NAMES, Profile, make_profile, sample_profile

__all__ = ["PROFILE_NAMES", "Profile", "make_profile", "sample_profile"]
