"""A spinet of two choirs, and presses of it whose strings are known."""

from benchmarks.simulated import acquired
from benchmarks.spinet import SPINET
from sautereau.analysis.loading.press import press_of
from sautereau.sim_backend.physics.observation import observe
from sautereau.sim_backend.scene import load_scene


def recorded_spinet(seed=0, rig=SPINET, **truth):
    """Return the recording of a press of the spinet, and its true plucks in order of releases.

    Args:
        truth: Values in which the simulated spinet differs from the rig, by dotted key.

    Returns:
        The recording; and string, contact and release [s] of each pluck.
    """
    changes = {"engine": "exact", "sensors": load_scene("paper").sensors, "truth": truth}
    scene = load_scene("ideal").model_copy(update=changes)
    recorded, events = acquired(rig, scene, observe(rig, scene), seed)
    contacts = {event.choir: event.time for event in events.contact_events}
    plucks = [(e.choir + 1, contacts[e.choir], e.time) for e in events.release_events]
    return recorded, plucks


def spinet_press(seed=0, rig=SPINET, **truth):
    """Return the press of `recorded_spinet`, and its true plucks."""
    recorded, plucks = recorded_spinet(seed, rig, **truth)
    return press_of(recorded), plucks
