"""The load that a key without a string does not explain, in a press without a pluck."""

import numpy as np
from scipy.ndimage import uniform_filter1d

from sautereau.analysis.phases.expected import Expected
from sautereau.analysis.phases.fit import KeyAndString
from sautereau.analysis.phases.found import Growth
from sautereau.analysis.phases.release import NO_RELEASE
from sautereau.analysis.phases.rows import Rows

PARTS = 100  # Duration of the way down over the time for which the residuals are averaged


def unexplained(
    strings: Expected, rest: Rows, down: Rows, before: tuple[float, float]
) -> tuple[float, float, Growth]:
    """Fit a rigid key without a string to the complete way down.

    Args:
        rest: Of the key at rest before the press; may be empty.
        before: Time [s] and rise [m] of the jack before it.

    Returns:
        Variance of the residuals over that of the noise, their rms [N], and where they climb and
        fall most.
    """
    noise, left = KeyAndString(strings, rest, down, NO_RELEASE, before).without_string()
    smooth = uniform_filter1d(left, max(1, len(left) // PARTS), mode="nearest")
    falls = np.maximum.accumulate(smooth) - smooth
    end = int(np.argmax(falls))
    peak = int(np.argmax(smooth[: end + 1]))
    start = int(np.argmin(smooth[: peak + 1]))
    growth = Growth(float(down.time[start]), float(down.time[end]), float(falls[end]), noise)
    return noise, float(np.sqrt(np.mean(left**2))), growth
