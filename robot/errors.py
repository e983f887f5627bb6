"""Errors of the robot and of its controller."""

# ruff: noqa: N818 - the names state what happened

from collections.abc import Iterable

from sautereau.rig.errors import SautereauError


class RobotError(SautereauError):
    """A fault of the robot or of its controller; the message gives the way to fix it.

    Where the motors may have been on, ``aftermath`` reports whether they are known to be off.
    """

    aftermath: str = ""
    """How the arm was made safe, and whether the controller confirmed it."""

    def __str__(self) -> str:
        return f"{super().__str__()}\n{self.aftermath}".rstrip()


class PortUnavailable(RobotError):
    """The serial port does not exist, may not be used, or is used by another program."""


class LineLost(RobotError):
    """The connection broke: cable, adapter or the controller's power."""


class SilentController(RobotError):
    """The controller did not answer within its timeout."""


class GarbledAnswer(RobotError):
    """The controller sent something that does not answer what was asked."""


class UnaskedText(GarbledAnswer):
    """The controller sent something by itself: its program failed, or another program shares it."""


class CommandRefused(RobotError):
    """The controller answered `?`.

    Args:
        controller: Port of the controller, for the message.
        command: The command refused; those before it on its line were executed.
        code: Code of the error, from `TC1`.
        text: Text of the error, from `TC1`.
    """

    def __init__(self, controller: str, command: str, code: int, text: str):
        self.controller, self.command, self.code, self.text = controller, command, code, text
        fix = _FIXES.get(code, f"look up code {code} under TC in the command reference")
        super().__init__(f"controller on {controller} refused {command!r}: {code} {text}; {fix}")

    def __reduce__(self):
        return type(self), (self.controller, self.command, self.code, self.text)


class NotReady(RobotError):
    """A call out of order; the message names the state and the way out of it."""


class UnsafeRequest(RobotError):
    """A motion that the rig's limits forbid; nothing was sent."""


class SettingNotTaken(RobotError):
    """The controller accepted a setting, and reads back another value."""


class SettingChanged(SettingNotTaken):
    """A setting that the controller had taken reads back another value before a motion."""

    def __init__(self, controller: str, changes: Iterable[str]):
        super().__init__(
            f"controller on {controller}: before a motion its settings are not those of this"
            f" driver, read twice: {'; '.join(changes)}; this driver has not changed them: end"
            " every other program that uses the controller, then run the same command again"
        )


class MotionFault(RobotError):
    """A motion that did not end where and as planned."""


_FIXES = {
    1: "this firmware does not know the command: check the controller's model and revision",
    6: "a number is out of the controller's range: compare the rig file with the manual",
    7: "a motion is running: call wait() or stop() first",
    20: "the motors are off: check the emergency stop, then enter powered() again",
    19: "an automatic routine of its program runs, because an error persists: check the"
    " amplifiers' power and the motors' cables, then connect() again",
    82: "its program and arrays are lost, as after a reset: check its power, then connect() again",
    22: "a limit is active: move the arm off it by hand, then home()",
}
