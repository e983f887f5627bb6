"""The instrument's tables of the rig file: key, jack, plectrum, string."""

import math
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import Field, model_validator

from sautereau.rig.units import Force, Frequency, Inertia, Length, Mass, Moment, Section, Unit

LARGEST = 10.0  # m, beyond any instrument: cubes and products of lengths stay finite


class KeyMode(Section):
    """A mode of the resting key, as measured by `sautereau setup tap`."""

    frequency: Frequency = Field(gt=0)
    """Hz, undamped frequency of the mode."""
    frequency_std: Frequency = Field(gt=0)
    """Hz, standard uncertainty of `frequency`."""
    damping: float = Field(gt=0, lt=1)
    """Dimensionless, damping ratio: fraction of critical damping."""
    damping_std: float = Field(gt=0)
    """Dimensionless, standard uncertainty of `damping`."""


class Key(Section):
    """The key lever on its balance pin."""

    press_arm: Length = Field(gt=0)
    """m, distance from the pin to the pressing point."""
    laser_arm: Length = Field(gt=0)
    """m, distance from the pin to the laser spot, which is fixed in space."""
    jack_arm: Length = Field(gt=0, le=LARGEST)
    """m, distance from the pin to the jack."""
    front_arm: Length = Field(gt=0)
    """m, distance from the pin to the front edge."""
    surface_height: Length = Field(ge=0)
    """m, height of the playing surface above the pin."""
    jack_surface_height: Length = Field(ge=0)
    """m, height of the surface under the jack above the pin."""
    inertia: Inertia = Field(gt=0)
    """kg m^2, moment of inertia of the bare key about the pin."""
    gravity_moment: Moment
    """N m, static gravity moment of the bare key about the pin. A positive moment lowers the
    front."""
    pivot_coulomb_friction: Moment = Field(ge=0)
    """N m, dry friction at the pin."""
    pivot_viscous_friction: Annotated[float, Unit("N*m*s/rad", "0.1 mN m s/rad")] = Field(ge=0)
    """N m s/rad, viscous friction at the pin."""
    neighbour_height: Length
    """m, height of the highest surface of the neighbouring keys above the pin."""
    dip: Length = Field(gt=0)
    """m, travel of the pressing point from rest to the front felt."""
    felt_stiffness: Annotated[float, Unit("N/m", "20 kN/m")] = Field(gt=0)
    """N/m, stiffness of the front felt, referred to the pressing point."""
    felt_damping: Annotated[float, Unit("N*s/m", "10 N s/m")] = Field(ge=0)
    """N s/m, damping of the front felt, referred to the pressing point."""
    modes: tuple[KeyMode, ...] = ()
    """`identify` starts its search for the modes of the pressed key from them."""

    @model_validator(mode="after")
    def _arms_on_the_key(self):
        faults = [
            f"{name}: {arm * 1e3:.6g} mm is beyond the key's front edge at"
            f" {self.front_arm * 1e3:.6g} mm; lower {name} or raise front_arm"
            for name, arm in (("press_arm", self.press_arm), ("laser_arm", self.laser_arm))
            if arm > self.front_arm
        ]
        if faults:
            raise ValueError("\n".join(faults))
        return self


class Tongue(Section):
    """The part of the jack that swings back, so that a falling plectrum passes the string.

    The string lifts the plectrum at a distance of length minus overlap from the clamp; the
    tongue rotates about its pivot against its bristle until the tip has moved back by the
    overlap.
    """

    pivot: Length = Field(gt=0)
    """m, depth of the tongue's axle below the plectrum."""
    bristle_moment: Moment = Field(ge=0)
    """N m, moment of the bristle on the tongue at rest."""
    bristle_stiffness: Annotated[float, Unit("N*m/rad", "1 mN m/rad")] = Field(ge=0)
    """N m/rad, rotational stiffness of the bristle."""


class Damper(Section):
    """The felt in the jack's head that damps the string while the jack is down."""

    lift: Length = Field(gt=0)
    """m, rise of the jack at which the felt leaves the string."""
    stiffness: Annotated[float, Unit("N/m", "15 N/m")] = Field(ge=0)
    """N/m, stiffness of the felt on the string. The felt carries part of the jack below `lift`."""
    decay: Annotated[float, Unit("1/s", "40 1/s")] = Field(ge=0)
    """1/s, decay rate of the amplitudes of a string on which the felt rests."""


class Jack(Section):
    """The vertical slider that carries the plectrum."""

    mass: Mass = Field(gt=0)
    """kg, mass of the jack with plectrum and tongue."""
    register_friction: Force = Field(ge=0)
    """N, dry friction in the register."""
    string_clearance: Length = Field(gt=0)
    """m, rise of the jack from rest to contact of plectrum and string."""
    tongue: Tongue | None = None
    """Scenes with `tongue = true` require it."""
    damper: Damper | None = None
    """Scenes with `damper = true` require it."""


class OutlineMember(Section):
    """One of the outlines between which a photograph cannot decide."""

    x: tuple[Length, ...] = Field(min_length=2)
    """m, positions from the clamp at 0 to the tip, increasing."""
    top: tuple[Length, ...] = Field(min_length=2)
    """m, height of the upper surface, which touches the string, at each x."""
    bottom: tuple[Length, ...] = Field(min_length=2)
    """m, height of the lower surface at each x."""

    @model_validator(mode="after")
    def _encloses_something(self):
        faults = []
        if not len(self.x) == len(self.top) == len(self.bottom):
            faults.append(
                f"outline: {len(self.x)} values of x, {len(self.top)} of top and"
                f" {len(self.bottom)} of bottom; give equally many"
            )
        if self.x[0] != 0 or any(b <= a for a, b in pairwise(self.x)):
            faults.append("outline: x must start at 0 mm, the clamp, and increase to the tip")
        crossing = [
            x for x, top, low in zip(self.x, self.top, self.bottom, strict=False) if top <= low
        ]
        if crossing:
            faults.append(
                f"outline: it crosses itself at x = {crossing[0] * 1e3:.4g} mm, where top is not"
                " above bottom; correct the contour there"
            )
        if faults:
            raise ValueError("\n".join(faults))
        return self


class Outline(OutlineMember):
    """Outline of a carved plectrum in the bending plane, undeformed."""

    ensemble: tuple[OutlineMember, ...] = ()
    """Outlines drawn from the uncertainty of a photograph, written by `sautereau outline`;
    `predict` gives the intervals that they cause."""


class Plectrum(Section):
    """The cantilever clamped in the jack."""

    length: Length = Field(gt=0)
    """m, free length from the clamp to the tip."""
    width: Length = Field(gt=0)
    """m, width across the bending plane."""
    thickness: Length = Field(gt=0, le=LARGEST)
    """m, thickness in the bending plane."""
    youngs_modulus: Annotated[float, Unit("Pa", "2.9 GPa")] = Field(gt=0)
    """Pa, Young's modulus."""
    poisson_ratio: float = Field(strict=True, ge=0, lt=0.5)
    """Dimensionless, Poisson's ratio."""
    transverse_modulus: Annotated[float, Unit("Pa", "1.2 GPa")] | None = Field(default=None, gt=0)
    """Pa, Young's modulus across the length in the bending plane, of a material with fibres such as
    a quill; `poisson_ratio` is then that of a load along the length. Default: `youngs_modulus`."""
    shear_modulus: Annotated[float, Unit("Pa", "0.3 GPa")] | None = Field(default=None, gt=0)
    """Pa, shear modulus in the bending plane. Default: that of an isotropic material."""
    ageing: float = Field(default=1.0, gt=0, le=2)
    """Dimensionless, factor by which age has changed all moduli."""
    density: Annotated[float, Unit("kg/m**3", "1247 kg/m^3")] = Field(gt=0)
    """kg/m^3, density."""
    overlap: Length = Field(gt=0)
    """m, distance from the string's centre at rest to the tip, along the undeformed mid-line."""
    contact: Literal["surface", "mid-line"] = "surface"
    """Position of the string: on the upper `surface`, as on an instrument, with its centre half the
    thickness and half the wire's diameter above the mid-line; or on the `mid-line`, as in the
    paper. An overlap identified with one setting is wrong for the other."""
    friction: float = Field(default=0.0, strict=True, ge=0, le=0.5)
    """Dimensionless, coefficient of Coulomb friction between plectrum and string."""
    tip_thickness: Length | None = Field(default=None, gt=0, le=LARGEST)
    """m, thickness of the section at the tip, if it is cut thinner from below. Default:
    `thickness`."""
    tip_length: Length | None = Field(default=None, gt=0)
    """m, length of the section at the tip. Default: half the length."""
    outline: Outline | None = None
    """Shape of a carved plectrum, which also gives `length` and `thickness` where they are omitted;
    without it the section is that of the thicknesses. It can be read from a file:
    ``outline = { file = "contour.csv" }``."""

    @model_validator(mode="after")
    def _overlap_on_the_plectrum(self):
        if self.overlap >= self.length:
            raise ValueError(
                f"overlap: {self.overlap * 1e3:.6g} mm is not less than the plectrum's length of"
                f" {self.length * 1e3:.6g} mm; lower overlap"
            )
        return self

    @model_validator(mode="after")
    def _stable(self):
        across = (self.transverse_modulus or self.youngs_modulus) / self.youngs_modulus
        if not self.poisson_ratio**2 * across < 1:
            raise ValueError(
                f"transverse_modulus: {across:.4g} times youngs_modulus, with a Poisson's ratio of"
                f" {self.poisson_ratio:g}, is no stable material; lower it below"
                f" {self.poisson_ratio**-2:.4g} times"
            )
        return self

    @model_validator(mode="after")
    def _one_shape(self):
        if self.outline is not None and self.tip_thickness is not None:
            raise ValueError(
                "tip_thickness: the outline has the thickness everywhere; remove tip_thickness, or"
                " the outline"
            )
        if self.tip_length is not None and self.tip_thickness is None:
            raise ValueError("tip_length: it has no effect without tip_thickness; give that, too")
        if self.tip_length is not None and self.tip_length >= self.length:
            raise ValueError(
                f"tip_length: {self.tip_length * 1e3:.6g} mm is not less than the plectrum's length"
                f" of {self.length * 1e3:.6g} mm; lower it, or set thickness alone"
            )
        if self.tip_thickness is not None and self.tip_thickness > self.thickness:
            raise ValueError(
                f"tip_thickness: {self.tip_thickness * 1e3:.6g} mm is more than the thickness of"
                f" {self.thickness * 1e3:.6g} mm, and a tip is cut thinner; exchange them, or"
                " describe the shape by an outline"
            )
        return self

    @property
    def described(self) -> tuple[str, ...]:
        """Names of the fields by which it is not uniform or not isotropic."""
        fibres = ("transverse_modulus", "shear_modulus")
        material = tuple(name for name in fibres if getattr(self, name) is not None)
        if self.outline is not None:
            return ("outline", *material)
        stepped = self.tip_thickness not in (None, self.thickness)
        return (*("tip_thickness",) * stepped, *material)

    @property
    def clamp_thickness(self) -> float:
        """m, thickness at the clamp: of the outline, if there is one."""
        outline = self.outline
        return self.thickness if outline is None else outline.top[0] - outline.bottom[0]

    @property
    def ensemble(self) -> tuple["Plectrum", ...]:
        """The plectrum with each outline of its outline's ensemble; none without one."""
        members = self.outline.ensemble if self.outline else ()
        return tuple(self.outlined(Outline.model_construct(**vars(own))) for own in members)

    def outlined(self, outline: Outline) -> "Plectrum":
        """Return the plectrum with another outline, as long and as thick at the clamp as that."""
        length, thickness = outline.x[-1], outline.top[0] - outline.bottom[0]
        sizes = {"length": length, "thickness": thickness, "tip_thickness": None}
        return self.model_copy(update=sizes | {"outline": outline})

    @property
    def modulus(self) -> float:
        """Pa, Young's modulus along the length, with age."""
        return self.ageing * self.youngs_modulus

    @property
    def bending_stiffness(self) -> float:
        """N m^2, EI = E W h^3 / 12."""
        return self.modulus * self.width * self.thickness**3 / 12


class String(Section):
    """The string above the plectrum."""

    tension: Force = Field(gt=0)
    """N, tension of the string."""
    length: Length = Field(gt=0)
    """m, length between nut and bridge."""
    plucking_point: Length = Field(gt=0)
    """m, distance from the nut to the plectrum."""
    frequency: Frequency = Field(gt=0)
    """Hz, fundamental frequency."""
    diameter: Length = Field(default=0.31e-3, gt=0)
    """m, diameter of the wire."""
    inharmonicity: float = Field(default=0.0, strict=True, ge=0, le=0.01)
    """Dimensionless, B of a string that is stiff against bending: f_n = n f sqrt(1 + B n^2). Of a
    plain wire with Young's modulus E it is pi^3 E d^4 / (64 T L^2). Only modal strings have it."""
    name: str = ""
    """Name of its choir, which results show beside its number: `8' back`."""

    @model_validator(mode="after")
    def _plucked_between_its_ends(self):
        if self.plucking_point >= self.length:
            raise ValueError(
                f"plucking_point: {self.plucking_point * 1e3:.6g} mm is not on the string of"
                f" {self.length * 1e3:.6g} mm; lower plucking_point"
            )
        return self

    @property
    def static_stiffness(self) -> float:
        """N/m, at the plucking point: K = T / (L b (1 - b)), the paper's equation 2 corrected."""
        b = self.plucking_point / self.length
        return self.tension / (self.length * b * (1 - b))

    @property
    def nearer_end(self) -> float:
        """m, from the plucking point to the end of the string that is nearer to it."""
        return min(self.plucking_point, self.length - self.plucking_point)

    @property
    def linear_density(self) -> float:
        """kg/m, mu = T / (2 L f)^2."""
        speed = 2 * self.length * self.frequency  # m/s, of waves
        return self.tension / speed / speed

    @property
    def density(self) -> float:
        """kg/m^3, of a plain wire with this diameter and linear density."""
        return self.linear_density / self.diameter * (4 / math.pi) / self.diameter


class Choir(Section):
    """One more string that the key plucks, with its own jack and plectrum."""

    jack_arm: Length = Field(gt=0, le=LARGEST)
    """m, distance from the pin to this jack."""
    jack: Jack
    plectrum: Plectrum
    string: String
