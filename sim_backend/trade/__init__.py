"""Accuracy against speed: what a scene needs for the accuracy it asks, and what that costs."""
