"""What came of it on data that had no part in the search: figures, tests, verdict."""
