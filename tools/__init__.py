"""Benchmarks, proofs and demonstrations; nothing of the product imports them."""

import rw_ekf  # noqa: F401  before numpy: one thread for linear algebra
