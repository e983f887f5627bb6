"""What mends a check that fails, where several have the same remedy."""

MOVE_BASE = "move arm.base_x or arm.base_z"
SOFTER = "lower press.jack_speed, press.run_up_acceleration, run_up_jerk or run_down_acceleration"
