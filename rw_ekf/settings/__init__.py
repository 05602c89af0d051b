"""The settings layer: the configuration's schema, and files shipped in config/.

Light on purpose (no numpy): `rw-ekf stop` must be on the line at once.
"""
