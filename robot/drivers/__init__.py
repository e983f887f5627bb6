"""Drivers of motion controllers, one folder each, and what they share."""
