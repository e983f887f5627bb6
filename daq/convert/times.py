"""Start and sampling rate from a column of times, which must be even."""

import numpy as np

from sautereau.daq.convert.formats import ImportSource
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.recorded import Signal

EVEN = 0.1
"""Sampling intervals by which a time may differ from an even grid, since files round times."""
LOOSE = 1.0
"""The same if the rate is given; from one interval on, a sample may be missing."""
EXACT = 1e-6
"""Sampling intervals by which the times of an exactly even grid may differ from it."""
RATE_ERROR = 1e-4
"""Dimensionless, relative uncertainty of a rate above which a warning reports it."""
PLAUSIBLE = (100.0, 1e7)
"""Hz, range of usual sampling rates."""
MOST_DIGITS = 12
"""Decimal places of s up to which rounding is recognised."""


def start_and_rate(
    times: Signal, rate: float | None, source: ImportSource
) -> tuple[float, float, list[str]]:
    """Return the start (s) and the rate (Hz) of a column of times, and warnings.

    Args:
        times: Shape (n_samples,), s.
        rate: Hz; None to compute it from the times. A given rate is compared with them.
        source: The file, for the place of a row in messages.

    Raises:
        RecordingError: The times fall, or are not even at that rate.
    """
    if len(times) < 2:
        raise RecordingError("its column of times has fewer than two rows; give --rate instead")
    falls = np.flatnonzero(np.diff(times) < 0)
    if len(falls):
        k = int(falls[0])
        raise RecordingError(
            f"its column of times falls in {source.where(k + 1)}, from {times[k]:.9g} to"
            f" {times[k + 1]:.9g} s; give the rows of one acquisition, or omit --time and give"
            " --rate"
        )
    span = float(times[-1] - times[0])
    if not span > 0:
        raise RecordingError(
            f"all its times are {times[0]:.9g} s; omit --time and give --rate instead"
        )
    given, mean = rate is not None, (len(times) - 1) / span
    rate = float(f"{mean:.9g}") if rate is None else rate
    error = np.abs((times - times[0]) * rate - np.arange(len(times)))
    worst = int(np.argmax(~(error <= EVEN)))
    rounded = _rounding(times)
    place = (
        f"{source.where(worst)} at {times[worst]:.9g} s is {error[worst]:.3g} sampling intervals"
        " off"
    )
    warnings = []
    if error.max() > EVEN:
        allowed = LOOSE + (rounded * rate if rounded * rate > 1 else 0.0)
        if given and error.max() > allowed * (1 - EXACT):
            raise RecordingError(
                f"its column of times is not even at {rate:.9g} Hz: {place}; the times give"
                f" {mean:.6g} Hz: give the correct --rate or a file without missing samples, or"
                " omit --time, and the column is ignored"
            )
        if not given:
            to = f" to {rounded:.3g} s" if rounded * rate > EVEN else ""
            raise RecordingError(
                f"its column of times is not even at {rate:.9g} Hz: {place}: samples are"
                f" missing, or the times jitter or are rounded{to}. Nothing is resampled: if the"
                " card's clock was even, give its exact rate with --rate"
            )
        warnings.append(
            f"the times differ from an even {rate:.9g} Hz by up to {error.max():.3g} sampling"
            " intervals; only the first of them is used"
        )
    if not given and error.max() > EXACT and rounded / span > RATE_ERROR:
        warnings.append(
            f"the times are rounded to {rounded:.3g} s, so the rate of {rate:.9g} Hz is uncertain"
            f" by {100 * rounded / span:.1f} %; give the exact --rate"
        )
    if not PLAUSIBLE[0] <= rate <= PLAUSIBLE[1]:
        warnings.append(
            f"the times give an unusual rate of {rate:.6g} Hz; if they are not in s, give"
            " --time-unit ms or us"
        )
    return float(times[0]), rate, warnings


def _rounding(times: Signal) -> float:
    """Return the decimal step of which all times are multiples, s; 0 for none."""
    for digits in range(MOST_DIGITS):
        steps = times * 10.0**digits
        if np.abs(steps - np.round(steps)).max() < 1e-3:
            return 10.0**-digits
    return 0.0
