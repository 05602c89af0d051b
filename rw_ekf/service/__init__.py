"""What a machine is given so that a run lives on it: a systemd unit, a udev rule."""
