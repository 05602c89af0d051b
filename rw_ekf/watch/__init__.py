"""What watches a running estimator: is its residual still noise, and has the drag jumped? (docs/watch.md)."""
