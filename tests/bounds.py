"""Run the quick tests with the oldest and with the newest versions that pyproject.toml allows.

`make bounds` installs uv and runs this. Oldest are the direct requirements, with the newest of what
they require in turn. The environments and the outputs of the tests are in build/bounds.
"""

import argparse
import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
FOLDER = ROOT / "build" / "bounds"
UV = Path(sys.executable).with_name("uv")
RESOLUTIONS = {"oldest": "lowest-direct", "newest": "highest"}  # As uv calls them
ROW = "{:22} {:20} {:12} {:12}\n"


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m tests.bounds", description="Other arguments are those of pytest."
    )
    parser.add_argument("only", nargs="?", choices=[*RESOLUTIONS, "both"], default="both")
    words, options = parser.parse_known_args()
    names = [name for name in RESOLUTIONS if words.only in (name, "both")]
    pythons = {name: install(name) for name in names}
    results = {name: tested(name, python, options) for name, python in pythons.items()}
    versions = {name: installed(python) for name, python in pythons.items()}
    sys.stdout.write(ROW.format("package", "allowed", *names, ""))
    for name, allowed in requirements().items():
        shown = [versions[each].get(name, "-") for each in names]
        sys.stdout.write(ROW.format(name, allowed, *shown, ""))
    for name, (_, last) in results.items():
        sys.stdout.write(f"{name}: {last}; see {FOLDER / name}.txt\n")
    return int(any(status for status, _ in results.values()))


def install(name: str) -> Path:
    """Make an environment as `make` does, and return its interpreter."""
    home = FOLDER / name
    python = home / "bin" / "python"
    subprocess.run([UV, "venv", "--quiet", "--clear", "--python", sys.executable, home], check=True)
    subprocess.run(
        [
            UV, "pip", "install", "--quiet", "--compile-bytecode", "--python", python,
            "--resolution", RESOLUTIONS[name], "--editable", ".[all]", "--group", "dev",
        ],
        cwd=ROOT, check=True,
    )  # fmt: skip
    return python


def tested(name: str, python: Path, options: list[str]) -> tuple[int, str]:
    """Run the quick tests; return the status and the last line of the output."""
    sys.stdout.write(f"{name}: the quick tests are running\n")
    sys.stdout.flush()
    out = FOLDER / f"{name}.txt"
    command = [python, "-m", "pytest", "-q", "-n", "auto", "--dist", "worksteal", *options]
    with out.open("w", encoding="utf-8") as file:
        status = subprocess.run(command, cwd=ROOT, stdout=file, stderr=file, check=False).returncode
    return status, out.read_text(encoding="utf-8").rstrip().rpartition("\n")[2].strip("= ")


def installed(python: Path) -> dict[str, str]:
    """Return the versions of the packages of an environment by their names."""
    command = [UV, "pip", "list", "--quiet", "--python", python, "--format", "json"]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    return {package["name"]: package["version"] for package in json.loads(done.stdout)}


def requirements() -> dict[str, str]:
    """Return the allowed versions of the direct requirements by their names, as uv writes them."""
    document = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    project, groups = document["project"], document["dependency-groups"]
    extras = project["optional-dependencies"]
    texts = [*project["dependencies"]]
    texts += [text for name in extras if name not in ("all", "notebook") for text in extras[name]]
    texts += [text for name in ("docs", "dev") for text in groups[name] if isinstance(text, str)]
    found = (re.match(r"([\w.-]+)(?:\[.*?\])?([^;]*)", text) for text in texts)
    return {each[1].lower().replace("_", "-"): each[2].strip() for each in found if each}


if __name__ == "__main__":
    sys.exit(main())
