"""What a viewer draws of a press is what was planned, and what the recording has."""

import numpy as np
import pytest

from sautereau.daq.file.recorded import Joints
from sautereau.daq.file.recording import Block, Recording, SessionInfo
from sautereau.rig.load import load_rig
from sautereau.robot.experiment.drawing import JACK, draw
from sautereau.trajectory.press import plan_press
from tests.daq.declared import messages


def test_arm_key_and_jack_are_where_they_were_planned(tmp_path):
    rig = load_rig()
    planned = plan_press(rig)
    q = planned.joints.position
    joints = Joints(planned.time, q[:, 0], q[:, 1])
    times, lines = draw(rig, joints)
    assert 0.005 <= np.diff(times).min() < 0.01
    rise = np.interp(times, planned.time, planned.rise.position)
    foot, head = lines["jack"][:, 0], lines["jack"][:, 1]
    np.testing.assert_allclose(foot[:, 2] - rig.key.jack_surface_height, rise, atol=2e-6)
    np.testing.assert_allclose(head - foot, np.broadcast_to([0, 0, JACK], head.shape), atol=1e-12)
    for a, b, length in ((0, 1, rig.arm.upper_length), (1, 2, rig.arm.lower_length)):
        link = lines["arm"][:, b] - lines["arm"][:, a]
        np.testing.assert_allclose(np.linalg.norm(link, axis=1), length)
    front, above_pin, _ = lines["key"].transpose(1, 0, 2)
    tip = lines["arm"][:, 2]
    along = (above_pin - front) / rig.key.front_arm
    distance = np.linalg.norm(np.cross(tip - front, along), axis=1)
    np.testing.assert_allclose(distance, rig.arm.fingertip_radius, atol=1e-9)

    path = tmp_path / "press.mcap"
    info = SessionInfo(1, "2026-01-01T00:00:00Z", True, "c", "d")
    with Recording(path, rig, session=info, t0_ns=10**18) as recording:
        recording.write_block(Block(0, np.zeros((2, 64))))
        recording.write_scenes(times, lines)
    found = messages(path, "/scene")
    assert [at for _, at, _ in found] == [10**18 + round(time * 1e9) for time in times]
    for name, entity in zip(("arm", "key", "jack"), found[-1][2].entities, strict=True):
        assert (entity.id, entity.frame_id) == (name, "rig")
        points = [(p.x, p.y, p.z) for p in entity.lines[0].points]
        assert np.array(points) == pytest.approx(lines[name][-1])
        assert entity.lines[0].pose.orientation.w == 1
