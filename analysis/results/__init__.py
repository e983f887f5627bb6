"""Results as plain values for JSON, and as lines of text."""
