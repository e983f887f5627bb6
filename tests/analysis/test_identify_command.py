"""From recordings on disk to a rig file with the identified values."""

import json
from importlib import resources

import pytest

from benchmarks.simulated import acquired
from sautereau.commands.app import app
from sautereau.rig.load import load_rig
from sautereau.sim_backend.physics.observation import observe
from sautereau.sim_backend.scene import load_scene
from tests.sessions import SessionWriter


@pytest.fixture(scope="module")
def recordings(tmp_path_factory):
    """Two recordings of a bench whose overlap and inertia are not those of its rig."""
    truth = {"plectrum.overlap": "0.33 mm", "key.inertia": "9e-4 kg m^2"}
    # With the scene's own steps the force is 20 us late, which is an error of the model.
    scene = load_scene("paper").model_copy(update={"truth": truth, "step": 50e-6})
    out, rig = tmp_path_factory.mktemp("recordings"), load_rig()
    rig = rig.model_copy(update={"assumed": {}})  # whose experimenter has measured all of it
    seen, paths = observe(rig, scene), []
    for number in (1, 2):
        write = SessionWriter(acquired(rig, scene, seen, number)[0])
        paths += write(out, 1, first=number, noise=0.0)
    return paths


def run(capsys, *words):
    status = app([*map(str, words)], exit_on_error=False, print_error=False)
    return status, capsys.readouterr().out


@pytest.mark.slow
def test_identify_writes_a_rig_that_compare_agrees_with(recordings, tmp_path, capsys):
    rig, picture = tmp_path / "found.toml", tmp_path / "fit.png"
    free = "plectrum.bending_stiffness,plectrum.overlap,key.inertia,key.gravity_moment"
    status, out = run(
        capsys, "identify", *recordings, "--free", free, "--starts", 1, "--out", rig,
        "--plot", picture, "--json",
    )  # fmt: skip
    assert status == 0
    found = json.loads(out)
    for name, true in (("plectrum.overlap", 0.33e-3), ("key.inertia", 9e-4)):
        assert found["parameters"][name]["value"] == pytest.approx(true, rel=0.03)
        low, high = found["parameters"][name]["ci95"]
        assert low < high
        assert set(found["correlation"]) == set(found["parameters"])
    assert found["simulated"]
    assert found["fits"]
    assert set(found["written"]) == {
        "plectrum.youngs_modulus", "plectrum.overlap", "key.inertia"
    }  # fmt: skip
    assert picture.stat().st_size > 1000
    content = rig.read_bytes()
    again = "identify", *recordings, "--free", free, "--starts", 1, "--out", rig
    assert run(capsys, *again)[0] == 0  # killed just after it had written the file
    assert rig.read_bytes() == content
    written = load_rig(rig)
    overlap = found["parameters"]["plectrum.overlap"]
    assert written.plectrum.overlap == pytest.approx(overlap["value"], abs=overlap["std"] / 20)
    assert written.key.gravity_moment == load_rig().key.gravity_moment
    assert written.sources["key.inertia"].startswith("identified from SIMULATED press-")
    low, high = written.assumed["key.inertia"]
    inertia = found["parameters"]["key.inertia"]
    assert high - low == pytest.approx(2 * 3**0.5 * inertia["std"], abs=inertia["std"] / 10)
    errors = []
    for extra in ((), ("--rig", rig)):
        _, out = run(capsys, "compare", *recordings, "--json", *extra)
        compared = json.loads(out)
        errors.append(abs(compared["duration_error"]["value"]))
        assert compared["features"]["pluck_duration"]["unit"] == "s"
    assert errors[0] > 0.05
    assert errors[1] < 0.02


@pytest.mark.slow
def test_a_rig_file_keeps_its_comments_and_profiles_are_reported(recordings, tmp_path, capsys):
    rig = tmp_path / "mine.toml"
    paper = resources.files("sautereau.rig").joinpath("paper.toml").read_text()
    rig.write_text("# of my own\n" + paper)
    free = "plectrum.overlap,key.inertia"
    status, out = run(
        capsys, "identify", recordings[0], "--free", free, "--out", rig, "--force", "--starts", 1,
        "--profile",
    )  # fmt: skip
    assert status == 0
    assert "key.inertia: 95 % by profile likelihood:" in out
    assert "all parameters are identifiable from these recordings" in out
    assert f"rig: {rig}, with plectrum.overlap, key.inertia" in " ".join(out.split())
    assert rig.read_text().startswith("# of my own\n# The bench of the paper")
    sources = load_rig(rig).sources
    assert sources["plectrum.overlap"] == sources["key.inertia"]
    assert sources["key.inertia"].startswith("identified from SIMULATED press-0001.mcap on ")
