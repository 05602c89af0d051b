"""Benchmarks, proofs and demonstrations; nothing of the product imports them."""

from rw_ekf.one_thread import ask_for_one_thread

ask_for_one_thread()  # before numpy is loaded
