"""Start and sampling rate from a column of times, which must be even."""

import re

import numpy as np

from sautereau.daq.convert.formats import ImportSource
from sautereau.daq.errors import RecordingError
from sautereau.daq.file.recorded import Signal

EVEN = 0.1
"""Sampling intervals by which a time may differ from an even grid, since files round times."""
LOOSE = 1.0  # The same if the rate is given; from one interval on, a sample may be missing
EXACT = 1e-6  # Sampling intervals by which the times of an exactly even grid may differ from it
PLAUSIBLE = (100.0, 1e7)  # Hz, range of usual sampling rates
UNIX = (1e9, 2e9)
"""s since 1970, from 2001 to 2033: times that no clock of a bench shows, except as a date."""


def start_and_rate(
    times: Signal, rate: float | None, stated: float | None, source: ImportSource
) -> tuple[float, float, list[str]]:
    """Return the start (s) and the rate (Hz) of a column of times, and warnings.

    Args:
        times: Shape (n_samples,), s.
        rate: Hz, given by the user; None without one. It is compared with the times.
        stated: Hz, in the file; it is used if the times agree with it to within one interval.
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
    mean, warnings = (len(times) - 1) / span, []
    if rate is None and stated is not None:
        if abs(stated / mean - 1) * (len(times) - 1) <= LOOSE:
            rate = stated
        else:
            warnings.append(
                f"the rate of {mean:.9g} Hz of the column of times replaces the rate that the file"
                f" states, {stated:.9g} Hz"
            )
    given = rate is not None
    rate = float(f"{mean:.9g}") if rate is None else rate
    error = np.abs((times - times[0]) * rate - np.arange(len(times)))
    worst = int(np.argmax(~(error <= EVEN)))
    rounded = _rounding(times)
    place = (
        f"{source.where(worst)} at {times[worst]:.9g} s is {error[worst]:.3g} sampling intervals"
        " off"
    )
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
    if not given and error.max() > EXACT and rounded / span > 1e-4:
        warnings.append(
            f"the times are rounded to {rounded:.3g} s, so the rate of {rate:.9g} Hz is uncertain"
            f" by {100 * rounded / span:.1f} %; give the exact --rate"
        )
    return float(times[0]), rate, warnings


def own_axis(source: ImportSource, column: str, time: str) -> str | None:
    """Return the column of times of a column, if it has another one than this.

    That is the one of the same name in its group, or the nearest one of this name before it, as in
    `Time,A,Time,B` and `t1,v1,t2,v2`; but no column of the matrix that holds them all.
    """
    group, slash, _ = column.rpartition("/")
    if slash:
        own = f"{group}/{time.rpartition('/')[2]}"
        return own if own in source.names and own not in (time, column) else None
    before = source.names[: source.names.index(column)]
    base = _base(time) if _base(time) != _base(column) else ""
    alike = [name for name in before if name == time or (base and _base(name) == base)]
    return alike[-1] if alike and alike[-1] != time else None


def _base(name: str) -> str:
    """Return a name without its unit and its number."""
    return re.sub(r"[\s_]*\d*$", "", re.sub(r"\s*[(\[/].*", "", name))


def _rounding(times: Signal) -> float:
    """Return the decimal step of which all times are multiples, s; 0 for none."""
    for digits in range(12):
        steps = times * 10.0**digits
        if np.abs(steps - np.round(steps)).max() < 1e-3:
            return 10.0**-digits
    return 0.0
