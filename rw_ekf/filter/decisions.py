"""What becomes of a sample: the rules that the online estimator and the compiled pass share (math only, integers)."""

FIRST = 0
UPDATED = 1
MISSING = 2
GATED = 3
REPEATED = 4
BACKWARD = 5
RESEEDED = 6


def timing(dt: float, seeded: bool, new_segment: bool, has_speed: bool, max_gap_s: float) -> int:
    """Outcome that the sample's time alone decides; UPDATED means: predict, then look at the innovation.

    dt [s] since the last sample. A gap, or a new segment, re-seeds the speed from the sample; where that sample has no
    speed the caller waits (MISSING) and re-seeds from the next that has one.
    """
    if not new_segment:
        if dt == 0.0:
            return REPEATED
        if dt < 0.0:
            return BACKWARD
    if not has_speed:
        return MISSING
    if not seeded:
        return FIRST
    if new_segment or dt > max_gap_s:
        return RESEEDED
    return UPDATED


def gating(nis: float, gate: float, gated_in_a_row: int, reseed_after: int) -> int:
    """UPDATED; GATED; or RESEEDED where the gate has refused `reseed_after` samples running (the filter is wrong)."""
    if nis <= gate:
        return UPDATED
    if gated_in_a_row + 1 >= reseed_after:
        return RESEEDED
    return GATED
