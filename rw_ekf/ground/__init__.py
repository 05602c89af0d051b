"""A wheel's packets as ground systems define them, from its wire map."""
