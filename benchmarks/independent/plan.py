"""The push: the jack rises at constant speed, holds and returns; the key's angle for it."""

import numpy as np

from .conditions import Conditions


def _blend(u: np.ndarray) -> np.ndarray:
    """Return the integral of the smooth step 3 u^2 - 2 u^3 from 0 to u."""
    return u**3 - u**4 / 2


def jack_rise(c: Conditions, times: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the planned rise of the jack and the time at which the plan ends.

    The blend to rest at the end takes twice as long as the run-up where the rise allows it.

    Args:
        times: s after the start of the push; shape (n,).
    """
    speed, rise, return_speed = c.speed, c.rise, c.return_speed
    run_up = min(c.run_up, 0.6 * rise / speed)
    run_down = min(2 * run_up, 0.8 * rise / speed)
    cruise = rise / speed - run_up / 2 - run_down / 2

    def up(t):
        t = np.clip(t, 0, run_up + cruise + run_down)
        y = speed * run_up * _blend(np.clip(t / run_up, 0, 1))
        y = y + speed * np.clip(t - run_up, 0, cruise)
        end = np.clip((t - run_up - cruise) / run_down, 0, 1)
        return y + speed * run_down * (end - _blend(end))

    pressed = run_up + cruise + run_down
    blend = 0.4 * rise / return_speed
    steady = rise / return_speed - blend

    def down(t):
        y = return_speed * blend * _blend(np.clip(t / blend, 0, 1))
        y = y + return_speed * np.clip(t - blend, 0, steady)
        end = np.clip((t - blend - steady) / blend, 0, 1)
        return y + return_speed * blend * (end - _blend(end))

    return up(times) - down(times - pressed - c.hold), pressed + c.hold + 2 * blend + steady


def key_angle(rise: np.ndarray, jack_arm: float, surface_height: float) -> np.ndarray:
    """Return the angle of a rigid key at which a slider at ``jack_arm`` has risen by ``rise``.

    rise = b tan a + h (1 / cos a - 1), solved by Newton's method.
    """
    angle = rise / jack_arm
    for _ in range(6):
        error = jack_arm * np.tan(angle) + surface_height * (1 / np.cos(angle) - 1) - rise
        slope = jack_arm / np.cos(angle) ** 2 + surface_height * np.sin(angle) / np.cos(angle) ** 2
        angle = angle - error / slope
    return angle
