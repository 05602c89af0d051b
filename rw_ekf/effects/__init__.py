"""The catalogue of effects that the four-parameter model lacks: one class, one file each (docs/effects.md)."""
