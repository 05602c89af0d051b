"""Bytes, ports and wheels, real and simulated: everything below a WheelSample.

    protocols -> register_protocol -> wire_map -> registers -> framing -> serial_link -> serial_wheel      on a line
    plant, plant_effects -> plant_runner -> register_server -> pty_server           a simulated wheel behind one
                                         -> simulated_wheel                         the same plant without a line
                         -> plant_batch                                             the same plant, compiled
    replay_wheel                                                                    a record, as if it were a wheel

Imports nothing of rw_ekf but its records, units, errors and names of arrays.
"""
