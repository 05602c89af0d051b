"""A wheel on a CAN bus: frames, a map of messages and signals, buses, the link that gives them as registers."""
