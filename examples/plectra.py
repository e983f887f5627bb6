"""Three plectra at four speeds, five presses each: a design, its presses and their effects.

python -m examples.plectra [picture.png]
"""

import sys
import tempfile
from pathlib import Path

import sautereau as st
from sautereau.analysis.results.effects import Effects

PLECTRA = {
    "thin": {"plectrum.thickness": "0.35 mm"},
    "medium": {"plectrum.thickness": "0.40 mm"},
    "thick": {"plectrum.thickness": "0.45 mm"},
}
SPEEDS = ["0.03 m/s", "0.05 m/s", "0.07 m/s", "0.09 m/s"]


def study(speeds: list[str] = SPEEDS, repeats: int = 5) -> Effects:
    """Press the design on the stand-in; return the effects of plectrum and speed."""
    design = st.design({"plectrum": PLECTRA, "jack_speed": speeds}, repeats=repeats, seed=1)
    with tempfile.TemporaryDirectory() as out, st.stand_in("paper", seed=1) as bench:
        return bench.press(design, out=out).effects(interaction=True)


def main() -> None:
    effects = study()
    print(effects)
    if len(sys.argv) > 1:
        effects.plot().savefig(Path(sys.argv[1]), dpi=100)


if __name__ == "__main__":
    main()
