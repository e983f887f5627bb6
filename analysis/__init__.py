"""From recordings to conclusions."""
