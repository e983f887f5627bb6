"""The emulated bus servos: Dynamixel X with Protocol 2.0."""
