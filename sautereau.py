"""The front door: the command line, nothing else.

Rooms are imported inside the commands that need them, so that `sautereau --help` is quick.
"""

import os
import sys

# Nothing here has matrices large enough for BLAS's threads, which wait for each other by
# spinning and bring a busy machine to a stand. Whoever has set it otherwise keeps that.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from cyclopts import App, CycloptsError

from commands import (
    acquiring,
    analysing,
    campaigning,
    converting,
    examining,
    fitting,
    learning,
    picturing,
    planning,
    pressing,
    recordings,
    reporting,
    setting_up,
    simulating,
    starting,
)
from commands.common import fail

app = App(
    name="sautereau",
    help="Press a harpsichord key with a robot finger, record it, compare it with a model.",
    result_action="return_value",
    suppress_keyboard_interrupt=False,
)
for command in (
    starting.init,
    setting_up.setup,
    planning.plan,
    planning.mount,
    pressing.press,
    acquiring.acquire,
    learning.learn,
    analysing.phases,
    planning.predict,
    fitting.compare,
    fitting.identify,
    picturing.animate,
    picturing.listen,
    campaigning.campaign,
    campaigning.touch,
    reporting.report,
    recordings.info,
    recordings.recover,
    converting.export,
    converting.import_,
    simulating.stand_in,
    simulating.trade,
    examining.doctor,
):
    app.command(command)
app.register_install_completion_command()


def main() -> None:
    """Run the command line and exit with its status."""
    try:
        status = app(print_error=False, exit_on_error=False)
    except CycloptsError as error:
        status = fail(f"{error}\nsautereau --help tells the commands", status=2)
    except BrokenPipeError:
        sys.stderr.close()  # whoever read our output has gone, and with it any use of a message
        status = 1
    except KeyboardInterrupt as error:
        status = fail("\n".join(["interrupted", *getattr(error, "__notes__", [])]))
    except Exception as error:
        from rig.errors import SautereauError

        if not isinstance(error, SautereauError | OSError):
            raise
        status = fail("\n".join([str(error), *getattr(error, "__notes__", [])]))
    sys.exit(status)


if __name__ == "__main__":
    main()
