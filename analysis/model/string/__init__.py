"""The string: its compliance as a spring, its modes, and its contact with a moving plectrum."""
