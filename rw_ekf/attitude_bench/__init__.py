"""The attitude bench: a table with a wheel that reverses, under every compensation, through the daemon's own loop."""
