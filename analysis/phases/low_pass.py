"""Low-pass of a sensor, applied to the columns of a fit."""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import correlate1d
from scipy.signal import butter

from sautereau.rig.acquisition import Channel
from sautereau.trajectory.motion import Floats

SLOW = 2.5e3  # Hz, corner frequency below which a release is no step in the signal
NEGLIGIBLE = 1e-3  # Part of the response to a step that is neglected


@dataclass(frozen=True)
class LowPass:
    """A Butterworth filter, whose delay of slow motions is compensated."""

    corner: float
    """Hz."""
    order: int
    delay: float
    """s, of slow motions."""

    def ahead(self, step: float) -> int:
        """Return the number of rows after a row that have a part in it, for rows of a step [s]."""
        return math.ceil(self.delay / step) + 1

    def filtered(self, rows: NDArray[Any], step: float, n: int) -> NDArray[Any]:
        """Return filtered columns.

        Args:
            rows: Of at least n + `ahead` rows, shape (..., rows, columns). Before the first row the
                columns are 0.
            step: s, between rows.
            n: Rows to return.

        Returns:
            Shape (..., n, columns).
        """
        weights = _weights(self, step)
        origin = (len(weights) - 1) // 2 - self.ahead(step)
        found = correlate1d(rows, weights, axis=-2, mode="constant", origin=origin)
        return found[..., :n, :]


def slow_low_pass(channel: Channel | None) -> LowPass | None:
    """Return the low-pass of a channel's sensor, if it is slow and its order is known."""
    if channel is None or not channel.low_pass_order or channel.low_pass > SLOW:
        return None
    return LowPass(channel.low_pass, channel.low_pass_order, channel.low_pass_delay)


@lru_cache(maxsize=16)
def _weights(low_pass: LowPass, step: float) -> Floats:
    """Return the parts of a row's neighbours in it, earlier ones first; their sum is 1.

    Between rows a column is linear. So the parts are second differences of the response to a ramp,
    a line and a sum of exponentials.
    """
    turn = 2 * math.pi * low_pass.corner
    filtering: Any = butter(low_pass.order, turn, analog=True, output="zpk")
    poles = filtering[1]
    others = poles[:, None] - poles
    np.fill_diagonal(others, 1.0)
    residues = turn**low_pass.order / others.prod(1) / poles**2
    rows = math.ceil(math.log(NEGLIGIBLE) / poles.real.max() / step)
    time = np.arange(rows, -low_pass.ahead(step) - 2, -1) * step + low_pass.delay
    since = np.maximum(time, 0.0)
    ramp = since - low_pass.delay + (np.exp(since[:, None] * poles) @ residues).real
    weights = np.diff(np.where(time > 0, ramp, 0.0), 2)
    return weights / weights.sum()
