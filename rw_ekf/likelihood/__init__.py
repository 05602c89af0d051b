"""The likelihood of a model along a smoothed reference: what `fit`, `replay` and `diagnose` stand on."""
