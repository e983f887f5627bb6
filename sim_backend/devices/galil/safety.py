"""The axes, and what the controller checks of them in every sample."""

from collections.abc import Sequence

from sautereau.sim_backend.devices.emulators import OnOutput, Plant
from sautereau.sim_backend.devices.galil.axis import LIMIT_CODES, Axis
from sautereau.sim_backend.devices.galil.memory import OUTPUTS, Config
from sautereau.sim_backend.devices.galil.motion import Pvt, StopCode
from sautereau.sim_backend.devices.galil.tasks import Tasks
from sautereau.sim_backend.parts import ControllerUnit

INPUTS = 8  # Digital inputs, numbered from 1
ON_ERROR, ON_LIMIT = 1, 2  # Bits of OE


class CheckedAxes:
    """The axes with their switches, amplifiers and outputs, as `check` needs them.

    Args:
        plant: The motors, encoders and switches.
        unit: The controller as bought and configured.
        on_output: Called with number and level when a digital output changes.
    """

    axes: list[Axis]
    config: Config
    tasks: Tasks

    def __init__(self, plant: Plant, unit: ControllerUnit, on_output: OnOutput) -> None:
        self.plant, self.unit = plant, unit
        self.inputs = [True] * INPUTS
        """Levels of the digital inputs, which are pulled up."""
        self.outputs = Outputs(on_output)
        self._aborted = False

    def position(self, axis: int) -> int:
        """Return the counts that TP reports."""
        return self.plant.encoder_counts()[axis] + self.axes[axis].offset

    def commanded(self, axis: int) -> int:
        """Return the counts that RP reports, which a motor that is off keeps."""
        return self.axes[axis].reported

    def error(self, axis: int) -> int:
        """Return the following error that TE reports [counts]."""
        return self.commanded(axis) - self.position(axis)

    def exceeds_error_limit(self, axis: int) -> bool:
        """Return whether the error exceeds ER."""
        return 0 <= self.axes[axis].settings["ER"] < abs(self.error(axis))

    def home_state(self, axis: int) -> bool:
        """Return what _HM reports."""
        return self.plant.active("home", axis) == (self.config["CN"][1] > 0)

    def limit_allows(self, axis: int, switch: str) -> bool:
        """Return what _LF or _LR reports: 1 where motion is allowed."""
        return self.plant.active(switch, axis) == (self.config["CN"][0] > 0)

    @property
    def abort_active(self) -> bool:
        """Whether the abort input is active."""
        return self.plant.active("abort", 0)

    def check(self, counts: Sequence[int]) -> set[str]:
        """Do the checks of one sample, given the raw encoder counts.

        Returns:
            Labels of the automatic subroutines whose conditions hold.
        """
        active: set[str] = set()
        self._check_abort()
        broken = any(self.plant.amplifier_fault(index) for index in range(len(counts)))
        if broken:
            active.add("#AMPERR")
        for index, axis in enumerate(self.axes):
            if broken and axis.settings["OE"] and axis.motor_on:
                self.switch_off(axis, StopCode.AMPLIFIER_FAULT)
            # Inputs from the fifth on abort single axes, if CN says so.
            if self.config["CN"][3] and not self.inputs[4 + index]:
                axis.halt(StopCode.SELECTIVE_ABORT)
                if int(axis.settings["OE"]) & ON_ERROR and axis.motor_on:
                    self.switch_off(axis, StopCode.SELECTIVE_ABORT)
                    self.tasks.raise_once("#POSERR")
            self._check_encoder(index, axis, counts[index])
            if axis.encoder_failed:
                active.add("#POSERR")
            exempt = isinstance(axis.profile, Pvt) and not self.unit.pvt_error_limit
            if self.exceeds_error_limit(index) and not exempt:
                active.add("#POSERR")
                if int(axis.settings["OE"]) & ON_ERROR and axis.motor_on:
                    self.switch_off(axis, StopCode.OFF_ON_ERROR)
            self._check_limits(index, axis)
        return active

    def abort_axes(self, code: StopCode) -> None:
        """Stop all axes at once; where OE says so the motor is switched off as well."""
        for axis in self.axes:
            axis.halt(code)
            if int(axis.settings["OE"]) & ON_ERROR:
                self.switch_off(axis, code)

    def switch_off(self, axis: Axis, code: StopCode) -> None:
        """Switch an axis off at once, with its brake, and store the reason."""
        if axis.profile is not None or code == StopCode.OFF_ON_ERROR:
            axis.stop_code = code
        axis.halt(code)
        axis.switch_off(brake_first=False)
        self.outputs.update()

    def _check_abort(self) -> None:
        was, self._aborted = self._aborted, self.abort_active
        if not self._aborted:
            return
        self.abort_axes(StopCode.ABORT_INPUT)
        if not was and self.config["CN"][4] == 0:
            self.tasks.halt()

    def _check_encoder(self, index: int, axis: Axis, raw: int) -> None:
        settings = axis.settings
        watched = settings["OA"] and axis.motor_on
        if not watched or abs(self.plant.torque_volts()[index]) <= settings["OV"]:
            axis.weak_samples = 0
            return
        # An encoder that counts less has failed, while the torque exceeds OV for OT.
        if axis.weak_samples == 0 or abs(raw - axis.weak_from) >= 4:
            axis.weak_from, axis.weak_samples = raw, 0
        axis.weak_samples += 1
        if axis.weak_samples > settings["OT"]:
            axis.encoder_failed = True
            self.switch_off(axis, StopCode.ENCODER_FAILURE)

    def _check_limits(self, index: int, axis: Axis) -> None:
        if axis.profile is None or axis.stop_code in LIMIT_CODES or axis.velocity == 0:
            return
        settings = axis.settings
        forward = axis.velocity > 0
        code = LIMIT_CODES[0] if forward else LIMIT_CODES[1]
        if self._hard_limit(index, axis, forward=forward):
            axis.stop(code, "SD")
            if int(settings["OE"]) & ON_LIMIT:
                self.switch_off(axis, code)
            self.tasks.raise_once("#LIMSWI")
            return
        if isinstance(axis.profile, Pvt) and not self.unit.pvt_soft_limits:
            return
        place = axis.position + axis.offset
        if place > settings["FL"] if forward else place < settings["BL"]:
            axis.stop(code)
            self.tasks.raise_once("#LIMSWI")

    def _hard_limit(self, index: int, axis: Axis, *, forward: bool) -> bool:
        disabled = int(axis.settings["LD"]) & (1 if forward else 2)
        return not disabled and not self.limit_allows(index, "forward" if forward else "reverse")

    def blocks(self, index: int, distance: float) -> bool:
        """Return whether a limit forbids an axis to move in the direction of a distance."""
        axis = self.axes[index]
        if distance == 0:
            return False
        forward = distance > 0
        place, settings = axis.reported, axis.settings
        beyond = place > settings["FL"] if forward else place < settings["BL"]
        return beyond or self._hard_limit(index, axis, forward=forward)


class Outputs:
    """The outputs, numbered from 1, and what they show.

    Args:
        on_output: Called with number and level when an output changes.
    """

    def __init__(self, on_output: OnOutput) -> None:
        self.bits = [False] * OUTPUTS
        """Levels as set, without the brakes'."""
        self._levels = [False] * OUTPUTS
        self._axes: Sequence[Axis] = ()
        self._on_output = on_output

    @property
    def value(self) -> int:
        """What OP reports."""
        return sum(level << bit for bit, level in enumerate(self.bits))

    def reset(self, bits: Sequence[bool], axes: Sequence[Axis]) -> None:
        """Start with burned levels, and with the axes whose BW makes an output a brake."""
        self.bits, self._axes = list(bits), axes
        self.update()

    def is_brake(self, number: int) -> bool:
        """Return whether an output is an axis's brake."""
        return number <= len(self._axes) and self._axes[number - 1].settings["BW"] > 0

    def level(self, number: int) -> bool:
        """Return what @OUT reports, which a brake does not change."""
        return not self.is_brake(number) and self.bits[number - 1]

    def set(self, number: int, level: bool) -> None:
        """Set an output; this changes no brake."""
        if not self.is_brake(number):
            self.bits[number - 1] = level
        self.update()

    def update(self) -> None:
        """Report the outputs that have changed; a brake is on while its motor is off."""
        for number in range(1, OUTPUTS + 1):
            level = self.bits[number - 1]
            if self.is_brake(number):
                level = not self._axes[number - 1].motor_on
            if self._levels[number - 1] != level:
                self._levels[number - 1] = level
                self._on_output(number, level)
