"""The quasi-static pluck: plectrum and spring string, for one case or many."""
