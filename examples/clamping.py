"""Where to clamp the robot: the finger's tilt for all possible positions of the base.

python -m examples.clamping [picture.png]
"""

import math
import sys
from pathlib import Path

from sautereau.analysis.results.mount import mount_figure
from sautereau.rig.load import load_rig
from sautereau.rig.schema import Rig
from sautereau.trajectory.mount.find import Mount, find_mount, mount_map


def study(rig: Rig) -> Mount:
    """Return the best position of the base."""
    return find_mount(rig)


def plot(path: str | Path, rig: Rig, mount: Mount) -> None:
    """Plot the tilt over all positions, and the arm at the best one, into a file."""
    mount_figure(rig, mount_map(rig), mount).savefig(path, dpi=120)


def main() -> None:
    rig = load_rig()
    mount = study(rig)
    print(
        f"base at x = {mount.base_x * 1e3:.2f} mm, z = {mount.base_z * 1e3:.2f} mm:"
        f" the finger tilts by {math.degrees(mount.tilt_max):.4f} deg"
    )
    if len(sys.argv) > 1:
        plot(sys.argv[1], rig, mount)


if __name__ == "__main__":
    main()
