"""The uncertainties that are expected before any press, against fits and closed forms."""

import json

import numpy as np
import pytest

import sautereau as st
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.identify.elastic import Mode
from sautereau.analysis.identify.forecast import (
    Planned,
    WhiteNoise,
    forecast,
    planned_press,
    together,
)
from sautereau.analysis.model.predict import predict
from sautereau.analysis.phases import find_phases
from sautereau.commands.app import app
from sautereau.rig.instrument import KeyMode
from sautereau.rig.load import load_rig, with_values
from sautereau.trajectory.errors import TrajectoryError

OVERLAP, INERTIA, STIFFNESS = "plectrum.overlap", "key.inertia", "plectrum.bending_stiffness"
NAMES = [STIFFNESS, OVERLAP, INERTIA]
MEASURED = load_rig().model_copy(update={"assumed": {}})


@pytest.fixture(scope="module", autouse=True)
def one_instrument():
    """Compute with one instrument, which is quick."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr("sautereau.analysis.identify.forecast.DRAWS", 1)
        yield


@pytest.fixture(scope="module")
def measured():
    """Return what a press of a rig without ranges says, of its own instrument."""
    return next(forecast(MEASURED, NAMES, [Planned(0.072), Planned(0.072, muted=True)]))


@pytest.fixture(scope="module")
def paper():
    return st.Rig().plan().expected(NAMES)


def test_the_planned_press_is_that_of_the_model():
    press, own = planned_press(MEASURED, MEASURED, WhiteNoise(1e-6, 1e-9)), predict(MEASURED)
    (pluck,) = find_phases(press).plucks
    assert pluck.pluck_duration == pytest.approx(own.pluck_duration, rel=0.01)
    assert pluck.release_force == pytest.approx(own.release_force, rel=0.01)
    assert press.samples["jack_speed"].max() == pytest.approx(MEASURED.press.jack_speed, rel=0.01)


def test_the_noise_is_white_and_has_its_size():
    quiet, loud = (
        planned_press(MEASURED, MEASURED, WhiteNoise(*noise)).samples
        for noise in ((1e-9, 1e-12), (4e-3, 2e-5))
    )
    for name, size in (("force", 4e-3), ("velocity", 2e-5)):
        noise = loud[name] - quiet[name]
        assert noise.std() == pytest.approx(size, rel=0.05)
        assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.05


def test_a_stiff_mode_follows_the_force_at_the_laser():
    """Far above the press's frequencies: r (p F - u b N) / (I w^2), F and N of the rigid key."""
    mode, key, quiet = Mode(2000.0, 0.5, 1.5, -0.6, -0.6), MEASURED.key, WhiteNoise(1e-12, 1e-15)
    bent, stiff = (planned_press(MEASURED, MEASURED, quiet, m) for m in ([mode], []))
    (pluck,) = find_phases(stiff).plucks
    held = stiff.between(pluck.contact + 3e-3, pluck.release - 1e-3)
    angle = (bent.samples["angle"] - stiff.samples["angle"])[held]
    own = predict(MEASURED)
    string = np.interp(stiff.samples["jack_rise"][held], own.rise, own.string_force)
    damper = MEASURED.jack.damper  # which pushes the jack at rest
    inertia = key.inertia + MEASURED.jack.mass * key.jack_arm**2
    force = stiff.samples["force"][held] - stiff.samples["force"][0]
    moment = key.press_arm * force - mode.jack_by_finger * key.jack_arm * (
        string + damper.stiffness * damper.lift
    )
    static = mode.weight * moment / (inertia * (2 * np.pi * mode.frequency) ** 2)
    np.testing.assert_allclose(angle, static, rtol=0.05)


def test_a_rig_with_modes_is_that_of_a_compliant_key():
    key = MEASURED.key.model_copy(
        update={"modes": (KeyMode.model_construct(
            frequency=180.0, frequency_std=2.0, damping=0.02, damping_std=0.01),)}
    )  # fmt: skip
    soft = MEASURED.model_copy(update={"key": key})
    found = []
    for rig in (MEASURED, soft):
        problem, data = next(forecast(rig, NAMES, [Planned(0.036)]))
        known, names = together(problem, data, [3]), [p.name for p in problem.free]
        found.append(known.std(names.index(INERTIA)))
    assert "offset.mode0.frequency" in names
    assert found[1] > 2 * found[0]


def test_muted_presses_say_nothing_of_the_plectrum(measured):
    problem, data = measured
    known = together(problem, data, (0, 3))
    names = [p.name for p in problem.free]
    assert not np.isfinite(known.std(names.index(OVERLAP)))
    assert np.isfinite(known.std(names.index(INERTIA)))


def test_the_noises_part_falls_with_the_root_of_the_number_of_presses(measured):
    """Without priors, of the data alone."""
    problem, data = measured
    few, many = (together(problem, data, (n, 0)) for n in (1, 100))
    shown = [k for k, p in enumerate(problem.free) if not p.hidden]
    blocks = [known.data.T @ known.data for known in (few, many)]
    np.testing.assert_allclose(blocks[1], 100 * blocks[0], atol=1e-6 * blocks[1].max())
    assert (many.stds[shown] < few.stds[shown]).all()
    np.testing.assert_array_equal(few.prior, many.prior)


def test_choices_are_ranked_and_more_presses_are_never_worse(paper):
    sizes = [np.mean([np.log(c.stds[n]) for n in NAMES]) for c in paper.choices]
    assert sizes == sorted(sizes)
    stds = {c.what: c.stds for c in paper.choices}
    for name in NAMES:
        assert stds["12 presses"][name] < stds["3 presses as planned"][name]
        assert stds["measure jack.mass"][name] <= stds["3 presses as planned"][name] * (1 + 1e-9)
    parts = {p.name: p for p in paper.parameters}
    assert parts[INERTIA].std == pytest.approx(
        np.hypot(parts[INERTIA].std_noise, parts[INERTIA].std_inputs), rel=0.01
    )


@pytest.mark.slow
def test_quieter_sensors_and_priors_leave_less():
    plan = st.Rig(with_values(load_rig(), {"press.jack_speed": "0.05 m/s"})).plan()
    plain = plan.expected([INERTIA], presses=2, speeds=["0.06 m/s"])
    quiet = plan.expected([INERTIA], presses=2, speeds=["0.06 m/s"], force_noise="1 mN")
    prior = f"{INERTIA}=7e-4 kg m^2 +- 1e-6 kg m^2"
    known = plan.expected([INERTIA], [prior], presses=2, speeds=["0.06 m/s"])
    (one,), (two,), (three,) = plain.parameters, quiet.parameters, known.parameters
    assert two.std_noise < one.std_noise
    assert three.std == pytest.approx(1e-6, rel=0.01)
    assert [c.what for c in plain.choices].count("2 at 0.06 m/s") == 1


def test_what_cannot_be_is_refused_or_named():
    plan = st.Rig().plan()
    with pytest.raises(AnalysisError) as raised:
        plan.expected([INERTIA], presses=0, force_noise="5 mm", velocity_noise="0 m/s")
    assert all(name in str(raised.value) for name in ("presses", "force_noise", "velocity_noise"))
    with pytest.raises(AnalysisError, match="inertja"):
        plan.expected(["key.inertja"])
    fast = plan.expected([INERTIA], speeds=["3 m/s"])
    assert "3 m/s" in fast.warnings[0]
    with pytest.raises(TrajectoryError):
        st.Rig(with_values(load_rig(), {"arm.speed_limit": "0.01 rad/s"})).plan().expected(
            [INERTIA]
        )


def test_text_json_table_figure_and_command_line_have_the_same(paper, tmp_path, capsys):
    def run(*words):
        status = app([*map(str, words)], exit_on_error=False, print_error=False)
        return status, capsys.readouterr()

    picture = tmp_path / "expected.png"
    words = ("plan", "paper", "--identify", ",".join(NAMES), "--plot", picture, "--json")
    status, printed = run(*words)
    assert status == 0
    found = json.loads(printed.out)
    assert found["choices"] == json.loads(json.dumps(paper.document["choices"]))
    assert picture.stat().st_size > 1000
    assert list(paper.to_frame().columns) == NAMES
    assert str(paper).count("as planned") == 1
    assert run("plan", "paper", "--speed", "0.1 m/s")[0] == 2
    assert run("plan", "paper", "--identify", INERTIA, "--out", tmp_path / "a.json")[0] == 2
