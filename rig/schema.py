"""The rig: all quantities of the bench, frozen, in SI units.

A field's docstring gives its unit and its meaning. In TOML each is a quantity
(``press_arm = "171 mm"``) or, to record its origin, a table:
``inertia = { value = "7e-4 kg m^2", assumed = ["5e-4 kg m^2", "10e-4 kg m^2"] }``.
Lengths on the key are measured from the balance pin; x runs from the pin towards
the jack, z upwards, and the key's angle is positive when the jack rises.
"""

import math
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, PrivateAttr, model_validator

from sautereau.rig.acquisition import Daq
from sautereau.rig.instrument import Choir, Jack, Key, Plectrum, String
from sautereau.rig.registry import CONTROLLERS, NameIn
from sautereau.rig.units import GRAVITY, Angle, Length, Mass, Moment, Section, Time, Unit, Voltage

RotorInertia = Annotated[float, Unit("kg*m**2", "1e-6 kg m^2"), Field(ge=0)]
Stiffness = Annotated[float, Unit("N*m/rad", "27 N m/rad"), Field(gt=0)]
Damping = Annotated[float, Unit("N*m*s/rad", "0.25 N m s/rad"), Field(ge=0)]
GearRatio = Annotated[float, Field(gt=0)]
Fraction = Annotated[float, Field(strict=True, gt=0, le=1)]
LONGEST_GESTURE = 60.0  # s


class Gesture(Section):
    """A recorded gesture: the rise of the jack over time."""

    time: tuple[Time, ...] = Field(min_length=3)
    """s, times, starting at 0 and increasing."""
    rise: tuple[Length, ...] = Field(min_length=3)
    """m, rise of the jack at these times, starting at rest at 0."""

    @model_validator(mode="after")
    def _goes_from_rest(self):
        faults = []
        if len(self.time) != len(self.rise):
            faults.append(
                f"gesture: {len(self.time)} times and {len(self.rise)} rises; give equally many"
            )
        if self.time[0] != 0 or any(b - a < 0.999e-6 for a, b in pairwise(self.time)):
            faults.append(
                "gesture: time must start at 0 s and increase by 1 us or more; sort, shift or thin"
                " out the times"
            )
        if self.time[-1] > LONGEST_GESTURE:
            faults.append(
                f"gesture: it lasts {self.time[-1]:.4g} s, more than {LONGEST_GESTURE:g} s; check"
                " the unit of the file"
            )
        if abs(self.rise[0]) > 1e-6:
            faults.append(
                f"gesture: it starts at a rise of {self.rise[0] * 1e3:.4g} mm, not at 0 mm;"
                " subtract this from every rise"
            )
        if not -1e-6 <= min(self.rise) <= max(self.rise) <= 15e-3:
            faults.append(
                f"gesture: rises from {min(self.rise) * 1e3:.4g} to {max(self.rise) * 1e3:.4g} mm"
                " are not within 0 to 15 mm; check the unit of the file"
            )
        if faults:
            raise ValueError("\n".join(faults))
        return self


RunUpAcceleration = Annotated[float, Unit("m/s**2", "12 m/s^2"), Field(ge=1e-3, le=1e4)]
RunUpJerk = Annotated[float, Unit("m/s**3", "3000 m/s^3"), Field(ge=0.1, le=1e8)]
STEADY = 2e-3
"""s at constant speed before the first contact, where the run-up is not given: a compliant key has
come to rest, and the motion before a contact is known."""


class Press(Section):
    """One press, defined by the motion of the jack."""

    _clearance: float = PrivateAttr(default=0.0)
    """m, jack rise at the first contact; the rig sets it."""
    jack_speed: Annotated[float, Unit("m/s", "0.072 m/s")] = Field(ge=0.005, le=1.0)
    """m/s, constant speed of the jack during the pluck (the cruise)."""
    jack_rise: Length = Field(ge=1e-3, le=15e-3)
    """m, rise of the jack from rest to the end of the press."""
    hold: Literal["point", "normal"]
    """`point`: the fingertip stays at the pressing point. `normal`: link 2 stays normal to the
    key."""
    run_up_acceleration: RunUpAcceleration | None = None
    """m/s^2, maximum acceleration of the jack before the cruise. Without it and `run_up_jerk`, the
    jack reaches its speed with the least jerk 2 ms before the first plectrum touches its string,
    but within no less than half of the rise until then."""
    run_up_jerk: RunUpJerk | None = None
    """m/s^3, maximum jerk of the jack before the cruise; given with `run_up_acceleration` only."""
    run_down_acceleration: Annotated[float, Unit("m/s**2", "1.5 m/s^2")] = Field(ge=1e-3, le=1e4)
    """m/s^2, maximum acceleration of the jack after the cruise. If it exceeds the acceleration by
    the key's own weight, the key leaves the finger."""
    run_down_jerk: Annotated[float, Unit("m/s**3", "200 m/s^3")] = Field(ge=0.1, le=1e8)
    """m/s^3, maximum jerk of the jack after the cruise and during the return."""
    return_acceleration: Annotated[float, Unit("m/s**2", "0.6 m/s^2")] = Field(ge=1e-3, le=1e4)
    """m/s^2, maximum acceleration of the jack during the return. It must be smaller than on the way
    down, because friction slows the return of the key."""
    bottom_hold: Time = Field(ge=0, le=60)
    """s, time at rest at the end of the press."""
    return_speed: Annotated[float, Unit("m/s", "0.05 m/s")] = Field(ge=1e-4, le=1.0)
    """m/s, maximum speed of the jack during the return."""
    settle: Time = Field(ge=0, le=10)
    """s, time at rest with the finger on the key before the run-up."""
    approach_speed: Annotated[float, Unit("m/s", "0.05 m/s")] = Field(ge=1e-4, le=1.0)
    """m/s, maximum speed of the fingertip between hover and key."""
    gesture: Gesture | None = None
    """Replayed in place of the constant speed. It can be read from a file with the columns
    `time [s]` and `rise [mm]`: ``gesture = { file = "gesture.csv" }``."""
    speed_tolerance: float = Field(strict=True, gt=0, le=0.1)
    """Dimensionless, maximum relative error of the jack speed: in the cruise by rounding, and RMS
    while a string is held."""
    hover: Length = Field(gt=0)
    """m, height of the fingertip above the key before and after the presses."""

    @model_validator(mode="after")
    def _run_up_is_complete(self):
        if (self.run_up_acceleration is None) != (self.run_up_jerk is None):
            raise ValueError(
                "run_up_acceleration, run_up_jerk: one is given without the other; give both, or"
                " neither to have them chosen by the jack's clearance"
            )
        return self

    @property
    def run_up(self) -> tuple[float, float]:
        """Maximum acceleration [m/s^2] and jerk [m/s^3] of the jack before the cruise."""
        if self.run_up_acceleration is not None and self.run_up_jerk is not None:
            return self.run_up_acceleration, self.run_up_jerk
        # Of all ramps of a duration T, two phases of constant jerk, 4 v / T^2, have the least; the
        # ramp takes a rise of v T / 2.
        rise = max(self._clearance - STEADY * self.jack_speed, self._clearance / 2)
        duration = 2 * rise / self.jack_speed
        return 2 * self.jack_speed / duration, 4 * self.jack_speed / duration**2


class Arm(Section):
    """The two-link planar robot finger. The angle of joint 1 is measured from the x axis, that of
    joint 2 from link 1."""

    upper_length: Length = Field(gt=0)
    """m, length of link 1, from base to elbow."""
    lower_length: Length = Field(gt=0)
    """m, length of link 2, from elbow to the centre of the fingertip."""
    upper_mass: Mass = Field(gt=0)
    """kg, mass of link 1, a slender rod."""
    lower_mass: Mass = Field(gt=0)
    """kg, mass of link 2, a slender rod."""
    fingertip_radius: Length = Field(gt=0)
    """m, radius of the sphere that touches the key."""
    fixture_mass: Mass = Field(default=0.0, ge=0, le=0.5)
    """kg, mass of what is fixed to the front of the force transducer, a part of `lower_mass`. Its
    inertia, as the key accelerates it, is subtracted from the recorded force."""
    fingertip_friction: float = Field(default=0.0, ge=-1, le=1)
    """Dimensionless, force of the fingertip along the key divided by its force on the key, while
    the key goes down. A positive value points towards the front edge and helps to press. The sign
    is reversed during the return."""
    base_x: Length
    """m, x of joint 1."""
    base_z: Length
    """m, z of joint 1."""
    elbow: Literal["up", "down"]
    """Side of the line from base to fingertip on which the elbow lies: `up` is the left side."""
    counts_per_revolution: int = Field(strict=True, ge=16, le=2**31)
    """Encoder counts per revolution of each joint."""
    home_angles: tuple[Angle, Angle]
    """rad, angles of the two joints at their home switches."""
    lower_limits: tuple[Angle, Angle]
    """rad, minimum angles of the two joints."""
    upper_limits: tuple[Angle, Angle]
    """rad, maximum angles of the two joints."""
    speed_limit: Annotated[float, Unit("rad/s", "6 rad/s")] = Field(gt=0)
    """rad/s, maximum angular speed of each joint."""
    acceleration_limit: Annotated[float, Unit("rad/s**2", "200 rad/s^2")] = Field(gt=0)
    """rad/s^2, maximum angular acceleration of each joint, also of a decelerated stop."""
    jerk_limit: Annotated[float, Unit("rad/s**3", "1e5 rad/s^3")] = Field(gt=0)
    """rad/s^3, maximum angular jerk of each joint."""
    rotor_inertias: tuple[RotorInertia, RotorInertia] = (0.0, 0.0)
    """kg m^2, moments of inertia of the two motors' rotors about their own axes."""
    gear_ratios: tuple[GearRatio, GearRatio] = (1.0, 1.0)
    """Dimensionless, revolutions of each motor per revolution of its joint."""
    tilt_limit: Angle = Field(default=math.radians(5), gt=0, le=math.pi)
    """rad, maximum tilt of the finger (link 2) against the key's normal during the press. The
    transducer measures the force along the finger: at 5 deg that is 0.4 % less than the force on
    the key, and 9 % of it acts across the transducer."""
    position_tolerance: Angle = Field(default=25e-6 * 2 * math.pi, gt=0, le=math.radians(1))
    """rad, maximum angle between each joint and the place where its motion starts or has ended, and
    at least 2 encoder counts. Beyond it the motors are switched off: soft position loops need
    more, but whatever remains is an error of the height at which the finger meets the key."""
    servo_stiffness: tuple[Stiffness, Stiffness] | None = None
    """N m/rad, torque of the two position loops per angle by which their joints are off. `plan`
    predicts from it how the jack slows down under the string's force; without it that is
    unknown."""
    servo_damping: tuple[Damping, Damping] | None = None
    """N m s/rad, torque of the two position loops per rate of that angle. Without it, `plan`
    assumes 0.7 of the critical damping."""
    mount_x: tuple[Length, Length]
    """m, minimum and maximum base_x at which the robot can be clamped."""
    mount_z: tuple[Length, Length]
    """m, minimum and maximum base_z at which the robot can be clamped."""
    torque_limit: Moment = Field(gt=0)
    """N m, maximum torque of each joint."""
    approach_speed: Annotated[float, Unit("rad/s", "0.5 rad/s")] = Field(gt=0)
    """rad/s, maximum angular speed of each joint between home, hover and key."""

    @property
    def radians_per_count(self) -> float:
        """Angle of a joint per encoder count, rad."""
        return 2 * math.pi / self.counts_per_revolution

    @property
    def resolution(self) -> float:
        """Distance that the fingertip moves, at most, when joint 1 turns by a count, m."""
        return self.radians_per_count * (self.upper_length + self.lower_length)

    @model_validator(mode="after")
    def _limits_in_order(self):
        for joint, (low, high) in enumerate(zip(self.lower_limits, self.upper_limits, strict=True)):
            if not low < high:
                raise ValueError(
                    f"lower_limits and upper_limits of joint {joint + 1}: the lower limit of"
                    f" {math.degrees(low):.6g} deg is not below the upper limit of"
                    f" {math.degrees(high):.6g} deg; lower the first or raise the second"
                )
        for name, (low, high) in (("mount_x", self.mount_x), ("mount_z", self.mount_z)):
            if not low < high:
                raise ValueError(
                    f"{name}: the range from {low * 1e3:.4g} to {high * 1e3:.4g} mm is empty;"
                    " give the smallest value first"
                )
        return self


class Controller(Section):
    """The motor controller."""

    kind: Annotated[str, NameIn(CONTROLLERS, imported=False)] = "galil"
    """`galil` (DMC-4x), `odrive` (3.x with firmware 0.5.6), or a kind of another package."""
    port: str = Field(min_length=1)
    """Serial device; or `tcp://host:port` of a controller on Ethernet (the port of a Galil is 23);
    or pyserial's `socket://` or `rfc2217://` for a serial port behind a network."""
    baud_rate: int = Field(strict=True, gt=0)
    """Bits per second of a serial port."""
    timeout: Time = Field(gt=0)
    """s, maximum time to wait for an answer of the controller."""
    sample_period: Time = Field(gt=0)
    """s, duration of one controller sample. With TM 1000 it is 976 us, not 1 ms."""
    segment_limit: int = Field(strict=True, ge=8)
    """Number of PVT segments that the controller's FIFO holds for each axis."""
    position_error_limit: int = Field(strict=True, gt=0)
    """Following error, in counts, at which the controller switches the motors off."""
    full_torque: Voltage = Field(default=9.998, gt=0, le=9.998)
    """V, command to the amplifier that corresponds to `arm.torque_limit`."""
    watchdog_period: Time = Field(default=0.5, ge=0.1, le=5)
    """s, time without a command from the host after which the controller switches the motors
    off."""
    encoder_loss_torque: Fraction = 0.6
    """Dimensionless, fraction of the torque limit. If an encoder does not move at a larger torque,
    it counts as lost, and its motor is switched off. The fraction must be larger than the weight of
    the arm needs."""
    encoder_loss_time: Time = Field(default=0.1, ge=0.01, le=5)
    """s, time for which an encoder may be at rest at that torque."""

    trigger_output: int = Field(strict=True, ge=1, le=16)
    """Digital output wired to the acquisition's trigger input."""
    trigger_delay: Time = Field(default=0.49e-3, ge=-0.05, le=0.05)
    """s, time from the output's edge at the acquisition to the start of the motion. The output is
    set when its command runs, the motion starts at the next sample, and the output's circuit delays
    the edge."""
    trigger_delay_std: Time = Field(default=0.28e-3, ge=0, le=0.05)
    """s, standard uncertainty of `trigger_delay`."""

    limit_switches: Literal["active_low", "active_high", "none"] = "active_low"
    """State of the input at which a joint stops: grounded (`active_low`), or open (`active_high`,
    with normally closed switches, so that a broken wire also stops the arm). `none` if there are no
    limit switches."""
    home_grounded: Literal["below", "above"] = "below"
    """Side of home on which the home switch grounds its input: `below` is towards smaller
    angles."""
    home_approach: Literal["forward", "backward"] = "forward"
    """Direction of the final search for home: `forward` is towards larger angles."""
    home_index: bool = Field(default=False, strict=True)
    """Whether home is the next index of the encoder beyond the switch, in the direction
    of `home_approach`."""
    home_travel: Angle = Field(default=3.2, gt=0)
    """rad, maximum travel of a joint in the search for home. The controller stops it there."""
    home_torque: Fraction = 0.5
    """Dimensionless, maximum torque during homing, as a fraction of the torque limit."""
    home_tolerance: int = Field(default=100, strict=True, gt=0)
    """Maximum difference, in counts, between two searches for the same home switch."""

    verified: str = ""
    """Model, firmware and serial number of the controller that `sautereau setup verify` has
    verified. Written by that command."""
    verified_settings: str = ""
    """Settings in the memory of the controller at the verification."""
    verified_on: str = ""
    """Date of the verification."""
    verified_results: tuple[str, ...] = ()
    """Results of the steps of the verification, and what they could not measure."""


class Rig(Section):
    """The complete bench. Load one with `sautereau.rig.load.load_rig`."""

    name: str = Field(min_length=1)
    """Name of the bench, shown in titles."""
    key: Key
    jack: Jack
    plectrum: Plectrum
    string: String
    more_choirs: tuple[Choir, ...] = ()
    """`jack`, `plectrum` and `string` describe the first choir."""
    press: Press
    arm: Arm
    controller: Controller
    daq: Daq
    assumed: dict[str, tuple[float, float]] = Field(default_factory=dict, repr=False, exclude=True)
    """Plausible range (SI) of every value without a source, by its dotted key."""
    sources: dict[str, str] = Field(default_factory=dict, repr=False, exclude=True)
    """Source of a value, by its dotted key."""
    daq_only: bool = Field(default=False, repr=False, exclude=True)
    """Whether the rig file had `[daq]` alone, so that every other value is the packaged rig's."""

    @model_validator(mode="after")
    def _first_contact(self):
        jacks = [self.jack, *(choir.jack for choir in self.more_choirs or ())]
        self.press._clearance = min(jack.string_clearance for jack in jacks)
        return self

    @model_validator(mode="after")
    def _measures_its_strings(self):
        strings = [self.string, *(choir.string for choir in self.more_choirs or ())]
        faults = [
            f"daq.channels: {own.name}: string {own.string} and place"
            f" {(own.place or 0) * 1e3:.6g} mm are not of the rig's {len(strings)} strings; correct"
            " them"
            for own in self.daq.channels * (not self.daq_only)
            if own.string > len(strings) or (own.place or 0) >= strings[own.string - 1].length
        ]
        if faults:
            raise ValueError("\n".join(faults))
        return self

    @model_validator(mode="after")
    def _rests_on_its_back_rail(self):
        key, jack = self.key, self.jack
        further = sum(choir.jack.mass * choir.jack_arm for choir in self.more_choirs or ())
        back = GRAVITY * (jack.mass * key.jack_arm + further)
        if key.gravity_moment >= back:
            raise ValueError(
                f"key.gravity_moment: {key.gravity_moment * 1e3:.6g} mN m is not less than the"
                f" jacks' {back * 1e3:.6g} mN m, so the key would not rest on its back rail;"
                " lower gravity_moment or raise jack.mass"
            )
        return self
