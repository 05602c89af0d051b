"""The one loop for live, replay and simulation: commands, safety, sinks, pacing, the daemon."""
