"""A log made ready: mended, split, its conditions, the base model fitted."""
