"""A wheel on a serial line: framing, registers, the wire map, the port."""
