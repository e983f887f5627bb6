"""The presses of one session: comparison with the model, and repeatability."""
