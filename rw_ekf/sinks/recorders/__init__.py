"""What other programs get of a run, one file each (docs/recorders.md)."""
