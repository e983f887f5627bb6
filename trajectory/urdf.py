"""The rig as a URDF: arm, key and jack as links, for viewers and simulators of robots.

The root frame is that of the key's geometry: the balance pin is its origin, x points to the jack, z
up. The joints are ``joint_1`` and ``joint_2`` of the arm, ``key_pin`` of the key, positive where
the jack rises, and ``jack_guide``, the jack's rise in m. Angles turn x towards z, which is about
-y.
"""

import math
from pathlib import Path
from xml.sax.saxutils import escape

from sautereau.rig.schema import Rig
from sautereau.trajectory.key import rise_of_angle

WIDTH = 0.012  # m, of the links as they are drawn
JACK = 0.1  # m, length of the jack as it is drawn
KEY_LIMIT = math.radians(10)  # rad, of the key's angle; no key reaches it


def rig_urdf(rig: Rig) -> str:
    """Return the URDF of a rig: lengths and limits of its table, masses of the arm's links."""
    arm, key = rig.arm, rig.key
    text = Path(__file__).with_suffix(".xml").read_text(encoding="utf-8")
    return text.format(
        name=escape(rig.name, {'"': "&quot;"}),
        arm=arm,
        upper=_rod(arm.upper_mass, arm.upper_length),
        lower=_rod(arm.lower_mass, arm.lower_length),
        key=key,
        middle=(key.jack_arm - key.front_arm) / 2,
        length=key.jack_arm + key.front_arm,
        height=key.surface_height - WIDTH / 2,
        width=WIDTH,
        thickness=WIDTH / 3,
        jack=JACK,
        half=JACK / 2,
        most=KEY_LIMIT,
        rises=[float(rise_of_angle(key, angle)) for angle in (-KEY_LIMIT, KEY_LIMIT)],
        unlimited=1e3,  # N, N m, m/s or rad/s, where no motor drives the joint
    )


def _rod(mass: float, length: float) -> tuple[float, float, float]:
    """Return the middle of a slender rod [m], and its inertia along and across it [kg m^2]."""
    return length / 2, mass * WIDTH**2 / 6, mass * length**2 / 12
