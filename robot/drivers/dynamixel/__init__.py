"""The driver of Dynamixel bus servos."""
