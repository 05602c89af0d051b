"""From an unknown wheel on a port to its configuration, its model and a page about it (docs/commissioning.md)."""
