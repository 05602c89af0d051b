"""The wheel's equations: friction law, exact propagation with its sensitivity, the named state, model files."""
