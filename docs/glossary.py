"""docs/glossary.md: the reported quantities, the instrument's words and the robot's words.

`python -m docs.glossary` rewrites the page; a test checks that the committed page is up to date.
"""

from collections.abc import Iterator
from pathlib import Path

from sautereau.rig.quantities import SECTIONS

PAGE = Path(__file__).with_suffix(".md")

INSTRUMENT = {
    "action": "All moving parts between the key and the string: key, jacks, plectra, dampers.",
    "balance pin": "Pin about which the key rotates; origin of all lengths on the key.",
    "balance rail": "Wooden rail under the keys that carries the balance pins.",
    "bridge": "Bar on the soundboard that ends the sounding length of the string and transmits its"
    " force to the soundboard.",
    "choir": "One set of strings and jacks, one of each for every key. A key of an instrument with"
    " two choirs plucks two strings.",
    "clearance": "Height of the string above the plectrum while the jack rests: the jack rises by"
    " it before contact.",
    "contact": "Instant at which the plectrum touches the string.",
    "damper": "Felt on the jack that stops the string when the jack is at rest.",
    "front felt": "Felt under the front end of the key that limits its rotation.",
    "guide": "Slot in a register in which the jack slides.",
    "jack": "Wooden slip that stands on the rear end of the key, slides up through the register and"
    " carries plectrum and damper. French: *sautereau*.",
    "jack rail": "Padded rail above the jacks that limits their rise.",
    "key dip": "Path of the key at the pressing point from rest to the front felt.",
    "nut": "Bar that ends the sounding length of the string at the side of the tuning pins.",
    "overlap": "Length of the plectrum's tip beyond the string, on which the string slides off.",
    "plectrum": "Small cantilever of bird quill or plastic (Delrin) that bends under the string"
    " and plucks it.",
    "pluck": "Everything from contact to release: the plectrum lifts and bends under the string"
    " until the string slips off its tip.",
    "plucking point": "Place on the string where the plectrum touches it.",
    "quill": "Another word for the plectrum, from the feathers of which it used to be cut.",
    "register": "Slotted batten that guides the jacks of one choir. Moved sideways it engages or"
    " disengages the choir.",
    "release": "Instant at which the string slips off the plectrum.",
    "soundboard": "Thin wooden plate that radiates the sound.",
    "tongue": "Pivoted part of the jack that holds the plectrum. It swings back on the way down, so"
    " that the plectrum passes the string without plucking it.",
    "touch": "What the player feels: the finger force over the key's path, above all the release"
    " force.",
    "voicing": "Shaping the plectrum (length, thickness, taper) until touch and loudness are even.",
}
"""Words of the instrument, for the roboticist."""

ROBOT = {
    "AC coupling": "High-pass filter in a sensor's amplifier. It loses the level and slow changes;"
    " the analysis inverts it down to the level itself.",
    "acquisition card (DAQ)": "Device that samples the sensors' voltages at a constant rate.",
    "arm, to": "To prepare a device so that it starts at the trigger.",
    "controller": "Device that moves the motors: it executes the planned motion segment by segment"
    " and closes the position loop.",
    "Coulomb friction": "Dry friction: a constant force against the motion, any force up to it at"
    " rest.",
    "cruise": "Part of the press in which the jack has its constant speed.",
    "elbow": "Joint 2; `up` and `down` are the two poses of the arm with the same fingertip.",
    "emulator": "Program that answers in place of a device, in the device's own protocol.",
    "encoder count": "Smallest step of a joint's position sensor; the controller computes in"
    " counts.",
    "feed-forward": "Motor torque computed in advance, from the planned motion or a measured force,"
    " and added to the output of the position loop.",
    "following error": "Planned minus actual position of a joint. Beyond a limit the controller"
    " stops.",
    "gRPC": "Protocol for calling functions of a program on another computer over a network, here"
    " of the computer with the acquisition card.",
    "homing": "Driving the joints to known switches or stops in order to find the zeros of their"
    " encoders.",
    "inverse dynamics": "Computing the force that a measured motion requires. Its residual is the"
    " measured minus the computed force.",
    "iterative learning control": "Correcting the planned motion from press to press by the"
    " measured speed error of the press before.",
    "jerk": "Derivative of the acceleration; limiting it keeps the arm from vibrating.",
    "keep-alive": "Message that the computer sends at intervals so that the watchdog does not stop"
    " the motors.",
    "limit switch": "Switch at the end of a joint's range; the controller stops there.",
    "pre-trigger": "Samples that the acquisition card keeps from before the trigger.",
    "pseudo-terminal": "Software serial port, through which the stand-in is reached like a real"
    " controller.",
    "PVT": "Position, velocity, time: the format of the motion segments. Between two segments'"
    " ends the controller interpolates with a cubic.",
    "quality flag": "Mark on samples that cannot be trusted: clipped, overloaded or dropped out.",
    "sample period": "Time between two updates of the controller's position loop.",
    "servo": "Motor with an encoder and a position loop.",
    "singularity": "Pose in which the arm is stretched or folded, so that the fingertip cannot move"
    " in one direction.",
    "stand-in": "Simulated bench: emulated controller and acquisition card with simulated physics"
    " behind them.",
    "trigger": "Edge of a digital signal that starts acquisition and motion; time 0 of a"
    " recording.",
    "watchdog": "Timer in the controller that switches the motors off when the computer has been"
    " silent for too long.",
    "work-precision study": "Measuring computing time against the error of the result, for several"
    " methods and step sizes (command `trade`).",
}
"""Words of the controller and the robot, for the acoustician."""


def page() -> str:
    """Return the text of the page."""
    return "\n".join(_lines())


def _lines() -> Iterator[str]:
    yield from (
        "# Glossary",
        "",
        "Generated by `python -m docs.glossary`; edit `rig/quantities.py` or `docs/glossary.py`.",
        "",
        "## Quantities",
        "",
        "*Name* is the key in `--json` and the column of tables; values there are in the SI unit.",
        "",
    )
    for heading, quantities in SECTIONS.items():
        yield from (
            f"### {heading}",
            "",
            "| name | symbol | unit | label | definition |",
            "|---|---|---|---|---|",
        )
        for each in quantities.values():
            symbol = f"`{each.symbol}`" if each.symbol else ""
            yield f"| `{each.name}` | {symbol} | {each.unit} | {each.label} | {each.definition} |"
        yield ""
    for heading, terms in (
        ("The instrument, for roboticists", INSTRUMENT),
        ("The controller and the robot, for acousticians", ROBOT),
    ):
        yield from (f"## {heading}", "", "| term | meaning |", "|---|---|")
        yield from (f"| {term} | {meaning} |" for term, meaning in terms.items())
        yield ""


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
