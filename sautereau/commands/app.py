"""The command line: every command, and how its errors are reported.

Packages are imported inside the commands that need them, so that `sautereau --help` starts
quickly.
"""

import os
import sys
import traceback

# No matrix here is large enough for the threads of BLAS, which wait for each other in busy loops
# and slow a loaded machine down. A value set by the user stays.
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
from sautereau.commands.usage import usage_message

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
    """Run the command line and exit with its status: 0, 1 for an error, 2 for wrong usage.

    With `--json` an error, too, is one JSON object, on standard error.
    """
    as_json = "--json" in sys.argv
    try:
        status = app(print_error=False, exit_on_error=False)
    except CycloptsError as error:
        status = fail(as_json, usage_message(error), 2)
    except BrokenPipeError:
        sys.stderr.close()  # the reader of the output has ended: no message would be read
        status = 1
    except KeyboardInterrupt as error:
        status = fail(as_json, _with_notes("interrupted", error))
    except Exception as error:
        from sautereau.rig.errors import SautereauError

        if isinstance(error, SautereauError | OSError):
            status = fail(as_json, _with_notes(str(error), error))
        elif as_json:
            status = fail(True, f"bug: {error!r}", traceback=traceback.format_exc())
        else:
            raise
    sys.exit(status)


def _with_notes(message: str, error: BaseException) -> str:
    return "\n".join([message, *getattr(error, "__notes__", [])])
