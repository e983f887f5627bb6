"""Live views of a running session: in the terminal, and in Foxglove."""
