"""What a run is attached to; the only place that picks a driver: a wheel on a line, a record, a simulated wheel."""
