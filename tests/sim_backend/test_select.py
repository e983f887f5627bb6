import math
import sys

import numpy as np
import pytest

from sautereau.rig.instrument import Choir
from sautereau.rig.load import load_rig
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.events import Motions, PluckEvents, StringEvent
from sautereau.sim_backend.physics.observation import Observation, errors
from sautereau.sim_backend.scene import load_scene, parse_scene
from sautereau.sim_backend.trade.refinement import DIVERGED, StepRefinement
from sautereau.sim_backend.trade.select import best_models, select_solver

PERIOD = load_rig().controller.sample_period
PUSH = '[push]\nforce = "1.2 N"\nduration = "40 ms"\n'


def scene(engine="auto", string="spring", plectrum="elastica", want='accuracy = "10 us"'):
    return parse_scene(
        f"""
        finger = "push"
        engine = "{engine}"
        plectrum = "{plectrum}"
        string = "{string}"
        friction = false
        felt = false
        {want}
        {PUSH}
        """
    )


def events_at(contact, release, force=0.5, steps=2):
    still = np.zeros(steps + 1)
    time = np.linspace(contact, release, steps + 1)
    motions = Motions(time, still, still, still, still + 1.2, still, still)
    return Observation(
        motions, PluckEvents([StringEvent(contact, 0, 0.0)], [StringEvent(release, 0, force)])
    )


class Toy:
    """Engines of second order with known errors, and a spring string with an error of its own."""

    rigid, exact, spring = 20.0, 0.5, 30e-6

    def __init__(self, exact=True):
        self.has_exact = exact
        self.runs = []

    def __call__(self, rig, scene, drive):
        self.runs.append(scene)
        own = self.spring if scene.string == "spring" else 0.0
        return events_at(0.01, 0.014 + own + self.error(scene))

    def solve(self, rig, scene, drive):
        return events_at(0.01, 0.014 + self.spring)

    def error(self, scene):
        return getattr(self, scene.engine) * scene.step**2


def toy_selected(toy, scene):
    return select_solver(load_rig(), scene, observe=toy, solve=toy.solve if toy.has_exact else None)


@pytest.mark.parametrize("order", [1.0, 2.0, 4.0])
def test_an_estimate_is_never_below_the_error(order):
    refinement = StepRefinement(
        lambda n: events_at(0.01, 0.02 + 1e-3 * n**-order), 1, 1 << 20, PERIOD
    )
    for level in range(6):
        true = 1e-3 * refinement.steps(level) ** -order
        assert true <= refinement.estimate(level).time <= 2 * true + 1.1e-8


def test_events_that_depend_on_the_step_have_no_estimate():
    def observe(n):
        found = events_at(0.01, 0.02)
        if n == 4:
            found.events.releases.clear()
        return found

    assert StepRefinement(observe, 1, 64, PERIOD).estimate(0) == DIVERGED
    assert StepRefinement(observe, 8, 64, PERIOD).estimate(0).time < 2e-8


def test_a_diverging_step_has_no_estimate_and_the_reason_is_reported():
    def observe(n):
        if n < 4:
            raise SceneError(f"{n} steps diverge")
        return events_at(0.01, 0.02)

    assert StepRefinement(observe, 1, 64, PERIOD).estimate(0) == DIVERGED
    with pytest.raises(SceneError, match="1 steps diverge"):
        StepRefinement(lambda n: observe(1), 1, 64, PERIOD).estimate(0)


@pytest.mark.parametrize("parts", [1, 2, 3, 7, 32])
@pytest.mark.parametrize("first", [1, 4])
def test_a_step_that_the_engine_divides_is_refined_until_it_is_shorter(first, parts):
    """A step of the sample over n is divided into the parts that a stiff contact needs."""

    def steps(n):
        return n * math.ceil(parts / n)

    def observe(n):
        samples = round(0.01 / PERIOD)
        return events_at(0.01, 0.01 + samples * PERIOD + error(n), steps=samples * steps(n))

    def error(n):
        return 1e-4 * steps(n) ** -2

    found = StepRefinement(observe, first, 1 << 20, PERIOD).estimate(0)
    assert error(first) <= found.time <= 2 * error(first) + 1.1e-8


def test_a_step_that_is_divided_into_too_many_parts_has_no_estimate():
    refinement = StepRefinement(lambda n: events_at(0.01, 0.02, steps=1000), 1, 64, PERIOD)
    assert refinement.estimate(0) == DIVERGED
    assert refinement.estimate(4).time < 2e-8


def test_a_servo_is_as_accurate_as_its_encoders():
    rig, toy = load_rig(), Toy()
    toy.error = lambda scene: 0.0
    paper = load_scene("paper").model_copy(update={"step": PERIOD, "accuracy": None})
    found = toy_selected(toy, paper).errors
    half = rig.arm.resolution / 2
    speed = rig.press.jack_speed * rig.key.press_arm / rig.key.jack_arm
    assert found.time == pytest.approx(half / speed, abs=2e-8)
    pluck = toy(rig, paper, None).events
    held = pluck.releases[0].time - pluck.contacts[0].time
    assert found.force == pytest.approx(half / speed / held, abs=2e-5)
    ideal = paper.model_copy(update={"finger": "ideal", "servo": None})
    assert toy_selected(toy, ideal).errors.time < 2e-8


def test_a_blow_before_a_pluck_does_not_hide_the_error_of_its_force():
    def pluck(blow, held):
        found = events_at(0.01, 0.02, steps=10)
        found.motions.finger_force[:] = held
        found.motions.finger_force[0] = blow
        return found

    for blow in (1.2, 1000.0):
        found = errors(pluck(blow, 1.3), pluck(blow, 1.2))
        assert found.force == pytest.approx(0.1 / 1.2)


@pytest.mark.parametrize("exact", [True, False])
@pytest.mark.parametrize("want", ["1 us", "10 us", "100 us"])
def test_the_longest_step_of_the_cheapest_engine_is_selected(want, exact):
    toy = Toy(exact)
    selected = toy_selected(toy, scene(want=f'accuracy = "{want}"'))
    asked, taken = selected.asked.time, selected.scene
    assert taken.engine == "exact"
    assert taken.accuracy is None
    assert toy.error(taken) <= selected.errors.time <= asked
    longer = taken.model_copy(update={"step": 2 * taken.step})
    assert taken.step == PERIOD or (1 if exact else 2) * toy.error(longer) > asked - 1e-8


@pytest.mark.parametrize(("name", "engine"), [("numba", "rigid"), ("no_such", "exact")])
def test_without_numba_the_rigid_bodies_are_cheaper(monkeypatch, name, engine):
    """In steps of both engines that are equally accurate."""
    monkeypatch.setitem(sys.modules, name, None)
    toy = Toy()
    toy.rigid = toy.exact
    assert toy_selected(toy, scene(want='accuracy = "10 us"')).scene.engine == engine


def test_a_coincidence_is_no_accuracy():
    toy = Toy()
    toy.error = lambda scene: 0.0 if scene.step > 0.9 * PERIOD else 10 * scene.step**2
    selected = toy_selected(toy, scene(want='accuracy = "1 us"'))
    assert selected.scene.step <= PERIOD / 2
    assert toy.error(selected.scene) <= 1e-6


def test_explicit_choices_are_kept():
    toy = Toy()
    selected = toy_selected(toy, scene("rigid", "spring", "rods"))
    taken = selected.scene
    assert (taken.engine, taken.string, taken.plectrum) == ("rigid", "spring", "rods")
    assert {run.engine for run in toy.runs} == {"rigid"}


@pytest.mark.parametrize(("want", "string"), [("10 us", "modal"), ("100 us", "spring")])
def test_a_spring_string_is_selected_where_its_own_error_allows(want, string):
    found = toy_selected(Toy(), scene("auto", "auto", "auto", f'accuracy = "{want}"'))
    assert found.scene.string == string
    assert found.scene.engine == ("rigid" if string == "modal" else "exact")
    assert found.scene.plectrum == "elastica"


def test_a_carved_plectrum_needs_finite_elements():
    rig = load_rig()
    carved = rig.replaced({"plectrum.outline": "an outline"})
    auto = scene("auto", "auto", "auto", 'accuracy = "10 us"')
    assert [best_models(each, auto).plectrum for each in (rig, carved)] == ["elastica", "fe"]


def test_a_carved_plectrum_of_the_second_string_is_not_taken_for_a_bar():
    rig = load_rig()
    carved = rig.plectrum.model_copy(update={"outline": "an outline"})
    second = Choir.model_construct(jack_arm=0.2, jack=rig.jack, plectrum=carved, string=rig.string)
    both = rig.model_copy(update={"more_choirs": (second,)})
    auto = scene("auto", "auto", "auto", 'accuracy = "10 us"')
    assert best_models(both, auto).plectrum == "auto"  # of each string its own


@pytest.mark.parametrize("exact", [True, False])
def test_an_accuracy_out_of_reach_is_refused_with_the_best_one(exact):
    toy = Toy(exact)
    toy.rigid = 1e8
    with pytest.raises(SceneError, match=r"1 us is out of reach.*events to .* us.*ask for"):
        toy_selected(toy, scene("rigid", want='accuracy = "1 us"'))


def test_a_step_given_is_kept_and_estimated():
    toy = Toy()
    selected = toy_selected(toy, scene("rigid", want='step = "100 us"'))
    assert selected.scene.step == PERIOD / 10
    assert toy.error(selected.scene) <= selected.errors.time
    assert selected.asked is None


def test_equal_neighbouring_results_do_not_hide_an_error():
    error = {1: 0.8e-6, 2: 0.5e-6, 4: 0.5e-6, 8: 0.1e-6}
    refinement = StepRefinement(
        lambda n: events_at(0.01, 0.02 + error.get(n, 0.0)), 1, 1 << 20, PERIOD
    )
    for level in range(3):
        assert error[refinement.steps(level)] <= refinement.estimate(level).time


def test_levels_that_agree_by_coincidence_do_not_hide_an_error():
    error = {1: 2e-6, 2: -2e-6, 4: 1.5e-6, 8: 1.9e-6}
    refinement = StepRefinement(lambda n: events_at(0.01, 0.02 + error[n]), 1, 8, PERIOD)
    assert error[1] <= refinement.estimate(0).time


@pytest.mark.parametrize("engine", ["exact", "rigid"])
def test_a_push_shorter_than_a_step_has_a_claim(engine):
    """It divides the step in which it ends; the engine did not divide it for its stiffness."""
    push = scene(engine, want='step = "100 us"').push.model_copy(update={"duration": 1e-9})
    pushed = scene(engine, want='step = "100 us"').model_copy(update={"push": push})
    assert select_solver(load_rig(), pushed).errors.time < 1e-6
