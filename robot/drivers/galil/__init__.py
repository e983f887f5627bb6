"""The driver of Galil's motion controllers."""
