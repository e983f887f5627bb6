"""Robot experiments on keyboard instruments, from the motor to the fitted model.

In the repository, the folders beside this one are its subpackages: `rig/` is imported as
`sautereau.rig`, and likewise trajectory, daq, analysis, sim_backend and robot.
"""

from importlib.metadata import version

__version__ = version("sautereau")
