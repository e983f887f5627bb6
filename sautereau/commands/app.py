"""The command line: every command, and how its errors are reported.

Packages are imported inside the commands that need them, so that `sautereau --help` is quick.
"""

import os
import sys

# Nothing here has matrices large enough for BLAS's threads, which wait for each other by
# spinning and bring a busy machine to a stand. Whoever has set it otherwise keeps that.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from cyclopts import App, CycloptsError

from sautereau import __version__
from sautereau.commands import (
    acquire,
    animate,
    campaign,
    convert,
    doctor,
    fit,
    init,
    learn,
    phases,
    plan,
    press,
    recordings,
    report,
    setup,
    simulate,
)
from sautereau.commands.common import fail

app = App(
    name="sautereau",
    version=__version__,
    help="Press a harpsichord key with a robot finger, record it, compare it with a model.",
    result_action="return_value",
    suppress_keyboard_interrupt=False,
)
for command in (
    init.init,
    setup.setup,
    plan.plan,
    plan.mount,
    press.press,
    acquire.acquire,
    learn.learn,
    phases.phases,
    plan.predict,
    fit.compare,
    fit.identify,
    animate.animate,
    animate.listen,
    campaign.campaign,
    campaign.touch,
    report.report,
    recordings.info,
    recordings.recover,
    convert.export,
    convert.import_,
    simulate.stand_in,
    simulate.trade,
    doctor.doctor,
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
        from sautereau.rig.errors import SautereauError

        if not isinstance(error, SautereauError | OSError):
            raise
        status = fail("\n".join([str(error), *getattr(error, "__notes__", [])]))
    sys.exit(status)
