"""Presses whose contact and release are known, made in numpy for the tests of the analysis."""

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import cumulative_trapezoid

from benchmarks.campaign import write_presses
from sautereau.analysis.loading.press import Press
from sautereau.analysis.model.predict import predict
from sautereau.trajectory.key import key_motion, rise_of_angle, rise_slope
from sautereau.trajectory.motion import Motion

RUN_UP, RUN_DOWN = 10e-3, 20e-3


@pytest.fixture(scope="session")
def campaign_folder(tmp_path_factory):
    """Recordings of 3 plectra in 2 sessions of 2 presses; not to be changed."""
    folder = tmp_path_factory.mktemp("campaign")
    write_presses(folder, 3, 2, 2)
    return folder


@pytest.fixture(scope="session")
def prediction(paper):
    """What the model predicts of a press with the packaged rig."""
    return predict(paper)


@pytest.fixture(scope="session")
def make_press(paper):
    """Make a press with a jack at constant speed between two smooth ramps."""

    def make(
        *,
        rate=51_200.0,
        speed=0.072,
        contact=0.052,
        release=0.072,
        start=0.025,
        slope=27.0,
        curvature=0.0,
        level=0.33,
        force_noise=0.0,
        velocity_noise=0.0,
        hum=0.0,
        until=None,
        simulated=True,
        seed=0,
    ):
        """Times in s; slope in N/s and curvature in N/s^2 of the force while it is held."""
        random = np.random.default_rng(seed)
        bottom = start + RUN_UP / 2 + 10e-3 / speed
        time = np.arange(round((until or bottom + 0.05) * rate)) / rate
        up, d_up = _ramp(time, start, RUN_UP)
        down, d_down = _ramp(time, bottom - RUN_DOWN / 2, RUN_DOWN)
        jack_speed = speed * (up - down)
        rise = cumulative_trapezoid(jack_speed, time, initial=0)
        angle = key_motion(paper.key, Motion(rise, jack_speed, speed * (d_up - d_down)))
        inertia = paper.key.inertia + paper.jack.mass * paper.key.jack_arm**2
        force = inertia * angle.acceleration / paper.key.press_arm + level * (rise > 0)
        tau = time - contact
        held = (time >= contact) & (time < release)
        force = force + np.where(held, (slope + curvature * tau) * tau, 0)
        force = force + force_noise * random.standard_normal(len(time))
        force = force + hum * np.sin(2 * np.pi * 50 * time + 1)
        velocity = angle.velocity * paper.key.laser_arm
        velocity = velocity + velocity_noise * random.standard_normal(len(time))
        return build(velocity, force, rate, simulated)

    def build(velocity, force, rate, simulated=True):
        time = np.arange(len(force)) / rate
        spin = velocity / paper.key.laser_arm
        turned = cumulative_trapezoid(spin, time, initial=0)
        columns = {
            "velocity": velocity,
            "force": force,
            "angle": turned,
            "deflection": turned * paper.key.laser_arm,
            "jack_rise": rise_of_angle(paper.key, turned),
            "jack_speed": spin * rise_slope(paper.key, turned),
        }
        return Press(Path("press-0001.mcap"), paper, simulated, time, columns, rate)

    make.build = build
    return make


def _ramp(time, start, duration):
    """Return a half cosine from 0 to 1, and its derivative."""
    u = np.clip((time - start) / duration, 0, 1)
    return (1 - np.cos(np.pi * u)) / 2, np.pi / duration * np.sin(np.pi * u) / 2
