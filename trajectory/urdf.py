"""The rig as a URDF: arm, key and jack as links, for viewers and simulators of robots.

The root frame is that of the key's geometry: the balance pin is its origin, x points to the jack, z
up. The joints are ``joint_1`` and ``joint_2`` of the arm, ``key_pin`` of the key, positive where
the jack rises, and ``jack_guide``, the jack's rise in m.
"""

import math
from collections.abc import Iterable, Sequence
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from sautereau.rig.schema import Rig
from sautereau.trajectory.key import rise_of_angle

ROOT = "rig"
"""Name of the root link."""
WIDTH = 0.012
"""m, of the links as they are drawn."""
JACK = 0.1
"""m, length of the jack as it is drawn."""
KEY_LIMIT = math.radians(10)
"""rad, of the key's angle; no key reaches it."""
UNLIMITED = 1e3
"""N, N m, m/s or rad/s where nothing limits a joint that no motor drives."""

Point = Sequence[float]


def rig_urdf(rig: Rig) -> str:
    """Return the URDF of a rig: lengths and limits of its table, masses of the arm's links."""
    arm, key = rig.arm, rig.key
    robot = Element("robot", name=f"sautereau {rig.name}")
    SubElement(robot, "link", name=ROOT)
    upper = _link(robot, "arm_1", _box(0.0, arm.upper_length, 0.0))
    _rod(upper, arm.upper_mass, arm.upper_length)
    tip = ((arm.lower_length, 0.0, 0.0), Element("sphere", radius=f"{arm.fingertip_radius!r}"))
    lower = _link(robot, "arm_2", _box(0.0, arm.lower_length, 0.0), tip)
    _rod(lower, arm.lower_mass, arm.lower_length)
    _link(robot, "key", _box(-key.front_arm, key.jack_arm, key.surface_height - WIDTH / 2))
    _link(robot, "jack", ((0.0, 0.0, JACK / 2), Element("box", size=f"{WIDTH / 3} {WIDTH} {JACK}")))
    limits = [*zip(arm.lower_limits, arm.upper_limits, strict=True)]
    motor = (arm.torque_limit, arm.speed_limit)
    _joint(robot, "joint_1", (ROOT, "arm_1"), (arm.base_x, 0, arm.base_z), limits[0], motor)
    _joint(robot, "joint_2", ("arm_1", "arm_2"), (arm.upper_length, 0, 0), limits[1], motor)
    _joint(robot, "key_pin", (ROOT, "key"), (0, 0, 0), (-KEY_LIMIT, KEY_LIMIT))
    rises = [float(rise_of_angle(key, angle)) for angle in (-KEY_LIMIT, KEY_LIMIT)]
    foot = (key.jack_arm, 0, key.jack_surface_height)
    _joint(robot, "jack_guide", (ROOT, "jack"), foot, rises, kind="prismatic")
    ElementTree.indent(robot)
    return f'<?xml version="1.0"?>\n{ElementTree.tostring(robot, "unicode")}\n'


def _link(robot: Element, name: str, *shapes: tuple[Point, Element]) -> Element:
    """Add a link of shapes, each with its centre in the link's frame, m."""
    link = SubElement(robot, "link", name=name)
    for centre, shape in shapes:
        visual = SubElement(link, "visual")
        SubElement(visual, "origin", xyz=_numbers(centre))
        SubElement(visual, "geometry").append(shape)
    return link


def _box(start: float, stop: float, z: float) -> tuple[Point, Element]:
    """Return a bar along x, m."""
    return ((start + stop) / 2, 0.0, z), Element("box", size=f"{stop - start!r} {WIDTH} {WIDTH}")


def _rod(link: Element, mass: float, length: float) -> None:
    """Give a link the mass of a slender rod along x, kg."""
    inertial = SubElement(link, "inertial")
    SubElement(inertial, "origin", xyz=_numbers((length / 2, 0, 0)))
    SubElement(inertial, "mass", value=repr(mass))
    across, along = mass * length**2 / 12, mass * WIDTH**2 / 6
    values = {"ixx": along, "iyy": across, "izz": across, "ixy": 0, "ixz": 0, "iyz": 0}
    SubElement(inertial, "inertia", {name: repr(value) for name, value in values.items()})


def _joint(
    robot: Element,
    name: str,
    links: tuple[str, str],
    origin: Point,
    limits: Sequence[float],
    motor: tuple[float, float] = (UNLIMITED, UNLIMITED),
    kind: str = "revolute",
) -> None:
    """Add a joint between a parent and a child link; ``motor`` are its effort and speed limits."""
    joint = SubElement(robot, "joint", name=name, type=kind)
    SubElement(joint, "parent", link=links[0])
    SubElement(joint, "child", link=links[1])
    SubElement(joint, "origin", xyz=_numbers(origin))
    # Angles turn x towards z, which is about -y.
    SubElement(joint, "axis", xyz="0 0 1" if kind == "prismatic" else "0 -1 0")
    effort, speed = map(repr, motor)
    low, high = map(repr, limits)
    SubElement(joint, "limit", lower=low, upper=high, effort=effort, velocity=speed)


def _numbers(values: Iterable[float]) -> str:
    return " ".join(map(repr, values))
