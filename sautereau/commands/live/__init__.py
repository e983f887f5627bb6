"""A session while it goes on: in the terminal, and in Foxglove."""
