"""Refused commands, and the error codes that TC reports."""

TEXTS = {
    0: "",
    1: "Unrecognized command",
    2: "Command only valid from program",
    3: "Command not valid in program",
    4: "Operand error",
    5: "Input buffer full",
    6: "Number out of range",
    7: "Command not valid while running",
    8: "Command not valid while not running",
    9: "Variable error",
    10: "Empty program line or undefined label",
    11: "Invalid label or line number",
    12: "Subroutine more than 16 deep",
    13: "JG only valid when running in jog mode",
    16: "IP incorrect sign during position move or IP given during forced deceleration",
    17: "ED, BN and DL not valid while program running",
    19: "Application strand already executing",
    20: "Begin not valid with motor off",
    21: "Begin not valid while running",
    22: "Begin not possible due to Limit Switch",
    24: "Begin not valid because no sequence defined",
    32: "Segment buffer full",
    39: "No time specified",
    50: "Not enough fields",
    52: 'Missing " or string too long',
    53: "Error in {}",
    55: "Missing [ or []",
    56: "Array index invalid or out of range",
    57: "Bad function or array",
    58: "Bad command response",
    59: "Mismatched parentheses",
    60: "Download error - line too long or too many lines",
    61: "Duplicate or bad label",
    62: "Too many labels",
    63: "IF statement without ENDIF",
    66: "Array space full",
    67: "Too many arrays or variables",
    80: "Record mode already running",
    81: "No array or source specified",
    82: "Undefined Array",
    83: "Not a valid number",
    84: "Too many elements",
    90: "Only A B C D valid operand",
    106: "Privilege Violation",
    123: "TCP lost sync",
    135: "Motor must be in MO",
    136: "Invalid Password",
    137: "Invalid lock setting",
    138: "Passwords not identical",
    141: "Feature not supported",
}
"""Texts of the error codes that occur, in the command reference's words."""


class CommandError(Exception):
    """A refused command: the controller answers ``?`` and keeps the code for TC.

    Args:
        code: Key of `TEXTS`.
    """

    def __init__(self, code: int) -> None:
        super().__init__(f"{code} {TEXTS[code]}")
        self.code = code
