"""The driver of ODrive's motor controllers."""
