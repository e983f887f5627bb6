"""A survey of keys: predictions and recordings of each, and the evenness over the compass."""

import json

import numpy as np
import pytest

from benchmarks.campaign import cluster, write_presses
from sautereau.analysis.errors import AnalysisError
from sautereau.analysis.model.predict import predict
from sautereau.analysis.results.survey import EVEN, FELT, survey
from sautereau.analysis.session.analysed import analyse_file
from sautereau.rig.instrument import Choir, Outline
from sautereau.rig.keys import InstrumentKey
from sautereau.rig.load import load_rig, with_values
from tests.budget import amount, least


def instrument(count=25, uneven=None, random=0.01):
    """Return keys whose overlap falls smoothly over the compass, with some scatter."""
    noise = np.random.default_rng(5).normal(0, random, count)
    keys = []
    for k in range(count):
        overlap = 0.28e-3 * np.exp(-0.01 * k + noise[k]) * (uneven or {}).get(k, 1.0)
        rig = with_values(load_rig(), {"plectrum.overlap": f"{overlap} m"})
        keys.append(InstrumentKey(f"k{k}", rig))
    return keys


@pytest.fixture(scope="module")
def found():
    return survey(instrument(uneven={3: 1.25, 16: 0.8}))


def of(found, name, source="predicted", string=1):
    return next(e for e in found.evenness if (e.name, e.source, e.string) == (name, source, string))


def test_every_key_is_predicted_as_alone(found):
    one = found.keys[7]
    rig = instrument(uneven={3: 1.25, 16: 0.8})[7].rig
    alone = predict(rig)
    assert one.predicted["release_force"] == pytest.approx(alone.release_force, rel=1e-9)
    assert one.predicted["release_lift"] == pytest.approx(alone.release_lift, rel=1e-9)
    assert one.predicted["v_osc"] == pytest.approx(alone.v_osc, rel=1e-9)
    assert one.measured == {}


def test_uneven_keys_are_found_and_by_how_much(found):
    exact = survey(instrument(random=0.0))
    force = of(found, "force_drop")
    assert set(force.outliers) == {"k3", "k16"}
    for k, key in enumerate(exact.keys):
        true = found.keys[k].predicted["force_drop"] / key.predicted["force_drop"] - 1
        assert force.deviations[f"k{k}"] == pytest.approx(true, abs=0.02)
    assert abs(force.deviations["k3"]) > FELT < abs(force.deviations["k16"])
    assert force.per_key == pytest.approx(of(exact, "force_drop").per_key, abs=2e-3)
    assert of(exact, "force_drop").outliers == ()


def test_a_quantity_that_changes_smoothly_does_not_deviate():
    """The overlap falls exponentially, so that the logarithm of the work is nearly straight."""
    even = of(survey(instrument(random=0.0)), "held_work")
    assert max(map(abs, even.deviations.values())) < 0.01


def compass(rng, count=61):
    """Return keys over five octaves with carved plectra, and which one is cut twice as deep.

    Strings and plectra change smoothly over the compass; depth, overlap and thickness scatter.
    """
    base, at, x = load_rig(), np.arange(count) / count, np.linspace(0, 4.5e-3, 31)
    length = 1.6 * (1 - 0.9 * at) ** 1.2 + 0.1
    tension, point = 60 + 15 * rng.uniform(-1, 1) * at, (0.15 + 0.15 * at) * length
    scatter = rng.uniform(0.5, 1.5) * np.array([[0.1], [0.03], [0.01]])
    scatter = np.exp(scatter * rng.standard_normal((3, count)))
    depth = rng.uniform(0.1e-3, 0.16e-3) * (1 + rng.uniform(-0.3, 0.3) * at) * scatter[0]
    overlap = rng.uniform(0.25e-3, 0.32e-3) * (1 + rng.uniform(-0.2, 0.2) * at) * scatter[1]
    thickness, twice = 0.48e-3 * scatter[2], int(rng.integers(count))
    depth[twice] = min(2 * depth[twice], 0.34e-3)
    keys = []
    for k in range(count):
        cut = depth[k] * np.clip((x / x[-1] - 0.4) / 0.6, 0, 1) ** 1.5
        top = np.full(len(x), thickness[k] / 2)
        named = {"x": x, "top": top, "bottom": cut - top}
        outline = Outline.model_construct(**{n: tuple(v.tolist()) for n, v in named.items()})
        plectrum = base.plectrum.outlined(outline).model_copy(update={"overlap": overlap[k]})
        values = {"tension": tension[k], "length": length[k], "plucking_point": point[k]}
        string = base.string.model_copy(update=values | {"frequency": 60 * 32 ** at[k]})
        rig = base.model_copy(update={"plectrum": plectrum, "string": string})
        keys.append(InstrumentKey(f"k{k}", rig))
    return keys, f"k{twice}"


@pytest.mark.slow
@pytest.mark.timeout(1800)
def test_a_plectrum_cut_twice_as_deep_is_an_outlier():
    """At least 95 % of those are; of the other keys at most 2 %."""
    tables, hits, false, others = amount(6, 24), 0, 0, 0
    for seed in range(tables):
        keys, twice = compass(np.random.default_rng(seed))
        outliers = {k for e in survey(keys, level="elastica").evenness for k in e.outliers}
        hits += twice in outliers
        false += len(outliers - {twice})
        others += len(keys) - 1
    assert hits >= 0.95 * tables
    assert others - false >= least(0.98, others)


@pytest.mark.slow
def test_a_cluster_gives_the_same(tmp_path):
    (paths,) = (list(own) for own in _by_folder(write_presses(tmp_path, 1, 1, 2)))
    keys, recordings = instrument(6), {"k2": paths}
    with cluster(1) as (address, _):
        there = survey(keys, recordings, where=address)
    assert there.document == survey(keys, recordings).document


def test_few_keys_have_no_outliers():
    found = survey(instrument(4, {2: 1.3}))
    assert of(found, "force_drop").outliers == ()
    assert of(found, "force_drop").per_key is None
    assert "force drop: no slope and no outliers below 5 keys" in str(found)


def test_results_as_json_lines_table_and_figure(found, tmp_path):
    document = json.loads(json.dumps(found.document, allow_nan=False))
    assert len(document["keys"]) == 25
    assert {each["name"] for each in document["evenness"]} == set(EVEN)
    lines = found.lines()
    assert any(line.startswith("force drop") and "k3 " in line for line in lines)
    frame = found.to_frame()
    deviation = frame.loc[("k3", 1, "force_drop"), "predicted_deviation"]
    assert deviation == pytest.approx(of(found, "force_drop").deviations["k3"])
    figure = found.plot()
    figure.savefig(tmp_path / "survey.png")
    assert any(text.get_text() == "k3" for text in figure.axes[1].texts)


def test_a_key_without_a_solution_is_said_and_the_others_stay():
    keys = instrument(6)
    bad = with_values(keys[2].rig, {"plectrum.thickness": "3 mm", "plectrum.overlap": "2 mm"})
    keys[2] = InstrumentKey("bad", bad)
    found = survey(keys)
    assert len(found.warnings) == 1
    assert found.warnings[0].startswith("bad: ")
    assert "bad" not in of(found, "force_drop").deviations
    assert found.lines()
    with pytest.raises(AnalysisError, match="no key has a result"):
        survey(keys[2:3])


def test_recordings_are_read_beside_the_prediction(tmp_path):
    paths = [list(own) for own in _by_folder(write_presses(tmp_path, 3, 1, 2))]
    keys = [InstrumentKey(f"k{k}", analyse_file(own[0]).press.rig) for k, own in enumerate(paths)]
    (tmp_path / "broken.mcap").write_bytes(b"no recording")
    paths[1].append(tmp_path / "broken.mcap")
    found = survey(keys, {key.name: own for key, own in zip(keys, paths, strict=True)})
    assert found.simulated
    assert found.lines()[0].startswith("SIMULATED")
    said = [warning.split(":")[0] for warning in found.warnings]
    assert said == ["k1", "release force and work"]
    for each, own in zip(found.keys, paths, strict=True):
        drop = each.measured["force_drop"]
        presses = [analyse_file(path).features["force_drop"] for path in own[:2]]
        assert drop.value == pytest.approx(np.mean(presses))
        assert drop.low is not None
        assert drop.high is not None
        assert drop.low < drop.value < drop.high
        assert drop.value == pytest.approx(each.predicted["force_drop"], rel=0.05)
    assert set(of(found, "force_drop", "measured").deviations) == {key.name for key in keys}


def _by_folder(paths):
    folders = {}
    for path in paths:
        folders.setdefault(path.parent, []).append(path)
    return folders.values()


def test_every_string_has_its_own_evenness(paper):
    choir = Choir.model_construct(
        jack_arm=0.225,
        jack=paper.jack.model_copy(update={"string_clearance": 4e-3}),
        plectrum=paper.plectrum.model_copy(update={"overlap": 0.2e-3}),
        string=paper.string,
    )
    two = InstrumentKey("two", paper.model_copy(update={"more_choirs": (choir,)}))
    found = survey([InstrumentKey("one", paper), two])
    assert [(e.key, e.string) for e in found.keys] == [("one", 1), ("two", 1), ("two", 2)]
    assert set(of(found, "force_drop", string=2).deviations) == {"two"}
