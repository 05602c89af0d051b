"""The simulated wheel: its physics, its registers, its pty, the faults of its line."""
