"""The commands: which function carries out which, and how one is recognised."""

import re

from sautereau.sim_backend.devices.galil.answers import CommandError
from sautereau.sim_backend.devices.galil.commands import arrays, motion, report, settings
from sautereau.sim_backend.devices.galil.commands import program as programs
from sautereau.sim_backend.devices.galil.commands.call import Handler, parse_call
from sautereau.sim_backend.devices.galil.machine import Machine
from sautereau.sim_backend.devices.galil.program import Thread
from sautereau.sim_backend.devices.galil.reference import ABSENT, entries

_WORDS = ("ELSE", "ENDIF")  # Commands of more than two letters
REVISION, MASTER_RESET, LOCK = "\x12\x16", "\x12\x13", "\x0c\x0b"
_LOCKED = ("ED", "LS", "UL")  # Commands that a locked program refuses

HANDLERS: dict[str, Handler] = {
    **{code: settings.setting for code, entry in entries().items() if entry.form == "values"},
    **dict.fromkeys(("EI", "LZ", "SM", "TM", "US", "CN"), settings.configure),
    **dict.fromkeys(("TP", "RP", "TE", "TD", "TT", "TS", "SC", "TV", "RL"), report.tell),
    **dict.fromkeys(("SB", "CB"), settings.set_bit),
    **dict.fromkeys(("PA", "PR", "JG"), motion.aim),
    **dict.fromkeys(("HM", "FE", "FI"), motion.search),
    **dict.fromkeys(("PF", "VF"), settings.format_numbers),
    **report.LISTS,
    "IP": motion.increment,
    "AG": settings.gain,
    "MT": settings.gain,
    "OV": settings.encoder_torque,
    "BW": settings.brake,
    "DE": settings.define_auxiliary,
    "DP": settings.define_position,
    "TL": settings.torque_limit,
    "OF": settings.torque_limit,
    "BA": settings.brushless,
    "AL": settings.arm_latch,
    "MO": motion.motor_off,
    "SH": motion.servo_here,
    "BG": motion.begin,
    "PV": motion.segment,
    "BT": motion.begin_pvt,
    "ST": motion.stop,
    "AB": motion.abort,
    "AZ": settings.clear_amplifier,
    "PW": settings.set_password,
    "OP": settings.output_port,
    "OB": settings.output_bit,
    "BN": settings.burn,
    "BV": settings.burn_variables,
    "RS": settings.reset,
    "EO": settings.echo,
    "CW": settings.mark,
    "CF": settings.unsolicited,
    "TH": settings.tell_handles,
    "WH": settings.which_handle,
    "ID": report.identify,
    "MG": report.message,
    "TB": report.tell_status,
    "TC": report.tell_code,
    "TZ": report.tell_ports,
    "LS": report.list_program,
    "NO": programs.no_operation,
    "DM": arrays.define,
    "DA": arrays.remove,
    "RA": arrays.record_into,
    "RD": arrays.record_data,
    "RC": arrays.record,
    "QD": arrays.download,
    "QU": arrays.upload,
    "BP": programs.burn,
    "DL": programs.download,
    "ED": programs.edit,
    "XQ": programs.run,
    "HX": programs.halt,
    "ZS": programs.clear_stack,
    "EN": programs.end,
    "RE": programs.end_error,
    "JP": programs.jump,
    "JS": programs.call,
    "IF": programs.branch,
    "ELSE": programs.otherwise,
    "ENDIF": programs.no_operation,
    "AM": programs.after_motion,
    "MC": programs.motion_complete,
    "WT": programs.wait,
    "AT": programs.at_time,
    "AI": programs.after_input,
}
"""Functions that carry out the commands of the reference's table, by the command's letters."""


def execute(machine: Machine, text: str, thread: Thread | None = None) -> str | None:
    """Carry out one command of the host or of a program; return its answer, if it has one.

    Raises:
        CommandError: It is refused; nothing has changed.
    """
    if text == REVISION and thread is None:
        return machine.unit.revision
    if text == MASTER_RESET and thread is None:
        return settings.master_reset(machine)
    if text.startswith(LOCK) and thread is None:
        return settings.lock(machine, text.removeprefix(LOCK).strip(" "))
    if text.startswith("'") or (thread is not None and text.startswith("#")):
        return None
    code = next((word for word in _WORDS if text == word), text[:2])
    entry = entries().get(code)
    known = entry is not None or code in ABSENT
    # A variable may begin with the letters of a command, if small letters or digits follow them.
    assigned = not known or re.match(r"[A-Z]{2}[a-z0-9][A-Za-z0-9]* *[\[=]", text)
    if assigned and (answer := programs.assign(machine, text)) is not None:
        return answer or None
    if entry is None or code in machine.unit.galil.absent:
        raise CommandError(1)
    call = parse_call(machine, entry, text[len(code) :].strip(" "), thread)
    if machine.locked and code in _LOCKED:
        raise CommandError(106)
    return HANDLERS[code](machine, call)
