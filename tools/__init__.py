"""Benchmarks, proofs and demonstrations; nothing of the product imports them."""
