"""A new rig file."""

from pathlib import Path

from sautereau.commands.common import Json, answer


def init(file: Path = Path("my-rig.toml"), /, *, json: Json = False) -> int:
    """Write a new rig file that explains every key: its meaning, unit and limits.

    Parameters
    ----------
    file
        New file, which must not exist yet.
    """
    from sautereau.rig.errors import RigError
    from sautereau.rig.text import commented_rig

    try:
        with file.open("x", encoding="utf-8") as new:
            new.write(commented_rig())
    except FileExistsError as error:
        raise RigError(f"rig file {file} already exists; give another name") from error
    answer(
        json,
        {"path": str(file)},
        [
            f"rig file: {file}, with the numbers of the packaged rig `paper`",
            f"check it with: sautereau plan {file}",
        ],
    )
    return 0
