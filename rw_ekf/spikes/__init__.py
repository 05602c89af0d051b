"""Drag spikes over months of runs ([L17] IV): what they were, how often they come, and whether that changes."""
