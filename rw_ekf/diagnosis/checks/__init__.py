"""Whether a hypothesis stands: what is tested of an effect, of held-out figures, of what is left."""
