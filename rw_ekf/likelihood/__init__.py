"""The likelihood of a model along a smoothed trajectory: what `fit`, `replay` and `diagnose` stand on."""
