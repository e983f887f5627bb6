"""The bench that presses keys: the hardware, or the stand-in."""

import sys
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

from sautereau.analysis.results.rig import Rig
from sautereau.analysis.text import wrapped
from sautereau.entrance.devices import Devices
from sautereau.entrance.learning import Learned, Learning
from sautereau.entrance.pressing import Observer, Pressing, Replay, Settings
from sautereau.entrance.session import Session
from sautereau.rig import schema
from sautereau.rig.errors import RigError
from sautereau.robot.experiment.monitor import Watch
from sautereau.robot.experiment.steps import Answer, Given
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.scene import Scene, load_scene


class _Watched(Observer):
    """Passes on the events, and prints the answers that the operator has not given."""

    def __init__(self, watch: Watch):
        self._watch = watch

    def watching(self) -> AbstractContextManager[Watch]:
        return nullcontext(self._watch)

    def answered(self, answer: Answer) -> None:
        sys.stderr.write(wrapped(str(answer)) + "\n")


class Bench(Devices):
    """Presses keys; a context manager. Leaving it ends a session in another thread."""

    def __repr__(self) -> str:
        return f"<Bench: {self.where}>"

    def __enter__(self) -> "Bench":
        return self

    def __exit__(self, *exception: object) -> None:
        self.control.close()

    def pause(self) -> None:
        """From another thread: finish the current press, go home and switch the motors off."""
        self.control.pause()

    def resume(self) -> None:
        """Continue a paused session with its next press."""
        self.control.resume()

    def abort(self) -> None:
        """From another thread: stop the arm and end the session. It can be continued later."""
        self.control.abort()

    def press(
        self,
        what: Any = 1,
        *,
        out: str | Path,
        warm_up: int = Settings.warm_up,
        rest: str | float = 0.0,
        notes: str = "",
        learned: str | Path | None = None,
        feed_forward: str | Path | None = None,
        ignore_health: bool = False,
        answers: Given | None = None,
        watch: Watch = lambda seen: None,
    ) -> Session:
        """Press, record each press in a file of its own, and return the recordings.

        To continue an interrupted session, call it again with the same arguments. A larger number
        adds presses, also to a finished session.

        Args:
            what: Number of presses, a CSV file of them, a `design` or its TOML file, or a plan: a
                generator of `press`, `scan`, `repeat_until` and `ask`, or a function that returns
                it.
            out: Folder for the recordings. Existing files in it are kept.
            warm_up: Number of warm-up presses wherever the finger comes from above the key: at the
                start, after a pause and after each change of the instrument. They are recorded as
                warm-up-01.mcap and so on, and are no part of the session.
            rest: Time between presses: a text with its unit, or s.
            notes: Operator's notes, saved in every recording.
            learned: Correction of the trajectory, written by `sautereau learn`.
            feed_forward: Recording of an earlier press; its force is compensated by torque.
            ignore_health: Whether to continue if a recording shows that the jack has not returned,
                the key has not followed the finger or has sunk, the plectrum no longer plucks, or
                the force at rest has drifted.
            answers: Answers to all questions of the plan: texts by question, or by the beginning of
                one, or the TOML file of them. A list answers a question in its order. Without it
                the operator is asked, and on the stand-in without a terminal nobody.
            watch: Called with each event of the session.

        Raises:
            RobotError: An operator is needed but not present, the instrument must be put right, the
                folder contains another session, or `answers` lacks a question or has another one.
            SautereauError: Any other error. The arm has been stopped and switched off.
        """
        settings = Settings(warm_up, rest, notes, learned, feed_forward, ignore_health, answers)
        pressing = Pressing(self, what, out, settings)
        pressing.run(_Watched(watch))
        pressing.check_ended()
        return pressing.session

    def replay(
        self, recording: str | Path, n: int = 1, *, out: str | Path, warm_up: int = Settings.warm_up
    ) -> Session:
        """Repeat a recorded press: its planned motion or, without a plan, its measured motion.

        Raises:
            RobotError: The motion cannot be pressed on this bench; see `press` for the others.
        """
        return self.press(Replay(Path(recording), n), out=out, warm_up=warm_up)

    def learn(
        self,
        n: int = 6,
        *,
        out: str | Path,
        notes: str = "",
        feed_forward: str | Path | None = None,
    ) -> Learned:
        """Press up to n times, correcting the trajectory from the measured speed of the jack.

        Args:
            n: Maximum number of presses; learning stops when the error no longer improves.
            out: Folder for the recordings and the correction, learned.json.
            notes: Operator's notes, saved in every recording.
            feed_forward: Recording of an earlier press; its force is compensated by torque.

        Raises:
            RobotError: The folder contains a correction, or the start of a motion is not known well
                enough.
            SautereauError: Any other error. The arm has been stopped and switched off.
        """
        pushed = None if feed_forward is None else Path(feed_forward)
        return Learning(self, n, Path(out), notes, pushed).run()


def stand_in(
    rig: Rig | schema.Rig | str | Path = "paper",
    scene: str | Path | Scene = "paper",
    seed: int | None = None,
) -> Bench:
    """Return the simulated bench of a rig.

    Args:
        rig: A rig, the path of its file, or the name of a packaged one.
        scene: A scene, the path of its file, or the name of a packaged one.
        seed: Seed of all random numbers; None for a new one, which the recording stores.

    Raises:
        RigError: The rig is not valid; the message also lists the faults of the scene.
        SceneError: The scene is not valid.
    """
    return Bench(*rig_and_scene(rig, scene), seed)


def rig_and_scene(
    rig: Rig | schema.Rig | str | Path, scene: str | Path | Scene
) -> tuple[Rig, Scene]:
    """Return the rig and the scene of a stand-in; the errors are those of `stand_in`."""
    try:
        loaded = Rig(rig)
    except RigError as error:
        try:
            _scene(scene)
        except SceneError as other:
            raise RigError(f"{error}\n{other}") from error
        raise
    return loaded, _scene(scene)


def _scene(scene: str | Path | Scene) -> Scene:
    return scene if isinstance(scene, Scene) else load_scene(scene)


def bench(rig: Rig | schema.Rig | str | Path) -> Bench:
    """Return the hardware of a rig.

    Raises:
        RigError: The rig is not one of the user's own files.
    """
    own = Rig(rig)
    if own.path is None:
        raise RigError(
            f"rig {own.name!r}: the hardware moves only with a rig file of your own, because a"
            " packaged rig has the limits of another arm; write one with `sautereau init"
            " my-rig.toml` and give its path, or use the stand-in (--sim, or st.stand_in)"
        )
    return Bench(own)
