"""A record searched: the ledger, what is no row of it, and how well its numbers are known."""
