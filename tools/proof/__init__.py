"""The proof of the diagnosis on effects that nobody declares to it."""
