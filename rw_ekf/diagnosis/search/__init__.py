"""What could explain the residual: candidates scored, fitted, kept or refused."""
