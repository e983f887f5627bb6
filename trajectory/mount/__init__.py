"""Where to clamp the robot, and where it is clamped."""
