"""Robot experiments on keyboard instruments, from the motor to the fitted model.

The folders beside this one are its subpackages: `sautereau.rig`, `sautereau.trajectory`,
`sautereau.daq`, `sautereau.analysis`, `sautereau.sim_backend` and `sautereau.robot`.
"""

from importlib.metadata import version

__version__ = version("sautereau")
