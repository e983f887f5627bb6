"""A stand-in on which faults are injected, and what came of a press on it."""

import re
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import pytest

import sautereau.sim_backend.devices.galil.firmware as firmware_module
from sautereau.daq.file.reading import read_recording
from sautereau.daq.file.recovery import recover
from sautereau.rig.errors import SautereauError
from sautereau.rig.load import load_rig, with_values
from sautereau.rig.text import rig_text
from sautereau.robot.drivers.galil.driver import GalilController
from sautereau.robot.experiment.session import Item, make_presses
from sautereau.sim_backend.bench import StandIn
from sautereau.sim_backend.parts import ControllerUnit
from sautereau.trajectory.press import plan_press
from tests.forked import Command, CommandServer
from tests.presses import QUICK, mute_scene

HOLD = {"press.bottom_hold": "1 s"}


@dataclass
class Desk:
    """A stand-in with fault injection, and what came of a press on it."""

    out: Path
    patch: pytest.MonkeyPatch
    port: str = "serial"
    server: CommandServer | None = None
    error: BaseException | None = None
    struck: float | None = None
    """s on the controller's clock, time of the fault; None for before the motors were on."""
    off: float | None = None
    """s on the controller's clock, when the motors went off for the last time."""
    on: bool = False
    was_on: bool = False
    due: list[tuple[int, float, Callable[[], object]]] = field(default_factory=list)
    begins: Callable[[], bool] = lambda: False
    """Whether the fault occurs now, where it was prepared before."""
    detected: bool = False
    """Whether the time counts from when the controller detects the fault."""

    def press(self, *, n=1, seed=0, rig=None, finger="ideal", controller=None, **faults):
        """Press; the outcome is in `error`, `struck`, `off` and `out`."""
        with self.stand_in(rig, finger, seed, faults) as stand_in:
            wired = controller(stand_in.rig) if controller else stand_in.rig
            self.attempt(
                lambda: make_presses(
                    GalilController(wired), self.out, [Item(wired, plan_press(stand_in.rig))] * n
                )
            )
            self.await_off()

    def stand_in(self, rig=None, finger="ideal", seed=0, faults=None) -> StandIn:
        """Return a stand-in whose motors and faults are observed."""
        unit = ControllerUnit(interface="ethernet") if self.port == "tcp" else None
        scene = mute_scene(finger, faults=faults, controller=unit)
        values = QUICK | {"controller.timeout": "2 s"} | HOLD | (rig or {})
        stand_in = StandIn(with_values(load_rig(), values), scene, seed, paced=True)
        self.watch(stand_in.bench, faults or {})
        return stand_in

    def watch(self, bench, faults) -> None:
        self.bench = bench
        tick, receive = bench.tick, bench.firmware.receive
        at = next((f for f in faults.values() if "press" in f and "at" in f), None)
        if at is not None and not self.detected:
            seconds = float(at["at"].removesuffix(" ms")) * 1e-3
            self.at(at["press"], seconds, lambda: None)

        def note():
            on = any(bench.firmware.motors_on)
            if self.on and not on:
                self.off = bench.firmware.now
            self.on, self.was_on = on, on or self.was_on

        def ticked():
            for each in list(self.due):
                press, later, do = each
                if bench.injection.past(press, later):
                    self.due.remove(each)
                    self.note_fault()
                    do()
            tick()
            if self.begins():
                self.note_fault()
            note()

        def received(data, *port, **named):
            answer = receive(data, *port, **named)
            note()
            return answer

        bench.tick, bench.firmware.receive = ticked, received

    def note_fault(self) -> None:
        """Note that the fault occurs now."""
        if self.struck is None and self.was_on:
            self.struck = self.bench.firmware.now

    def at(self, press, seconds, do) -> None:
        """Call ``do`` a number of seconds after the edge of a press."""
        self.due.append((press, seconds, do))

    @property
    def machine(self):
        return self.bench.firmware

    def on_command(self, pattern, do, *, times=1, occurs=True) -> None:
        """Call ``do`` in place of a command that the controller receives.

        The command is executed where ``do`` returns true; a raised CommandError refuses it. The
        fault occurs then, or when it ``begins``.
        """
        left, execute = [times], firmware_module.execute

        def hooked(machine, command, thread=None):
            if left[0] and re.match(pattern, command):
                left[0] -= 1
                if occurs:
                    self.note_fault()
                if not do():
                    return None
            return execute(machine, command, thread)

        self.patch.setattr(firmware_module, "execute", hooked)

    def start_command(self, stand_in) -> Command:
        """Start `sautereau press` on a stand-in, in a process of its own."""
        assert self.server is not None
        rig = self.out.with_suffix(".toml")
        rig.write_text(rig_text(stand_in.rig))
        words = ("press", rig, "--warm-up", 0, "--out", self.out)
        return self.server.start(*words, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)

    def command(self, stand_in, **limits) -> str:
        """Run `sautereau press` on a stand-in; return what it says of an error."""
        assert self.server is not None
        rig = self.out.with_suffix(".toml")
        rig.write_text(rig_text(stand_in.rig))
        words = ("press", rig, "--warm-up", 0, "--out", self.out)
        done = self.server.run(*words, folder=self.out.parent, **limits)
        return done.stderr

    def attempt(self, act) -> None:
        """Call something that fails, as the command line does."""
        try:
            act()
        except (SautereauError, KeyboardInterrupt) as error:
            self.error = error

    def await_off(self) -> None:
        """Wait until the controller alone has switched the motors off."""
        end = time.monotonic() + 60
        while self.on and time.monotonic() < end:
            time.sleep(0.01)

    @property
    def after(self) -> float:
        """s from the fault to the motors off; 0 where they never were on."""
        assert not self.on
        if self.struck is None or self.off is None:
            return 0.0
        return max(0.0, self.off - self.struck)

    @property
    def message(self) -> str:
        assert self.error is not None, "nothing went wrong"
        kind = "interrupted: " if isinstance(self.error, KeyboardInterrupt) else ""
        return kind + "\n".join([str(self.error), *getattr(self.error, "__notes__", [])])

    @property
    def recording(self) -> str:
        """The recordings of the press, which are always readable."""
        complete = sorted(self.out.glob("*.mcap"))
        found = [f"{len(complete)} complete"] if complete else []
        for path in complete:
            read_recording(path)
        for part in sorted(self.out.glob("*.part")):
            try:
                read_recording(part)
                found.append("one incomplete, closed")
            except SautereauError:
                found.append(self._recovered(part))
        return ", ".join(found) or "none started"

    def _recovered(self, part: Path) -> str:
        try:
            recover(part, self.out / "recovered.mcap")
        except SautereauError as error:
            if not re.search("no sample of it is left|none of its samples", str(error)):
                raise
            return "one without a sample"
        return "one incomplete, `recover` reads it"
