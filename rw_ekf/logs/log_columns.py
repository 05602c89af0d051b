"""The names of a log's own columns (docs/logs.md)."""

from __future__ import annotations

# Order of the columns in every log this project writes; a reader takes them in any order.
LOG_COLUMNS = (
    "time_s", "speed_rad_s", "current_command_A", "current_A", "command_delay_s", "segment", "temperature_degC",
    "pressure_Pa", "bus_voltage_V", "angle_rad", "status",
)  # fmt: skip
CHANNELS = (*LOG_COLUMNS[2:4], *LOG_COLUMNS[6:])  # all but the time, the speed and what orders the rows
READABLE_COLUMNS = (*LOG_COLUMNS, "speed_rpm")  # what a reader understands; anything else is carried along
