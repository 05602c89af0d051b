"""The estimator for a flight computer: the filter's own functions printed as C99; and the wheel for simulations."""
