"""Learning on the stand-in: the speed error of a press before and after."""

import tempfile
from pathlib import Path

from benchmarks.figures import Figure, check
from sautereau.rig.load import load_rig, with_values

SEEDS = 20
PRESSES = 6
LIMIT = 1.0  # %, RMS speed error of the jack over the cruise, in the best press
GROWTH = 1.5  # Dimensionless, largest error of a later press relative to the best one before it
SLOW_HOST = {"controller.timeout": "20 s"}
"""The stand-in answers after its motion, which takes long on a busy machine."""
OTHERS = {
    "no string": {"plectrum": "none", "string": "none"},
    "jack of 12 g, 6 g in the rig": {"truth": {"jack.mass": "12 g"}},
}


def run() -> list[Figure]:
    """Return the errors of first and best presses, over seeds and for rigs with wrong values."""
    learned = [_errors(seed) for seed in range(SEEDS)]
    for errors in learned:
        steady = all(e <= GROWTH * min(errors[:i]) for i, e in enumerate(errors) if i)
        check(steady, f"the error grows by more than {GROWTH:g}: {errors} %")
    needed = max(
        next((i for i, e in enumerate(errors, 1) if e <= LIMIT), PRESSES + 1) for errors in learned
    )
    of_all = f"largest of {SEEDS} seeds"
    figures = [
        Figure(f"paper: first press, {of_all}", max(e[0] for e in learned), "%", "limit", 10.0),
        Figure(f"paper: best of {PRESSES}, {of_all}", max(map(min, learned)), "%", "limit", LIMIT),
        Figure(f"paper: presses until {LIMIT:g} %, {of_all}", needed, "1", "limit", PRESSES),
    ]
    for name, changes in OTHERS.items():
        best = min(_errors(0, changes))
        figures.append(Figure(f"{name}: best of {PRESSES}", best, "%", "limit", LIMIT))
    pushed = _errors(0, feed_forward=True)
    check(
        pushed[0] < 0.5 * learned[0][0],
        f"feed-forward leaves {pushed[0]:.3g} %, of {learned[0][0]:.3g}",
    )
    return [
        *figures,
        Figure("paper: first press with feed-forward", pushed[0], "%", "without", learned[0][0]),
        Figure("paper: best with feed-forward", min(pushed), "%", "without", min(learned[0])),
    ]


def _errors(
    seed: int, changes: dict[str, object] | None = None, *, feed_forward: bool = False
) -> list[float]:
    """Return the RMS speed error of every press [%]."""
    from sautereau.robot.drivers.galil.driver import GalilController
    from sautereau.robot.experiment.feedforward import force_of
    from sautereau.robot.experiment.learning import IterativeLearning
    from sautereau.robot.experiment.session import Item, make_presses
    from sautereau.sim_backend.bench import StandIn
    from sautereau.sim_backend.scene import load_scene
    from sautereau.trajectory.press import plan_press

    rig = with_values(load_rig(), SLOW_HOST)
    scene = load_scene("paper").model_copy(update=changes)
    with tempfile.TemporaryDirectory() as folder, StandIn(rig, scene, seed) as stand_in:
        bench, out, measured = stand_in.rig, Path(folder), None
        if feed_forward:
            presses = [Item(bench, plan_press(bench))]
            (path,) = make_presses(GalilController(bench), out, presses)
            measured = force_of(path)
        learning = IterativeLearning(rig, None, PRESSES, measured=measured)
        make_presses(
            GalilController(bench), out, learning.presses_on(bench), on_press=learning.update
        )
    return [100 * error for error in learning.errors]
