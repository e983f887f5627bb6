"""Settings that are read again before each motion."""

import logging
from collections.abc import Callable

from sautereau.robot.errors import SettingChanged

_LOG = logging.getLogger(__name__)


def refuse_changes(controller: str, read: Callable[[], list[str]]) -> None:
    """Refuse settings that have changed since they were set.

    A bit that flips on the line looks like a changed setting, once: what differs is read again,
    and a difference that the second reading does not find is a warning.

    Args:
        controller: Port of the controller, for the message.
        read: Reads all settings; returns a text for each that differs.

    Raises:
        SettingChanged: Two readings found differences; names those of the second.
    """
    if first := read():
        if second := read():
            raise SettingChanged(controller, second)
        _LOG.warning(
            "controller on %s: %s when read once, and as set when read again; the line may be"
            " disturbed: check its cable",
            controller,
            "; ".join(first),
        )
