"""The page of a run in a browser: a process of its own that reads what a run writes, and can never delay it."""
