"""The finite-element level: one file each for outline, mesh, load, solution, map, cache, figure.

All of it works without dimensions: lengths are counted in the plectrum's length L, stresses
in Young's modulus E, forces in E W L of the width W. So E and W change nothing that is
computed here, and one stored map serves every plectrum of a shape.
"""
