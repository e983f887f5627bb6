"""The four modes of the spring string, in sequence."""

import pytest

from sautereau.analysis.model.choirs import choirs
from sautereau.rig.load import load_rig, with_values
from sautereau.sim_backend.errors import SceneError
from sautereau.sim_backend.physics.events import PluckEvents
from sautereau.sim_backend.physics.rigid.pluck import Plucking
from sautereau.sim_backend.scene import load_scene

RIG = load_rig("paper")
CLEARANCE = RIG.jack.string_clearance * 1e3


def string(rig=RIG, number=0, **changes):
    scene = load_scene("return").model_copy(update=changes)
    return Plucking(choirs(rig)[number], scene, number, PluckEvents())


def force(plucking, rise):
    return plucking.force(rise, rise, 0.0, 0.0)


def test_a_reversal_before_the_release_is_no_event():
    plucking = string()
    plucking.cross(True, 1.0)
    plucking.cross(False, 2.0)
    plucking.cross(True, 3.0)
    assert [e.time for e in plucking.events.contacts] == [1, 3]
    assert plucking.events.releases == plucking.events.returns == []


def test_a_reversal_on_the_tongue_is_no_return():
    plucking = string()
    for upwards in (True, True, False, True):
        plucking.cross(upwards, 1.0)
    assert force(plucking, CLEARANCE + 0.1) == 0
    assert plucking.events.returns == []
    plucking.cross(False, 2.0)
    plucking.cross(False, 3.0)
    assert [e.time for e in plucking.events.returns] == [3]


def test_without_a_tongue_the_return_is_at_the_contact_height():
    plucking = string(tongue=False)
    for upwards, time in ((True, 1.0), (True, 2.0), (False, 3.0)):
        plucking.cross(upwards, time)
    assert plucking.high == CLEARANCE
    assert [(e.time, e.force) for e in plucking.events.returns] == [(3.0, 0.0)]


def test_a_choir_without_a_pluck_is_named():
    rig = load_scene("two-choirs").true_rig(RIG)
    rig = with_values(rig, {"more_choirs.0.plectrum.overlap": "4.49999 mm"})
    with pytest.raises(SceneError, match=r"more_choirs\[0\]\.plectrum"):
        string(rig, 1)
