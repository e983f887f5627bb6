"""Group A, before anything is changed: who answers, and what its memory holds."""

import time

from sautereau.rig.schema import Rig
from sautereau.robot.drivers.galil.driver import GalilDriver
from sautereau.robot.drivers.serial_port import open_port
from sautereau.robot.experiment.setup.step import Declined
from sautereau.robot.experiment.setup.verify.workbench import VerifyStep, Workbench

_KEPT = ("_TM", "_BWA", "_BWB", "_CN0", "_CN1", "_OEA", "_OEB", "_LDA", "_LDB", "_AGA", "_AGB")
_THREADS = range(8)


def look(bench: Workbench) -> None:
    """Look at a controller before it is set up; nothing is changed but its echo."""
    driver = _not_set_up(bench.rig)
    try:
        identity = driver.introduce()
        line = driver.line
        off = line.read("_MOA", "_MOB")
        kept = dict(zip(_KEPT, line.read(*_KEPT), strict=True))
        threads = [line.read(f"_XQ{n}")[0] for n in _THREADS]
        program = line.ask("LS")
        if off != [1, 1]:
            driver.abort()
    finally:
        driver.close()
    bench.say(f"{identity}, {', '.join(f'{name} = {value:g}' for name, value in kept.items())}")
    bench.expect(
        off == [1, 1],
        "its motors were on before anything was sent",
        "end the other program that uses it; if it switches them on by itself, burn MO: send MO,"
        " then BN, and switch it off and on",
    )
    running = [n for n, at in enumerate(threads) if at >= 0]
    if "#AUTO" in program or running:
        start = "begins with #AUTO, so that it starts by itself," if "#AUTO" in program else ""
        runs = f"runs now in threads {running}" if running else ""
        what = f"The program in the controller {start} {runs}".strip()
        if not bench.ask.confirm(f"{what}. May it be stopped and replaced until the next reset?"):
            raise Declined(f"setup verify, step {bench.step}: {what}, and it was not to be stopped")
        bench.warn(f"{what}; burn no program (BP) if this bench is the controller's only use")


def _not_set_up(rig: Rig) -> GalilDriver:
    settings = rig.controller
    port = open_port(settings.port, settings.baud_rate, settings.timeout)
    return GalilDriver(rig, port, time.monotonic, time.sleep)


def set_up(bench: Workbench) -> None:
    """Connect as a press does: settings, limits and program are set and read back."""
    bench.controller.connect()
    driver = bench.driver
    bench.values["controller.verified"] = driver.record
    bench.values["controller.verified_settings"] = driver.settings.memory_text
    bench.figures["torque_limit_volts"] = driver.settings.torque
    room, due = min(driver.line.read("_PVA", "_PVB")), bench.rig.controller.segment_limit
    bench.expect(
        room >= due,
        f"its FIFO has room for {room:g} segments, and controller.segment_limit is {due}",
        "correct the rig file, or switch the controller off and on",
    )
    bench.say(f"{driver.record}: settings, limits and program read back as sent")
    memory = driver.settings.memory
    if not (memory["KIA"] and memory["KIB"]):
        bench.warn("KI is 0: an encoder that fails at rest is not detected; burn a KI above 0")


STEPS = (
    VerifyStep("A1", "look", "identity, burned parameters, burned or running program", look),
    VerifyStep("A2", "settings", "DL and LS return the program; every setting reads back", set_up),
)
