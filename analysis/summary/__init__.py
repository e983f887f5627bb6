"""What was found, as plain values for machines and as lines of text for people."""
