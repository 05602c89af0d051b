"""What may be added to a model: scored beside it, and fitted."""
