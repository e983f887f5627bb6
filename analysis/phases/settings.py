"""The numbers on which the phases of a press depend, apart from the press and its rig.

Each changes what is found in presses with a known truth, times 1.5 or over 1.5
(`tests/analysis/test_phase_settings.py`). A number that changes nothing is no setting: numerical
tolerances stand beside their use. Unless stated otherwise, the values are from presses of the
independent simulator, and were tested on others.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class PhaseSettings:
    """Settings of `find_phases`; ranges are those within which they make sense."""

    # Samples
    row: float = 80e-6
    """s, shortest row of the load (20 us to 1 ms): in shorter ones the noise of the velocity
    exceeds the load."""
    force_floor: float = 5e-4
    """N, smallest noise of a sample of the force (above 0): errors of the model of the key."""
    velocity_floor: float = 5e-6
    """m/s, smallest noise of a sample of the velocity (above 0), likewise."""
    spread: int = 18
    """Samples on either side of clipped samples and of a release (1 to 100) over which the
    correction of the sensor's delay spreads them."""
    left: float = 0.005
    """Fraction of the full rise (0 to 0.1) at which the jack has left rest, and by which it is
    below its top."""
    rest: float = 40e-3
    """s, of the rest before the motion in which hum is fitted (above 10 ms, half a period)."""
    rest_margin: float = 2e-3
    """s, from the end of this rest to the start of the motion (0 to 10 ms)."""

    # Load of a key without a string: prior standard deviations
    inertia_std: float = 0.25
    """Of the relative error of the rig's inertia (0.05 to 1)."""
    rise_std: float = 0.5
    """N, of the change of the load of a rigid key over 10 mm of rise (0 to 1): cloth, springs and
    lead weights, as in the paper's figure 7."""
    drift_std: float = 0.03
    """N, of the change of the load at full speed, and of a compliant key also over 10 mm of rise
    and by a damper (0 to 1)."""
    hum_std: float = 5e-3
    """N, of mains hum at each frequency, sine and cosine (0 to 0.1)."""
    acceleration: float = 1.2e-3
    """s, window of the moving average, applied twice to the acceleration for its column of the fit
    (0.2 to 5 ms): its noise would otherwise fit the noise of the load."""
    damper_lift: float = 1e-3
    """m, rise of the jack at which a damper leaves its string on a compliant key (0.2 to 3 mm)."""

    # What the rig says of a string: standard deviations
    fall_std: float = 0.03
    """Relative, of the fall at release about the force of the string (0.01 to 0.3)."""
    shape_std: tuple[float, float] = (0.12, 0.4)
    """Of the quadratic and cubic term of a string's force (`Expected.bends`) (0.05 to 1): wide
    enough for a friction of the plectrum of up to 0.4, of which the rig says nothing, so that the
    data determine the shape."""
    contact_std: float = 0.5e-3
    """m, of the rise at contact (0.1 to 2 mm)."""
    climb_std: float = 0.4
    """Of the logarithm of the rise from contact to release (0.1 to 1)."""
    force_std: float = 0.5
    """Of the logarithm of a force (0.1 to 1)."""
    most_deviation: float = 4.0
    """Bound of a deviation in standard deviations (2 to 10), as a rig may be of another
    instrument."""
    shared_stds: tuple[float, float, float] = (0.3e-3, 0.3, 0.4)
    """Of the error that all strings share: rise at contact (m), logarithms of the rise from contact
    to release and of the force. They are those of a rig that was measured with a ruler."""

    # Compliant key
    width: float = 0.9e-3
    """s, least width of the boxcars that smooth the signals (0.3 to 2 ms): slow compared with the
    modes of the key."""
    widths: int = 110
    """Largest number of these widths in a way down (50 to 300); twice as many where the search is
    repeated."""
    sudden: float = 0.3
    """Error of the load over the local rms of fast motion (0.05 to 1): impacts and ringing, for
    which the relation between force, velocity and load does not hold."""
    loss_std: float = 2.5e-4
    """N s, prior standard deviation of the first derivative of a string's force, if its release is
    known: it shifts contact and release together."""
    sharp_std: float = 9e-7
    """N s^2, the same of the second derivative."""
    noise: float = 0.015
    """N, error of a smoothed row by vibration in the first round (2 to 50 mN); it weights the
    priors."""
    correlated: float = 2.0
    """This error in later rounds over the rms of the residuals (1 to 5), as adjacent rows are
    correlated."""
    significance: float = 6.0
    """Least significance of a growth of the load in the search (`Growth.significance`); twice this
    is needed for a pluck (3 to 20)."""
    anywhere: float = 0.1
    """Weight of a start of the search that is far from all strings of the rig (0 to 1)."""

    # Release on a compliant key
    block: float = 40e-6
    """s, shortest block of the fit of a release (10 to 200 us)."""
    before: float = 4e-3
    """s, of signal before a release that is part of its fit (1 to 10 ms)."""
    after: float = 2.5e-3
    """s, the same after it (1 to 10 ms): modes change as the jack leaves its cloth."""
    modes: int = 3
    """Most modes of the fit of a release (1 to 5)."""
    near: float = 0.25e-3
    """s, least standard uncertainty of a release before this fit (0.1 to 1 ms)."""

    # Uncertainties
    contact_larger: float = 1.6
    """Standard uncertainty of a contact or a force over that of its fit, in which the key has more
    parts than modelled (1 to 4)."""
    release_larger: float = 2.5
    """The same of a release, in whose fit modes are missing."""
    contact_least: float = 0.1e-3
    """s, standard uncertainty that is added to that of a contact (root sum of squares)."""
    release_least: float = 0.05e-3
    """s, the same of a release."""
    unexplained: float = 1.2
    """Added to the standard uncertainty of a contact, half of it to that of a release (0 to 5):
    this factor times the pluck's duration times the fraction of the force that is not explained."""
    change: float = 0.5
    """Part of the change of a contact by the weights of its rows that is added (0 to 1)."""
    several: float = 1.5
    """Factor of the uncertainties of releases and forces where a press has several (1 to 3): the
    ringing after one release disturbs the fit of the next."""
    exchange: float = 1.25
    """Ratio of two chi2 up to which exchanged contacts of strings held at once are possible (1.05
    to 2)."""

    # What is said
    doubtful: float = 1e-3
    """s, standard uncertainty above which a contact or a release gives a warning; also the distance
    of two releases, and of a quality flag from an instant, below which there is one (0.2 to 5
    ms)."""
    deviations: float = 3.0
    """Distance from what the rig expects, and from a string before, in standard deviations, beyond
    which it is said (2 to 5)."""
    motion: float = 1.2
    """Factor of speed and rise over those of the rig from which on it is said (1.05 to 2)."""
    force: float = 2.0
    """The same of force drop and inertia, to which the finger adds its own (1.2 to 5): of random
    instruments that are known to a ruler, 98 % remain within."""
    late: float = 0.3e-3
    """s, distance of force and velocity from which on it is said (0.1 to 5 ms), if it is certain by
    `deviations`."""


SETTINGS = PhaseSettings()
"""The settings of the package."""
