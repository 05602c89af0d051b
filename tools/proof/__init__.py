"""The proof of the diagnosis on undeclared effects."""
