"""What the controller checks in every sample: errors, switches, encoders, amplifiers."""

from collections.abc import Sequence
from typing import Protocol

from sautereau.sim_backend.controller_part import ControllerUnit
from sautereau.sim_backend.devices.emulators import Plant
from sautereau.sim_backend.devices.galil.axis import LIMIT_CODES, Axis
from sautereau.sim_backend.devices.galil.memory import Config
from sautereau.sim_backend.devices.galil.motion import Pvt, StopCode
from sautereau.sim_backend.devices.galil.outputs import Outputs
from sautereau.sim_backend.devices.galil.tasks import Tasks

FEW_COUNTS = 4
"""Counts of motion below which an encoder has failed, while the torque exceeds OV for OT."""

ABORT_INPUTS = 4
"""Inputs before those that abort single axes, if CN says so."""

ON_ERROR, ON_LIMIT = 1, 2
"""Bits of OE."""


class Checked(Protocol):
    """The machine whose axes are checked."""

    axes: list[Axis]
    plant: Plant
    unit: ControllerUnit
    config: Config
    tasks: Tasks
    inputs: list[bool]
    outputs: Outputs

    @property
    def abort_active(self) -> bool:
        """Whether the abort input is active."""
        ...

    def limit_allows(self, axis: int, switch: str) -> bool:
        """Return whether a limit switch, forward or reverse, allows motion."""
        ...

    def exceeds_error_limit(self, axis: int) -> bool:
        """Return whether the following error exceeds ER."""
        ...


class Safety:
    """The checks and their state.

    Args:
        machine: Whose axes are checked.
    """

    def __init__(self, machine: Checked) -> None:
        self._machine = machine
        self._aborted = False

    def check(self, counts: Sequence[int]) -> set[str]:
        """Do the checks of one sample, given the raw encoder counts.

        Returns:
            Labels of the automatic subroutines whose conditions hold.
        """
        machine = self._machine
        active: set[str] = set()
        self._check_abort()
        broken = any(machine.plant.amplifier_fault(index) for index in range(len(counts)))
        if broken:
            active.add("#AMPERR")
        for index, axis in enumerate(machine.axes):
            if broken and axis.settings["OE"] and axis.motor_on:
                self.switch_off(axis, StopCode.AMPLIFIER_FAULT)
            if machine.config["CN"][3] and not machine.inputs[ABORT_INPUTS + index]:
                axis.halt(StopCode.SELECTIVE_ABORT)
                if int(axis.settings["OE"]) & ON_ERROR and axis.motor_on:
                    self.switch_off(axis, StopCode.SELECTIVE_ABORT)
                    machine.tasks.raise_once("#POSERR")
            self._check_encoder(index, axis, counts[index])
            if axis.encoder_failed:
                active.add("#POSERR")
            exempt = isinstance(axis.profile, Pvt) and not machine.unit.pvt_error_limit
            if machine.exceeds_error_limit(index) and not exempt:
                active.add("#POSERR")
                if int(axis.settings["OE"]) & ON_ERROR and axis.motor_on:
                    self.switch_off(axis, StopCode.OFF_ON_ERROR)
            self._check_limits(index, axis)
        return active

    def abort(self, code: StopCode) -> None:
        """Stop all axes at once; where OE says so the motor is switched off as well."""
        for axis in self._machine.axes:
            axis.halt(code)
            if int(axis.settings["OE"]) & ON_ERROR:
                self.switch_off(axis, code)

    def switch_off(self, axis: Axis, code: StopCode) -> None:
        """Switch an axis off at once, with its brake, and store the reason."""
        if axis.profile is not None or code == StopCode.OFF_ON_ERROR:
            axis.stop_code = code
        axis.halt(code)
        axis.switch_off(brake_first=False)
        self._machine.outputs.update()

    def _check_abort(self) -> None:
        machine, was = self._machine, self._aborted
        self._aborted = machine.abort_active
        if not self._aborted:
            return
        self.abort(StopCode.ABORT_INPUT)
        if not was and machine.config["CN"][4] == 0:
            machine.tasks.halt()

    def _check_encoder(self, index: int, axis: Axis, raw: int) -> None:
        settings = axis.settings
        watched = settings["OA"] and axis.motor_on
        if not watched or abs(self._machine.plant.torque_volts()[index]) <= settings["OV"]:
            axis.weak_samples = 0
            return
        if axis.weak_samples == 0 or abs(raw - axis.weak_from) >= FEW_COUNTS:
            axis.weak_from, axis.weak_samples = raw, 0
        axis.weak_samples += 1
        if axis.weak_samples > settings["OT"]:
            axis.encoder_failed = True
            self.switch_off(axis, StopCode.ENCODER_FAILURE)

    def _check_limits(self, index: int, axis: Axis) -> None:
        if axis.profile is None or axis.stop_code in LIMIT_CODES or axis.velocity == 0:
            return
        machine, settings = self._machine, axis.settings
        forward = axis.velocity > 0
        code = LIMIT_CODES[0] if forward else LIMIT_CODES[1]
        if self._hard_limit(index, axis, forward=forward):
            axis.stop(code, "SD")
            if int(settings["OE"]) & ON_LIMIT:
                self.switch_off(axis, code)
            machine.tasks.raise_once("#LIMSWI")
            return
        if isinstance(axis.profile, Pvt) and not machine.unit.pvt_soft_limits:
            return
        place = axis.position + axis.offset
        if place > settings["FL"] if forward else place < settings["BL"]:
            axis.stop(code)
            machine.tasks.raise_once("#LIMSWI")

    def _hard_limit(self, index: int, axis: Axis, *, forward: bool) -> bool:
        disabled = int(axis.settings["LD"]) & (1 if forward else 2)
        return not disabled and not self._machine.limit_allows(
            index, "forward" if forward else "reverse"
        )

    def blocks(self, index: int, distance: float) -> bool:
        """Return whether a limit forbids an axis to move in the direction of a distance."""
        axis = self._machine.axes[index]
        if distance == 0:
            return False
        forward = distance > 0
        place, settings = axis.reported, axis.settings
        beyond = place > settings["FL"] if forward else place < settings["BL"]
        return beyond or self._hard_limit(index, axis, forward=forward)
