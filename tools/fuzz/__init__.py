"""Bytes that nobody meant, through whatever reads bytes: frames, registers, YAML, logs, model files."""
