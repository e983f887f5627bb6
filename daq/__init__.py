"""From the terminal block to a durable file."""
