"""From a residual to the effect that the model lacks: `rw-ekf diagnose` (docs/likelihood.md)."""
