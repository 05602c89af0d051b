"""Where each turn of the loop goes: logs, state file, statistics, alarms, the line on the screen."""
