"""From a trajectory to a press."""
