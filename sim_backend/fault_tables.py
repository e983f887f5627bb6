"""The table `[faults]` of a scene: one table inside it for each fault; absent ones cost nothing.

A press is counted by its trigger edge: press 2 starts with the second edge for which an
acquisition has waited, whether or not the card received it. All random numbers come from the
stand-in's seed.
"""

from itertools import combinations
from types import SimpleNamespace
from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from sautereau.rig.faults import Condition, lacking, without_effect
from sautereau.rig.schema import Rig
from sautereau.rig.units import Force, Frequency, Section, Time, Unit

SERVO = (Condition("scene.finger", ("servo",)),)  # Else there are no motors and encoders
WIRED = (
    Condition("scene.controller.limit_switches", (True,)),
    Condition("scene.faults.switch_closed.switch", ("forward", "reverse")),
    Condition("scene.faults.switch_polarity.switch", ("limit",)),
)
"""Without any of them no current flows in the inputs of the limit switches."""
CAN_OCCUR_IF = {
    "stall": SERVO,
    "slip": SERVO,
    "encoder_loss": SERVO,
    "encoder_sign": SERVO,
    "encoders_swapped": SERVO,
    "index_missing": (Condition("rig.controller.home_index", (True,)),),
    'switches_swapped = "limit"': WIRED[:2],  # both inputs have the same polarity
    'switch_cut = "forward"': WIRED,
    'switch_cut = "reverse"': WIRED,
}
"""Parts of scene and rig with which faults, of those switches, can occur."""

Fraction = Annotated[float, Field(ge=0, le=1)]


class _Sized(Section):
    acts_if: ClassVar[tuple[Condition, ...]]
    """Values of which one is needed for an effect."""

    @model_validator(mode="after")
    def _acts(self):
        if why := lacking(self.acts_if, self):
            raise ValueError(why)
        return self


class _InPress(Section):
    press: int = Field(default=1, ge=1)
    """Press in which it occurs, from 1."""


class _AtSample(_InPress):
    sample: int = Field(ge=0)
    """First sample that cannot be read, counted from 0."""


class _AtTime(_InPress):
    at: Time = Field(default=0.0, ge=0, le=60)
    """s after the trigger edge; it occurs with the next controller sample."""


class _OnJoint(Section):
    joint: Literal[1, 2]
    """Joint of the arm."""


class _AtSwitch(Section):
    switch: Literal["forward", "reverse", "home", "abort"]
    """Limit switches, home switch, or the abort input, which both joints share."""
    joint: Literal[1, 2] = 1
    """Joint of the arm."""


class _Since(Section):
    press: int = Field(default=0, ge=0)
    """Press in which it occurs, from 1; 0 for power-up."""
    at: Time = Field(default=0.0, ge=0, le=60)
    """s after the press's trigger edge."""


class _JointAtTime(_AtTime, _OnJoint):
    pass


class _JointSince(_Since, _OnJoint):
    pass


class LineFault(_Sized):
    """A bad serial line: bytes are lost or changed, answers are late."""

    acts_if = tuple(Condition(name, but=(0,)) for name in ("dropped", "flipped", "delay"))

    dropped: Fraction = 0.0
    """Probability that a byte is lost."""
    flipped: Fraction = 0.0
    """Probability that a byte arrives with one random bit inverted."""
    towards: Literal["both", "controller", "host"] = "both"
    """Direction of the bytes that are lost or changed."""
    delay: Time = Field(default=0.0, ge=0, le=60)
    """s of real time, by which every answer is late."""
    press: int = Field(default=0, ge=0)
    """Press at whose trigger edge the fault starts; 0 for the first byte."""


class CableOut(Section):
    """The controller's cable is disconnected: it no longer receives or sends."""

    after_bytes: int | None = Field(default=None, ge=0)
    """Bytes that the controller still receives; instead of a press."""
    press: int | None = Field(default=None, ge=1)
    """Press in which it is disconnected, from 1; instead of a number of bytes."""
    at: Time = Field(default=0.0, ge=0, le=60)
    """s after the press's trigger edge."""
    port_closes: bool = False
    """Whether the port disappears as well, as that of a USB adapter; else it is silent."""

    @model_validator(mode="after")
    def _occurs_once(self):
        if (self.after_bytes is None) == (self.press is None):
            given = "neither is" if self.press is None else "both are"
            raise ValueError(f"after_bytes, press: {given} given; give one of them")
        return self


class Speckle(_Sized):
    """Drop-outs of the vibrometer, which loses its light."""

    acts_if = Condition("level", but=(1,)), Condition("spike", but=(0,))

    rate: Frequency = Field(gt=0, le=1e5)
    """Hz, mean rate of the drop-outs, which come at random times."""
    duration: Time = Field(gt=0, le=1)
    """s, of each."""
    level: Fraction = 0.0
    """Fraction of the velocity that remains in a drop-out."""
    spike: Annotated[float, Unit("m/s", "20 mm/s")] = Field(default=0.0, ge=0)
    """m/s, largest false velocity that is added; it differs from drop-out to drop-out."""


class Overload(Section):
    """The amplifier of the force transducer overloads."""

    force: Force = Field(gt=0)
    """N, magnitude at which the output is limited."""
    recovery: Time = Field(ge=0, le=60)
    """s, for which the output stays at the limit after the force has fallen."""


class Drift(_Sized):
    """The force transducer drifts from the trigger on."""

    acts_if = (Condition("rate", but=(0,)),)

    rate: Annotated[float, Unit("N/s", "20 mN/s")]
    """N/s, of the force that is added."""


class SensorSign(Section):
    """A sensor with the opposite sign."""

    quantity: Literal["force", "velocity"]
    """Measured by the sensor."""


class Slip(_JointAtTime, _Sized):
    """An encoder slips on its shaft. The loop moves the joint by the same angle in the opposite
    direction, where the home switch is then found."""

    acts_if = (Condition("counts", but=(0,)),)

    counts: int = Field(ge=-1_000_000, le=1_000_000)
    """Offset of its readings from then on."""


class _SwitchSince(_Since, _AtSwitch):
    pass


class SwitchPolarity(Section):
    """Switches of the opposite polarity: current flows where none should."""

    switch: Literal["limit", "home", "abort"]
    """Which ones, of both joints."""


class SwitchesSwapped(Section):
    """The wires of two switches are exchanged."""

    switch: Literal["limit", "home"]
    """The limit switches of each joint, or the home switches of the joints."""


class Faults(Section):
    """Faults to inject. Faults that contradict each other, or that cannot occur on the bench, are
    refused."""

    line: LineFault | None = None
    cable_out: CableOut | None = None
    trigger_missing: _InPress | None = None
    """The trigger's edge does not reach the card."""
    overrun: _AtSample | None = None
    """Samples are overwritten before they are read: a read of that sample, or of a later one, fails
    with error -200279."""
    server_gone: _AtSample | None = None
    """From the read of that sample on, the gRPC server answers every call with UNAVAILABLE."""
    device_gone: _AtSample | None = None
    """The card is disconnected: from the read of that sample on, every call that needs it fails
    with error -201003."""
    speckle: Speckle | None = None
    overload: Overload | None = None
    drift: Drift | None = None
    sensor_sign: SensorSign | None = None
    stall: _JointAtTime | None = None
    """A joint is blocked permanently: the torque of its loop rises to its limit, and ER and OE of
    the controller determine what follows."""
    slip: Slip | None = None
    encoder_loss: _JointSince | None = None
    """The signals of an encoder disappear: its position does not change any more."""
    encoder_sign: _OnJoint | None = None
    """An encoder counts backwards, and its loop runs away."""
    encoders_swapped: Section | None = None
    """The encoders' cables are exchanged."""
    index_missing: _OnJoint | None = None
    """An encoder has no index."""
    switch_closed: _SwitchSince | None = None
    """A switch is closed permanently."""
    switch_polarity: SwitchPolarity | None = None
    switch_cut: _AtSwitch | None = None
    """The wire of a switch is broken: no current flows."""
    switches_swapped: SwitchesSwapped | None = None
    amplifier_fault: _JointSince | None = None
    """The amplifier of a joint reports overcurrent."""

    @model_validator(mode="after")
    def _can_all_occur(self):
        faults = []
        names = ("trigger_missing", "overrun", "server_gone", "device_gone")
        of_card = {name: fault for name in names if (fault := getattr(self, name)) is not None}
        for (name, fault), (other, later) in combinations(
            sorted(of_card.items(), key=lambda item: item[1].press), 2
        ):
            if fault.press == later.press:
                faults.append(
                    f"{other}: press {later.press} has {name} already, and only one fault of the"
                    " card can end a press; give another press, or remove one of them"
                )
            elif name in ("server_gone", "device_gone"):
                faults.append(
                    f"{other}: the card is gone after {name} in press {fault.press}, so it cannot"
                    f" occur in press {later.press}; give an earlier press, or remove one of them"
                )
        if not any(getattr(self, name) is not None for name in type(self).model_fields):
            faults.append("faults: the table is empty; add a fault, or remove the table")
        if faults:
            raise ValueError("\n".join(faults))
        return self

    @property
    def _given(self) -> dict[str, object]:
        """The faults by name, each with its switch, if it is one of a switch."""
        names = (name for name in type(self).model_fields if getattr(self, name) is not None)
        return {name: getattr(getattr(self, name), "switch", None) for name in names}

    def conflicts(self, scene: Section, rig: Rig) -> list[str]:
        """Return the faults that cannot occur on a bench, each with how to fix it."""
        bench = SimpleNamespace(scene=scene, rig=rig)
        idle = without_effect(self._given, CAN_OCCUR_IF, bench)
        faults = [f"faults.{name}: {why}" for name, why in idle]
        quantities = {channel.quantity for channel in rig.daq.channels}
        needed = {"speckle": "velocity", "overload": "force", "drift": "force"}
        if self.sensor_sign is not None:
            needed["sensor_sign"] = self.sensor_sign.quantity
        for name, quantity in needed.items():
            if getattr(self, name) is not None and quantity not in quantities:
                faults.append(
                    f"faults.{name}: the rig has no channel that measures {quantity}; add one to"
                    " its daq.channels, or remove the table"
                )
        return faults
