"""Whether a hypothesis stands: what is asked of an effect, of held-out figures, of what is left."""
