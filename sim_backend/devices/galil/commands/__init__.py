"""The commands of the emulated Galil controller, grouped by what they act on."""
