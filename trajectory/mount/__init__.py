"""Choice of the place to clamp the robot, and its measurement."""
