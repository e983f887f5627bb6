"""The finite-element level: one file each for outline and mesh, load, solution, map.

All quantities are dimensionless: lengths in units of the plectrum's length L, stresses in
Young's modulus E, forces in E W L with the width W. So the results do not depend on E and W,
and one stored map serves every plectrum of a shape.
"""
