"""What a viewer draws of a press is what was planned, and what the recording has."""

from xml.etree import ElementTree

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sautereau.daq.file.recorded import Joints
from sautereau.daq.file.recording import Block, Recording, SessionInfo
from sautereau.rig.load import load_rig
from sautereau.robot.experiment.session import draw
from sautereau.trajectory.press import plan_press
from sautereau.trajectory.urdf import JACK, rig_urdf
from tests.daq.declared import messages


def test_arm_key_and_jack_are_where_they_were_planned(tmp_path):
    rig = load_rig()
    planned = plan_press(rig)
    q = planned.joints.position
    joints = Joints(planned.time, q[:, 0], q[:, 1])
    times, lines, frames = draw(rig, joints)
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
        recording.write_scenes(times, lines, frames)
    found = messages(path, "/scene")
    assert [at for _, at, _ in found] == [10**18 + round(time * 1e9) for time in times]
    for name, entity in zip(("arm", "key", "jack"), found[-1][2].entities, strict=True):
        assert (entity.id, entity.frame_id) == (name, "rig")
        points = [(p.x, p.y, p.z) for p in entity.lines[0].points]
        assert np.array(points) == pytest.approx(lines[name][-1])
        assert entity.lines[0].pose.orientation.w == 1
    found = messages(path, "/transforms")
    assert [at for _, at, _ in found] == [10**18 + round(time * 1e9) for time in times]
    for name, one in zip(frames, found[-1][2].transforms, strict=True):
        x, z, angle = frames[name][-1]
        assert (one.child_frame_id, one.parent_frame_id) == (name, "rig")
        assert (one.translation.x, one.translation.z) == (x, z)
        turned = Rotation.from_quat(
            [one.rotation.x, one.rotation.y, one.rotation.z, one.rotation.w]
        )
        assert turned.as_rotvec() == pytest.approx([0, -angle, 0])


def test_the_links_of_the_urdf_are_where_the_drawing_has_them():
    """Its joints turned as the URDF says, from the root on."""
    rig = load_rig()
    planned = plan_press(rig)
    q = planned.joints.position
    times, lines, frames = draw(rig, Joints(planned.time, q[:, 0], q[:, 1]))
    row = len(times) // 2
    k = int(np.searchsorted(planned.time, times[row]))
    jack = lines["jack"][row, 0, 2] - rig.key.jack_surface_height
    values = {"joint_1": q[k, 0], "joint_2": q[k, 1], "key_pin": frames["key"][row, 2]}
    poses = {"rig": (np.zeros(3), Rotation.identity())}
    robot = ElementTree.fromstring(rig_urdf(rig))
    for joint in robot.iter("joint"):
        origin, turned = poses[joint.find("parent").get("link")]
        place = origin + turned.apply(_numbers(joint.find("origin").get("xyz")))
        axis, value = _numbers(joint.find("axis").get("xyz")), values.get(joint.get("name"), jack)
        assert float(joint.find("limit").get("lower")) < value
        assert value < float(joint.find("limit").get("upper"))
        if joint.get("type") == "prismatic":
            place = place + value * axis
        else:
            turned = turned * Rotation.from_rotvec(value * axis)
        poses[joint.find("child").get("link")] = place, turned
    for name, (x, z, angle) in ((name, frame[row]) for name, frame in frames.items()):
        place, turned = poses[name]
        assert place == pytest.approx([x, 0, z])
        assert turned.as_rotvec() == pytest.approx([0, -angle, 0], abs=1e-12)
    tip, turned = poses["arm_2"]
    assert tip + turned.apply([rig.arm.lower_length, 0, 0]) == pytest.approx(lines["arm"][row, 2])
    masses = [float(mass.get("value")) for mass in robot.iter("mass")]
    assert masses == [rig.arm.upper_mass, rig.arm.lower_mass]
    assert {link.get("name") for link in robot.iter("link")} == set(poses)


def _numbers(text):
    return np.array(text.split(), float)
