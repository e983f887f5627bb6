"""The pluck of the moving string against travelling waves, which know no modes."""

import numpy as np
import pytest

from sautereau.analysis.model.plectrum.levels import plectrum_map
from sautereau.analysis.model.predict import rig_pluck
from sautereau.analysis.model.string.modal import modal_pluck
from sautereau.rig.load import load_rig

RIG = load_rig()


def by_waves(rig, steps):
    """Return release [s] and force [N] with the string as travelling waves, all modes in it.

    At the plucking point a force moves an endless string by w = integral of F c / 2T; the
    fixed ends add its images, late by the way there and back: w of every 2kL, and -w of
    every 2 (p + kL). Trapezoidal rule; contact by scipy's general solver of equations.
    """
    from scipy.optimize import fsolve

    string, plectrum = rig.string, plectrum_map(rig.plectrum, "elastica")
    c = 2 * string.length * string.frequency
    speed = rig.press.jack_speed
    dt = rig_pluck(rig).release_height / speed / steps
    rest = plectrum.length - rig.plectrum.overlap
    k = np.arange(-100, 101)
    image = np.concatenate([k[k != 0] * string.length, string.plucking_point + k * string.length])
    late = 2 * np.abs(image) / c
    sign = np.concatenate([np.ones(len(k) - 1), -np.ones(len(k))])
    sign, late = sign[late < 2 * steps * dt], late[late < 2 * steps * dt]
    time, w, force = np.arange(2 * steps) * dt, np.zeros((2, 2 * steps)), np.zeros((2, 2 * steps))
    give = dt / 4 * c / string.tension
    now = last = np.array([rest, 0.0])
    for i in range(1, 2 * steps):
        echo = [sign @ np.interp(time[i] - late, time[:i], moved[:i], left=0.0) for moved in w]
        free = w[:, i - 1] + give * force[:, i - 1] + echo

        def apart(unknown, free=free, i=i):
            s, f = unknown
            bend = plectrum.bend(s, f)
            return [
                (bend.x - rest - free[0] + give * f * np.sin(bend.theta)) * 1e3,
                (bend.z + speed * time[i] - free[1] - give * f * np.cos(bend.theta)) * 1e3,
            ]

        ahead = fsolve(apart, np.maximum(2 * now - last, 0), xtol=1e-12)
        if ahead[0] >= plectrum.length:
            share = (plectrum.length - now[0]) / (ahead[0] - now[0])
            return time[i - 1] + share * dt, now[1] + share * (ahead[1] - now[1])
        last, now = now, ahead
        theta = plectrum.bend(*now).theta
        force[:, i] = now[1] * np.array([-np.sin(theta), np.cos(theta)])
        w[:, i] = w[:, i - 1] + give * (force[:, i - 1] + force[:, i])
    raise AssertionError("no release")


@pytest.mark.parametrize("speed", [0.3, 1.0])
def test_travelling_waves_agree(speed):
    press = RIG.press.model_copy(update={"jack_speed": speed})
    rig = RIG.model_copy(update={"press": press})
    release, force = by_waves(rig, 300)
    modal = modal_pluck(rig)
    assert modal.release == pytest.approx(release, rel=2e-5)
    assert modal.plectrum_force == pytest.approx(force, rel=5e-5)
