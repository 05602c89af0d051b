"""Units that programs publish for the columns of their own logs, which the logs do not repeat.

Each line has where it is published. A name is compared from its end, in whole words of a path:
`axis0.encoder.vel_estimate` and `vel_estimate` are one.
"""

from __future__ import annotations

import re

_JOINT_STATES, _OF_JOINT = r"(?:.*/)?joint_states?[/.](?:.+[/.])?", r"(?:[/.\[].*)?"
_PUBLISHED = (
    # ODrive, firmware 0.5 and later (docs.odriverobotics.com, "Upgrading to 0.5": turns in place of counts)
    (re.compile(r"(.*[._])?(vel_estimate|vel_setpoint|input_vel)"), "turns/s"),
    (re.compile(r"(.*[._])?(pos_estimate|pos_setpoint|input_pos)"), "turns"),
    (re.compile(r"(.*[._])?i[qd]_(measured|setpoint)", re.IGNORECASE), "A"),
    # VESC Tool, real-time data: the position in sixths of an electrical turn, the speed in electrical turns a minute
    (re.compile(r"tacho(meter)?(_value|_abs(_value)?)?"), "steps"),
    (re.compile(r"(.*[._])?erpm"), "erpm"),
    # ROS, sensor_msgs/JointState of a joint that turns, as `rostopic echo -p` names its columns
    # and PlotJuggler its curves
    (re.compile(rf"field\.velocity\d*|{_JOINT_STATES}velocity{_OF_JOINT}"), "rad/s"),
    (re.compile(rf"field\.effort\d*|{_JOINT_STATES}effort{_OF_JOINT}"), "N m"),
    (re.compile(rf"field\.position\d*|{_JOINT_STATES}position{_OF_JOINT}"), "rad"),
    # PX4, EscReport.msg
    (re.compile(r"(.*\.)?(esc\[\d+\]\.)?esc_rpm"), "rpm"),
    (re.compile(r"(.*\.)?(esc\[\d+\]\.)?esc_current"), "A"),
)


def habitual_unit(name: str) -> str:
    """The unit that a program publishes for what it calls so; empty for none."""
    return next((unit for pattern, unit in _PUBLISHED if pattern.fullmatch(name)), "")
