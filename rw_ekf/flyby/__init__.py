"""Reversals of wheels as a spacecraft sees them: when a flyby brings them about, and how hard each one kicks."""
