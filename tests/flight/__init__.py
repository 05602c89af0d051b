"""The estimator as C99."""
