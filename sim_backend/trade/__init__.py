"""Work-precision studies: which step and models reach an accuracy, and what they cost."""
