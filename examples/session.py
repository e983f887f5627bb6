"""A session on the stand-in, compared with the model, like `make press`.

python -m examples.session [picture.png]
"""

import sys
import tempfile
from pathlib import Path

import sautereau as st


def study(
    n: int = 3, scene: str = "paper", seed: int = 1, picture: Path | None = None
) -> st.Session:
    """Make n presses on the stand-in; return them with their samples."""
    with tempfile.TemporaryDirectory() as out, st.stand_in("paper", scene, seed) as bench:
        session = bench.press(n, out=out).read(samples=True)
        if picture:
            session.compare().plot().savefig(picture, dpi=120)
    return session


def main() -> None:
    picture = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    error = study(picture=picture).compare().document["duration_error"]["value"]
    print(f"pluck duration, model error (model - measured) / measured: {error:+.2%}")


if __name__ == "__main__":
    main()
