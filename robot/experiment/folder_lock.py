"""One session at a time in a folder, and with a card and a controller."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from sautereau.daq.source.connection import hold_card
from sautereau.rig.disk import make_folder
from sautereau.rig.lock import Taken, locked
from sautereau.rig.schema import Rig
from sautereau.robot.drivers.serial_port import hold_port
from sautereau.robot.errors import RobotError

LOCK = ".session.lock"  # File of the lock, while a session runs


@contextmanager
def only_session(folder: Path, rig: Rig | None = None) -> Iterator[None]:
    """Hold a folder, card and controller for one session, also between presses and in pauses.

    The folder is created, and removed again if nothing is written. An error that is raised in the
    block remains the one that is raised.

    Args:
        rig: Names card and controller; None for a stand-in, which nobody else uses.

    Raises:
        RobotError: Another session runs in the folder, it cannot be written, or another process
            uses the controller.
        DaqError: Another process uses the card.
    """
    with ExitStack() as stack:
        if not folder.exists():
            stack.callback(_remove_empty, folder)
        try:
            make_folder(folder)
            stack.enter_context(locked(folder / LOCK))
        except Taken as error:
            raise RobotError(
                f"session folder {folder}: {error} runs a session in it; wait until it has ended,"
                " or give another --out"
            ) from error
        except OSError as error:
            raise RobotError(
                f"session folder {folder}: {error.strerror}; give a folder that can be written"
            ) from error
        if rig is not None:
            purpose = f"a session in {folder.absolute()}"
            stack.enter_context(hold_card(rig.daq, purpose, shared=True))
            stack.enter_context(hold_port(rig.controller.port, purpose, shared=True))
        try:
            yield
        except BaseException as error:
            if not folder.is_dir():
                error.add_note(
                    f"The folder {folder} was removed or renamed during the session. If it was"
                    " removed, all recordings in it are lost"
                )
            raise


def _remove_empty(folder: Path) -> None:
    with suppress(OSError):  # it is not empty, or gone
        folder.rmdir()
