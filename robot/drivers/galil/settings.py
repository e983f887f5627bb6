"""Settings of a Galil controller: those made before its motors are on, and those it stores."""

from sautereau.rig.schema import Controller, Rig
from sautereau.robot.drivers.driver import refuse_changes
from sautereau.robot.drivers.galil.dmc import (
    halting,
    switch_settings,
)
from sautereau.robot.drivers.galil.line import Line
from sautereau.robot.drivers.limits import Limits
from sautereau.robot.errors import CommandRefused, RobotError, SettingNotTaken
from sautereau.trajectory.segments import Counts

VOLTAGE_STEP = 5e-4  # Step in V to which the controller rounds TL, OV and OF
_SAMPLE_PERIODS = (970e-6, 1001e-6)  # s, what firmwares make of TM 1000
_AMPLIFIERS = (7.0, 5.0)  # V, largest TL of internal amplifiers at their largest gain
_MEMORY = ("_MT", "_CE", "_AG", "_KP", "_KI", "_KD")
_FURTHER = ("_FA", "_FV", "_IL")
"""Of the position loops as well, but not in the rig file's record of a verification."""


class ControllerSettings:
    """The settings of one controller."""

    def __init__(self, line: Line, rig: Rig):
        self._line, self._controller, self._limits = line, rig.controller, Limits(rig.arm)
        self.serial_number = 0
        self.memory: dict[str, float] = {}
        """Settings of both axes that the controller has from its own memory: motor and encoder
        type, gains of amplifiers and position loops."""
        self.torque = self._controller.full_torque
        """V, the limit of the torque that the controller has taken."""
        self.trial = 1.0
        """Fraction to which every limit of the torque is lowered."""
        self._due: dict[str, tuple[float, float]] = {}
        """Operands with the value that was set, or found in the controller's memory, and the
        difference that is allowed."""

    def read_memory(self, absent: frozenset[str] = frozenset()) -> None:
        """Read the settings that the controller stores.

        Args:
            absent: Commands that the controller does not know.

        Raises:
            RobotError: The trigger's output is a brake.
        """
        known = [name for name in (*_MEMORY, *_FURTHER) if name[1:] not in absent]
        names = [f"{name}{axis}" for name in known for axis in "AB"]
        found = dict(zip(names, self._line.read_many(names), strict=True))
        self.memory = {name[1:]: found[name] for name in names if name[:3] in _MEMORY}
        self._due = {name: (value, 0.0) for name, value in found.items()}
        number, *brakes = self._line.read("_BN", "_BWA", "_BWB")
        self.serial_number = int(number)
        output = self._controller.trigger_output
        if output <= len(brakes) and brakes[output - 1]:
            raise RobotError(
                f"controller on {self._line.name}: output {output} (controller.trigger_output) is"
                f" the brake of joint {output}: its BW is {brakes[output - 1]:g} samples; wire the"
                " trigger to another output, or burn BW 0,0 if there is no brake"
            )

    def set(self) -> None:
        """Set sample period, following error, torque, switches and limits, and read them back.

        Raises:
            RobotError: The controller would not enforce a limit of the rig, or it does not take
                the settings.
        """
        line, rig, limits = self._line, self._controller, self._limits
        check_rig(rig, limits)
        switches = switch_settings(rig)
        off = 1 if rig.limit_switches == "none" else 3  # 1: error and abort; 2: limit switch
        wait = round(rig.encoder_loss_time / rig.sample_period)
        line.ask("TM 1000")
        line.ask(f"OE {off},{off}", "OF 0,0", "TK 0,0")
        line.ask(f"CN {switches['_CN0']},{switches['_CN1']},,0,1")
        line.ask(f"LD {switches['_LDA']},{switches['_LDB']}", *halting(limits))
        self.limit_torque(1.0)
        line.ask(f"OT {wait},{wait}", "OA 1,1")
        self._confirm({"_TM": 1000, "_OEA": off, "_OEB": off})
        self._confirm({"_OFA": 0, "_OFB": 0, "_TKA": 0, "_TKB": 0}, VOLTAGE_STEP)
        self._confirm(switches)
        self._confirm({"_OTA": wait, "_OTB": wait, "_OAA": 1, "_OAB": 1})
        self.limit_error(rig.position_error_limit)
        self.limit_travel(limits.lower, limits.upper)

    def limit_error(self, counts: int) -> None:
        """Set the following error at which a motor is switched off, and read it back."""
        self._line.ask(f"ER {counts},{counts}")
        self._confirm({"_ERA": counts, "_ERB": counts})

    def limit_torque(self, fraction: float) -> None:
        """Limit the torque to a fraction of the arm's; the amplifiers may allow less.

        The torque at which a standing encoder counts as lost changes with it.
        """
        line, rig = self._line, self._controller
        volts = rig.full_torque * fraction * self.trial
        line.ask("OV 0,0")
        for allowed in (volts, *(most for most in _AMPLIFIERS if most < volts)):
            try:
                line.ask(f"TL {allowed:.4f},{allowed:.4f}")
                break
            except CommandRefused as error:
                if error.code != 6:  # Out of range
                    raise
        taken = line.read("_TLA", "_TLB")
        if not 0 < min(taken) <= max(taken) <= volts + VOLTAGE_STEP:
            raise SettingNotTaken(
                f"controller on {line.name}: its commands were limited to {volts:.4g} V"
                f" (TL) and reads back {taken[0]:g} and {taken[1]:g} V; check its amplifiers"
            )
        self._due |= {"_TLA": (taken[0], 0.0), "_TLB": (taken[1], 0.0)}
        self.torque = min(taken)
        lost = self.torque * rig.encoder_loss_torque
        line.ask(f"OV {lost:.4f},{lost:.4f}")
        self._confirm({"_OVA": lost, "_OVB": lost}, VOLTAGE_STEP)

    def limit_travel(self, lower: Counts, upper: Counts) -> None:
        """Set the software limits, counts of shape (2,), and read them back."""
        (low_a, low_b), (high_a, high_b) = lower.tolist(), upper.tolist()
        self._line.ask(f"FL {high_a},{high_b}", f"BL {low_a},{low_b}")
        self._confirm({"_FLA": high_a, "_FLB": high_b, "_BLA": low_a, "_BLB": low_b})

    def _confirm(self, settings: dict[str, float], tolerance: float = 0.0) -> None:
        """Read settings back, and remember them for `check`."""
        self._line.verify(settings, tolerance)
        self._due |= {name: (value, tolerance) for name, value in settings.items()}

    def check(self) -> None:
        """Read every setting again, and refuse those that have changed since they were set.

        Raises:
            SettingChanged: Names each setting with its axis, the value found and the value set.
        """
        refuse_changes(self._line.name, self._changes)

    def _changes(self) -> list[str]:
        values = self._line.read_many(self._due)
        return [
            f"{_setting(name)} is {value:.10g}, set to {due:.10g}"
            for (name, (due, tolerance)), value in zip(self._due.items(), values, strict=True)
            if abs(value - due) > tolerance
        ]

    @property
    def memory_text(self) -> str:
        """The settings from the controller's memory, as a rig file names them."""
        return " ".join(f"{name}={value:g}" for name, value in self.memory.items())


def _setting(operand: str) -> str:
    """Return the command of an operand, and its axis and joint where it has one."""
    joint = " AB".find(operand[3:4] or "-")
    return f"{operand[1:3]} of axis {operand[3]} (joint {joint})" if joint > 0 else operand[1:]


def check_rig(controller: Controller, limits: Limits) -> None:
    """Refuse settings that the controller would not enforce, and list every fault."""
    faults = []
    period, error = controller.sample_period, controller.position_error_limit
    if not _SAMPLE_PERIODS[0] <= period <= _SAMPLE_PERIODS[1]:
        faults.append(
            f"controller.sample_period is {period * 1e6:.6g} us, and TM 1000 gives 976 to"
            " 1000 us; correct it as the controller's manual says"
        )
    room = int((limits.upper - limits.lower).min()) // 2
    if error > room:
        faults.append(
            f"controller.position_error_limit is {error} counts, more than half of the smaller"
            f" joint range, {room} counts; lower it"
        )
    if faults:
        raise RobotError(f"rig: {'; '.join(faults)}")
