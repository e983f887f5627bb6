"""The quasi-static pluck of plectrum and spring string, for one case or many."""
