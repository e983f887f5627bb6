"""Files of text: rigs, scenes, tables, manifests, corrections, profiles, judgements, fits."""

import contextlib
import json
import random
from importlib.resources import files
from pathlib import Path

import numpy as np

from sautereau.analysis.campaign.judged import with_labels
from sautereau.analysis.model.predict import predict
from sautereau.analysis.report.tables import read_fit
from sautereau.commands.output import json_text
from sautereau.daq.convert.profile import load_profile
from sautereau.rig.csv_files import read_touched_points
from sautereau.rig.document import rig_from_json, rig_json
from sautereau.rig.edit import edit_rig
from sautereau.rig.errors import SautereauError
from sautereau.rig.load import load_rig
from sautereau.rig.text import rig_text
from sautereau.robot.experiment.learning import LearnedCorrection, read_learned, write_learned
from sautereau.robot.experiment.plan import Plan, Row, read_plan_table
from sautereau.robot.experiment.session_folder import SessionFolder, read_manifest
from sautereau.sim_backend.scene import current_scene, load_scene
from sautereau.trajectory.learning import Correction
from sautereau.trajectory.press import plan_press
from tests.fuzz import mutate
from tests.fuzz.run import Wrong
from tests.fuzz.tables import campaign_of

PAPER = load_rig()
OUTLINE = "x [mm], z [mm]\n" + "".join(
    f"{x}, {z}\n" for x, z in [(0, 0.25), (4, 0.22), (8, 0.15), (8, -0.1), (4, -0.2), (0, -0.25)]
)
GESTURE = "time [s], rise [mm]\n0, 0\n0.05, 3\n0.1, 9\n0.2, 0\n"


def packaged(folder: str) -> list[str]:
    """Return the texts of all packaged files of TOML."""
    found = files(folder).iterdir()
    return [path.read_text() for path in found if path.name.endswith(".toml")]


class Text:
    """A file of text that one function reads."""

    seeds: list[str]
    name = "case"
    words: tuple[str, ...] = ()

    def __init__(self, folder: Path):
        self.folder = folder
        self.path = folder / self.name

    def case(self, dice: random.Random) -> str:
        text = self.changed(dice.choice(self.seeds), dice)
        self.path.write_bytes(mutate.as_bytes(text, dice))
        self.read(dice)
        return "read"

    def changed(self, text: str, dice: random.Random) -> str:
        return mutate.of_text(text, dice, self.words)

    def read(self, dice: random.Random) -> None:
        raise NotImplementedError


class Rigs(Text):
    """Loaded, written back in two ways, edited, planned and now and then predicted."""

    seeds = packaged("sautereau.rig")
    name = "case.toml"
    words = ("press.gesture = { file = 'gesture.csv' }", "outline = { file = 'outline.csv' }",
             "[", "]", "[[", "=", "{ value = ", "assumed", "source", "[[more_choirs]]")  # fmt: skip

    def __init__(self, folder: Path):
        super().__init__(folder)
        (folder / "gesture.csv").write_text(GESTURE)
        (folder / "outline.csv").write_text(OUTLINE)

    def read(self, dice: random.Random) -> None:
        rig = load_rig(self.path)
        if rig_from_json(rig_json(rig)) != rig:
            raise Wrong("another rig is read back from its JSON")
        self.path.write_text(rig_text(rig))
        if load_rig(self.path) != rig:
            raise Wrong("another rig is read back from its text")
        edit_rig(self.path, {"press.jack_speed": "0.05 m/s"})
        if dice.random() < 0.3:
            with contextlib.suppress(SautereauError):
                plan_press(rig)
        if dice.random() < 0.03:
            predict(rig)


class Curves(Text):
    """Gestures, outlines and touched points: tables of quantities that a rig names."""

    seeds = [GESTURE, OUTLINE, "point [mm], joint1 [counts], joint2 [deg]\n-200, 100, 0.3\n" * 2]  # noqa: RUF012
    name = "curve.csv"
    words = (",", "[m]", "time", "rise", "x", "z", '"')
    rig = seeds

    def read(self, dice: random.Random) -> None:
        with contextlib.suppress(SautereauError):
            read_touched_points(self.path, PAPER.arm)
        gesture = dice.random() < 0.5
        lines = packaged("sautereau.rig")[0].split("\n")
        table, key = ("[press]", "gesture") if gesture else ("[plectrum]", "outline")
        place = lines.index(table) + 1
        lines[place:place] = [f"{key} = {{ file = 'curve.csv' }}"]
        path = self.folder / "rig.toml"
        path.write_text("\n".join(lines))
        plan_press(load_rig(path))


class Scenes(Text):
    seeds = packaged("sautereau.sim_backend.scenes")
    name = "case.toml"
    words = ("truth", "[servo]", "[push]", "[faults]", "auto", "[[more_choirs]]", "=", "true")

    def read(self, dice: random.Random) -> None:
        scene = load_scene(self.path)
        current_scene(json.loads(scene.model_dump_json()))
        scene.as_wired(scene.true_rig(PAPER))


class PlanTables(Text):
    seeds = [  # noqa: RUF012
        'press.jack_speed,plectrum.overlap,repeats,notes\n72 mm/s,0.6 mm,3,a\n0.1 m/s,,2,"b, c"\n',
        "press.settle\n100 ms\n",
    ]
    name = "plan.csv"
    words = (",", "press.jack_speed", "repeats", "daq.channels", "press", "mm/s", "more_choirs")

    def read(self, dice: random.Random) -> None:
        rows = read_plan_table(self.path, PAPER, 2)
        json_text(Plan(PAPER, rows).document())


class Sessions(Text):
    """A manifest in the folder of a session that continues."""

    name = "session.json"

    def __init__(self, folder: Path):
        super().__init__(folder)
        self._plan = Plan(PAPER, (Row(PAPER, 2), Row(PAPER, 1, {"press.jack_speed": "72 mm/s"})))
        SessionFolder(folder, self._plan, 1, 2).start()
        old = Path(__file__).parents[1] / "data" / "written_by_0.1" / "session" / "session.json"
        self.seeds = [self.path.read_text(), old.read_text()]

    def changed(self, text: str, dice: random.Random) -> str:
        return mutate.of_json(text, dice).decode("utf-8", "replace")

    def read(self, dice: random.Random) -> None:
        if dice.random() < 0.5:
            read_manifest(self.folder)
        found = SessionFolder(self.folder, self._plan, None, 2)
        found.note_set_up({"press.jack_speed": "72 mm/s"})


class Learned(Text):
    name = "learned.json"

    def __init__(self, folder: Path):
        super().__init__(folder)
        time = np.linspace(0, 0.2, 50)
        correction = Correction(time, 1e-5 * np.sin(time * 50) * (0.2 - time))
        write_learned(self.path, PAPER, LearnedCorrection(correction, 0.05, 0.7), [0.1, 0.05])
        old = Path(__file__).parents[1] / "data" / "written_by_0.1" / "learned" / "learned.json"
        self.seeds = [self.path.read_text(), old.read_text()]

    def changed(self, text: str, dice: random.Random) -> str:
        return mutate.of_json(text, dice).decode("utf-8", "replace")

    def read(self, dice: random.Random) -> None:
        trajectory = plan_press(PAPER, None, read_learned(self.path, PAPER).correction)
        if not np.isfinite(trajectory.torques).all():
            raise Wrong("the trajectory is not finite")


class Profiles(Text):
    seeds = [  # noqa: RUF012
        'rig = "rig.toml"\nwithout = ["force"]\ntrigger = "0 s"\nrate = "51.2 kHz"\n'
        'started = "modified"\nsimulated = false\n[column]\nvelocity = "v"\n'
        '[unit]\nvelocity = "V"\n'
    ]
    name = "profile.toml"
    words = ("complete", "invert", "time", "[full_scale]", "=")

    def read(self, dice: random.Random) -> None:
        load_profile(self.path)


class Labels(Text):
    seeds = ["plectrum,touch\np 1,soft\np 2,hard\n", "session,touch\ns 1, medium\n"]  # noqa: RUF012
    name = "labels.csv"
    words = (",", "touch", "path", "rig", "soft", "hard")

    def __init__(self, folder: Path):
        super().__init__(folder)
        self._campaign = campaign_of(folder / "campaign.parquet")

    def read(self, dice: random.Random) -> None:
        with_labels(self._campaign, self.path)


class Fits(Text):
    name = "fit.json"

    def __init__(self, folder: Path):
        super().__init__(folder)
        one = {"unit": "N*m**2", "value": 1e-5, "std": 1e-7, "ci95": [0.9e-5, 1.1e-5]}
        found = {
            "parameters": {"plectrum.stiffness": one | {"identifiable": True}},
            "presses": ["a.mcap"], "level": "elastica", "residual": 0.001, "residual_before": 0.01,
            "warnings": ["w"],
        }  # fmt: skip
        self.seeds = [json.dumps(found)]

    def changed(self, text: str, dice: random.Random) -> str:
        return mutate.of_json(text, dice).decode("utf-8", "replace")

    def read(self, dice: random.Random) -> None:
        read_fit(self.path)
