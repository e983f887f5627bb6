"""From the key's geometry to joint motion: pure numpy, no input or output."""
