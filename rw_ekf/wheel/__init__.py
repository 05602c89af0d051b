"""The wheel as modelled: equations and effects over one interval, and the model as a file."""
