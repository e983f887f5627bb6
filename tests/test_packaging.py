"""Wheel and sdist: their contents, their use from other folders, and the extras."""

import json
import re
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tomllib
import venv
import zipfile
from email.parser import Parser
from pathlib import Path

import pytest
import yaml
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from sautereau.rig.version import code_hash

ROOT = Path(__file__).parents[1]
ROOMS = ("rig", "trajectory", "daq", "analysis", "sim_backend", "robot")
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
EXTRAS = PROJECT["optional-dependencies"]


BUILD = """
import sys
from setuptools import build_meta
out, *kinds = sys.argv[1:]
for kind in kinds:
    getattr(build_meta, f"build_{kind}")(out)
"""


def run(*words: object, cwd: Path, **options) -> str:
    """Run a command and return its output; its failure fails the test."""
    done = subprocess.run(
        [str(word) for word in words],
        cwd=cwd, capture_output=True, text=True, check=False, **options,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def build(source: Path, out: Path, *kinds: str) -> None:
    """Build from a copy of a source tree, because setuptools writes into it."""
    ignored = (".git", ".venv", "build", "out", "site", "*.egg-info", "__pycache__")
    copy = out / "source"
    ignore = shutil.ignore_patterns(*ignored, "node_modules", ".*_cache")
    shutil.copytree(source, copy, ignore=ignore)
    run(sys.executable, "-c", BUILD, out, *kinds, cwd=copy)


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Wheel and sdist."""
    out = tmp_path_factory.mktemp("dist")
    build(ROOT, out, "sdist", "wheel")
    return next(out.glob("*.whl")), next(out.glob("*.tar.gz"))


def contents(wheel: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(wheel) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def files(folder: Path, root: Path) -> set[str]:
    found = (path for path in folder.rglob("*") if path.is_file())
    return {str(p.relative_to(root)) for p in found if "__pycache__" not in p.parts}


def test_the_wheel_holds_the_packages_and_nothing_else(built):
    held = {name for name in contents(built[0]) if ".dist-info/" not in name}
    expected = {str(Path("sautereau", p)) for room in ROOMS for p in files(ROOT / room, ROOT)}
    assert held == expected | files(ROOT / "sautereau", ROOT)
    assert {"sautereau/rig/paper.toml", "sautereau/sim_backend/scenes/paper.toml"} <= held


@pytest.mark.slow
def test_the_sdist_is_complete_and_small(built, tmp_path):
    """A wheel built from the sdist is the same, to the byte."""
    wheel, sdist = built
    with tarfile.open(sdist) as archive:
        names = archive.getnames()
        archive.extractall(tmp_path, filter="data")
    (folder,) = tmp_path.iterdir()
    texts = ("README.md", "LICENSE", "CHANGELOG.md", "CONTRIBUTING.md", "CITATION.cff")
    for name in (*texts, "Makefile", "tests/test_packaging.py"):
        assert f"{folder.name}/{name}" in names
    assert not [name for name in names if "node_modules" in name]
    recordings = [name for name in names if name.endswith(".mcap")]
    assert all("/tests/data/" in name for name in recordings)
    assert sdist.stat().st_size < 3e6
    build(folder, tmp_path / "again", "wheel")
    (again,) = (tmp_path / "again").glob("*.whl")
    assert contents(again) == contents(wheel)


@pytest.mark.slow
def test_the_wheel_is_the_same_to_the_byte(tmp_path, monkeypatch):
    """Built twice, in other folders and at another time of files."""
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    wheels = []
    for name in ("one", "other"):
        build(ROOT, tmp_path / name, "wheel")
        wheels += [path.read_bytes() for path in (tmp_path / name).glob("*.whl")]
    assert len(wheels) == 2
    assert wheels[0] == wheels[1]


def test_the_locked_versions_are_allowed():
    lines = (ROOT / "tests" / "constraints.txt").read_text(encoding="utf-8").split()
    locked = {canonicalize_name(n): v for n, v in (line.split("==") for line in lines)}
    everything = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    extras = [text for extra in EXTRAS.keys() - {"notebook"} for text in EXTRAS[extra]]
    needed = [*PROJECT["dependencies"], *extras, *everything["dependency-groups"]["dev"]]
    for requirement in (Requirement(text) for text in needed if isinstance(text, str)):
        if requirement.name == "sautereau":  # the extra `all`
            continue
        assert locked[canonicalize_name(requirement.name)] in requirement.specifier, requirement


def test_the_wheel_has_its_metadata(built):
    held = contents(built[0])
    (metadata,) = (text for name, text in held.items() if name.endswith("/METADATA"))
    fields = Parser().parsestr(metadata.decode())
    assert (fields["Name"], fields["Version"]) == ("sautereau", PROJECT["version"])
    assert set(fields.get_all("Provides-Extra", [])) == set(EXTRAS)
    (entries,) = (text for name, text in held.items() if name.endswith("/entry_points.txt"))
    assert "sautereau = sautereau.__main__:main" in entries.decode()
    assert len(fields.get_all("Classifier", [])) > 5
    assert fields["Keywords"]


def test_the_wheel_has_the_hash_of_the_same_code(built, tmp_path):
    with zipfile.ZipFile(built[0]) as wheel:
        wheel.extractall(tmp_path)
    assert code_hash(tmp_path / "sautereau") == code_hash(ROOT)


def test_the_release_is_described():
    """Citation and list of changes name the version and its date."""
    citation = dict(
        re.findall(r"(?m)^(version|date-released): (.+)$", (ROOT / "CITATION.cff").read_text())
    )
    assert citation["version"] == PROJECT["version"]
    newest = re.search(r"(?m)^## \[([\d.]+)\] - (.+)$", (ROOT / "CHANGELOG.md").read_text("utf-8"))
    assert newest
    assert newest.groups() == (citation["version"], citation["date-released"])


ON_CONDA_FORGE = {
    "matplotlib": "matplotlib-base", "isal": "python-isal", "nidaqmx": "nidaqmx-python",
}  # fmt: skip


def test_the_conda_recipe_has_the_names_bounds_and_entry_points_of_the_project():
    """Nothing builds it here."""
    text = (ROOT / "docs" / "conda" / "recipe.yaml").read_text(encoding="utf-8")
    recipe = yaml.safe_load(text)
    assert "NEVER built" in text
    assert recipe["context"]["version"] == PROJECT["version"]
    assert f">={recipe['context']['python_min']}" == PROJECT["requires-python"]
    needed = [Requirement(text) for text in PROJECT["dependencies"]]
    expected = {ON_CONDA_FORGE.get(one.name, one.name): one.specifier for one in needed}
    assert [one.extras for one in needed if one.extras] == [{"grpc"}]  # which is `grpcio`
    _, *run = recipe["requirements"]["run"]
    found = {one.name: one.specifier for one in map(Requirement, run) if one.name != "grpcio"}
    assert found == expected
    points = [f"{name} = {place}" for name, place in PROJECT["scripts"].items()]
    assert recipe["build"]["python"]["entry_points"] == points
    assert recipe["about"]["summary"] == PROJECT["description"]
    assert (ROOT / recipe["about"]["license_file"]).is_file()


def test_the_public_workflow_runs_commands_of_the_project():
    """On every Python that the project names. GitHub's schema and actionlint accept the file."""
    text = (ROOT / ".github" / "workflows" / "ci.yml").read_text(encoding="utf-8")
    jobs = yaml.safe_load(text)["jobs"]
    targets = re.search(r"(?m)^\.PHONY: (.*)$", (ROOT / "Makefile").read_text(encoding="utf-8"))
    assert targets
    said = r"Programming Language :: Python :: (3\.\d+)"
    named = set(re.findall(said, "\n".join(PROJECT["classifiers"])))
    assert named <= set(jobs["posix"]["strategy"]["matrix"]["python"])
    made = set()
    for step in (step for job in jobs.values() for step in job["steps"] if "run" in step):
        tool, *words = step["run"].split()
        if tool == "make":
            made |= {word for word in words if re.fullmatch(r"[a-z-]+", word)}
        for word in words:
            assert not word.startswith("tests/") or "." not in word or (ROOT / word).exists(), word
    assert {"test", "bounds", "docs", "dist"} <= made <= set(targets[1].split())
    for never in ("Windows", "macOS", "3.12", "3.13", "3.14"):
        assert never in text.partition("never run:")[2].partition("name: ci")[0]


def imported(path: Path) -> set[str]:
    """Return the top-level names of all modules that a file imports."""
    pattern = r"(?m)^ *(?:from (\w+)[\w.]* import|import (\w+)[\w.]*(?: as \w+)?$)"
    found = {a or b for a, b in re.findall(pattern, path.read_text(encoding="utf-8"))}
    return found - set(sys.stdlib_module_names) - {*ROOMS, "sautereau"}


def test_what_is_imported_is_required():
    """Every imported package is a requirement, or one of an extra."""
    brought_by = {
        "google": "protobuf", "PIL": "pillow", "serial": "pyserial", "skfem": "scikit-fem",
        "skimage": "scikit-image", "grpc": "nidaqmx", "session_pb2": "nidaqmx",
        "lvm_read": "lvm-read", "pydantic_core": "pydantic", "markupsafe": "jinja2",
    }  # fmt: skip
    texts = [*PROJECT["dependencies"], *(text for extra in EXTRAS.values() for text in extra)]
    required = {re.split(r"[^\w-]", text)[0].lower() for text in texts}
    for path in (p for room in (*ROOMS, "sautereau") for p in (ROOT / room).rglob("*.py")):
        needed = {brought_by.get(name, name).lower() for name in imported(path)}
        assert needed <= required, path


MISSING = {
    "live": "from sautereau.commands.live.foxglove import FoxgloveView; FoxgloveView('press')",
    "cluster": "from sautereau.analysis.campaign.workers import run_over;"
    " list(run_over(abs, [1], 'tcp://127.0.0.1:1'))",
    "report": "st.Session([]).report('page.html')",
    "tdms": "from sautereau.daq.convert.from_loggers import open_tdms; open_tdms('a.tdms')",
    "xarray": "st.Rig().sweep(overlap=...).to_xarray()",
    "photo": "from sautereau.analysis.results.outlined import outline; outline('a.png')",
}
"""What a user of each extra does."""


@pytest.mark.slow
def test_missing_extras_are_reported_with_their_command():
    """In one process, in which none of their packages can be imported."""
    texts = [text for extra in MISSING for text in EXTRAS[extra]]
    names = {"npTDMS": "nptdms", "scikit-image": "skimage"}
    blocked = [re.split(r"[^\w-]", text)[0] for text in texts]
    program = (
        f"import sys\nsys.modules |= dict.fromkeys({[names.get(n, n) for n in blocked]})\n"
        "import sautereau as st\nfrom sautereau.rig.errors import SautereauError\n"
        f"for use in {list(MISSING.values())}:\n"
        "    try: exec(use)\n"
        "    except SautereauError as error: print(error)\n"
    )
    messages = run(sys.executable, "-c", program, cwd=ROOT).splitlines()
    for extra, message in zip(MISSING, messages, strict=True):
        assert f"pip install 'sautereau[{extra}]'" in message


def test_all_has_every_extra_but_the_notebook():
    (everything,) = (Requirement(text) for text in EXTRAS["all"])
    assert everything.extras == EXTRAS.keys() - {"all", "notebook"}
    page = (ROOT / "docs" / "installation.md").read_text(encoding="utf-8")
    assert set(re.findall(r"(?m)^\| `([\w-]+)`", page)) == EXTRAS.keys()


STUDY = """
import json
from contextlib import redirect_stdout
from io import StringIO

from sautereau.commands.app import app

def result(words):
    with redirect_stdout(StringIO()) as printed:
        app(words.split(), exit_on_error=False)
    return json.loads(printed.getvalue())

if __name__ == "__main__":
    pressed = result("press --scene ideal -n 1 --out s --json")
    table = result("campaign . --out c.parquet --processes 2 --json")
    print(json.dumps([pressed, table]))
"""
"""Commands in one process of the installed wheel, with two more for the campaign."""
TRAPS = ("analysis", "robot", "daq", "commands", "rig", "trajectory", "sim_backend")
"""Modules of a user, in the folder where the commands run: to import one is an error."""


def site_packages(home: Path) -> Path:
    """Return the folder of packages of a virtual environment."""
    scheme = "nt" if sys.platform == "win32" else "posix_prefix"
    return Path(sysconfig.get_path("purelib", scheme, {"base": home, "platbase": home}))


def interpreter(home: Path) -> Path:
    return home / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")


def use_beside_other_modules(python: Path, folder: Path) -> None:
    """Run what users run, from a folder whose own modules have the names of our folders."""
    for name in TRAPS:
        (folder / f"{name}.py").write_text(f"raise ImportError('{name}.py of the user')")

    version = run(python, "-m", "sautereau", "--version", cwd=folder)
    assert version.strip() == PROJECT["version"]
    # -P: the program's own folder is not searched, as for the script `robot`.
    program = "from robot import run_cli; import sautereau.rig as rig; print(rig.__file__)"
    where = run(python, "-P", "-c", program, cwd=folder)
    assert Path(where.strip()).is_relative_to(python.parents[1])
    (folder / "study.py").write_text(STUDY)
    pressed, table = json.loads(run(python, "study.py", cwd=folder))
    for press in pressed["presses"]:
        assert press["release"] - press["contact"] == pytest.approx(0.02, abs=1e-4)
    assert table["presses"] == 2  # one of them the warm-up press, which the table marks
    assert (folder / "c.parquet").is_file()


@pytest.mark.slow
def test_the_wheel_works_beside_robotframework_and_modules_of_the_same_names(built, tmp_path):
    """In an environment that takes from the running one its dependencies, but not this code."""
    home, elsewhere = tmp_path / "venv", tmp_path / "elsewhere"
    elsewhere.mkdir()
    venv.create(home, symlinks=sys.platform != "win32")
    packages = site_packages(home)
    with zipfile.ZipFile(built[0]) as wheel:
        wheel.extractall(packages)
    # A folder named in a .pth file has its own .pth files ignored: no editable install gets in.
    shared = [path for path in sys.path if path.endswith("site-packages")]
    (packages / "shared.pth").write_text("\n".join(shared))
    use_beside_other_modules(interpreter(home), elsewhere)


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_an_empty_environment_presses_from_another_folder(built, tmp_path):
    home, elsewhere = tmp_path / "venv", tmp_path / "elsewhere"
    elsewhere.mkdir()
    venv.create(home, with_pip=True)
    python = interpreter(home)
    install = (python, "-m", "pip", "install", "--quiet")
    wheel = f"sautereau[report] @ {built[0].as_uri()}"
    run(*install, wheel, "robotframework>=7,<8", cwd=elsewhere)
    run(python, "-m", "pip", "check", cwd=elsewhere)
    use_beside_other_modules(python, elsewhere)
    tool = python.with_name("sautereau")
    assert run(tool, "--version", cwd=elsewhere).strip() == PROJECT["version"]
    recording, words = "s/press-0001.mcap", ("--since", "60 ms", "--until", "70 ms")
    fit = ("--free", "plectrum.overlap", "--starts", "1", "--json")
    found = json.loads(run(tool, "identify", recording, *fit, cwd=elsewhere))
    assert found["fits"]
    run(tool, "report", "s", "--out", "report.html", cwd=elsewhere)
    run(tool, "animate", recording, "--out", "pluck.gif", *words, cwd=elsewhere)
    run(tool, "listen", "--out", "pluck.wav", "--duration", "100 ms", cwd=elsewhere)
    run(tool, "plan", "--plot", "plan.png", "--bench", "bench.svg", cwd=elsewhere)
    made = {path.name for path in elsewhere.iterdir()}
    assert {"report.html", "pluck.gif", "pluck.wav", "plan.png", "bench.svg"} <= made
