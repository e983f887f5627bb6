"""One recorded press: its signals in SI units, its features, its replay and its sound."""
