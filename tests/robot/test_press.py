"""A complete press, byte for byte: as a transcript and over a real pseudo-terminal."""

import numpy as np
import pytest

from sautereau.robot.controller import MotionController


def press(controller: MotionController, segments):
    with controller, controller.powered():
        assert controller.simulated
        np.testing.assert_array_equal(controller.home(), [0, -500_000])
        controller.move_to(segments.start, 100_000)
        sent = controller.load(segments)
        controller.arm()
        controller.start()
        controller.wait()
        return sent, controller.capture()


@pytest.mark.parametrize("through", ["bench", "terminal"])
def test_transcript_of_a_press(request, through, lines, segments, rig):
    controller, _ = request.getfixturevalue(through)(lines.press)
    sent, capture = press(controller, segments)
    for name in ("start", "steps", "velocities", "samples"):
        np.testing.assert_array_equal(getattr(sent, name), getattr(segments, name))
    np.testing.assert_array_equal(capture.samples, np.arange(0, 54, 2))
    np.testing.assert_array_equal(capture.counts[:, 0], 1000 + np.arange(27))
    np.testing.assert_array_equal(capture.counts[:, 1], -501000 - np.arange(27))
    assert capture.counts.dtype == np.int64
    np.testing.assert_array_equal(capture.following_errors[:, 1], -np.arange(27))
    np.testing.assert_allclose(capture.torques[5], [1.0, -2.0], rtol=1e-4)
    assert capture.times[-1] == pytest.approx(52 * rig.controller.sample_period)


def test_firmwares_that_count_the_end_of_the_motion_as_a_segment(bench, lines, segments):
    ends = {"MG _PVA,_PVB": ("252", "251"), "MG _BTA,_BTB,_RPA,_RPB": (" 3.", " 4.")}
    script = [(s, a.replace(*ends[s]) if s in ends else a) for s, a in lines.press]
    controller, _ = bench(script)
    press(controller, segments)


def test_a_motion_never_played_is_cleared_before_the_next(bench, lines, segments):
    controller, _ = bench(
        lines.homed,
        [("MG _PVA,_PVB", " 200.0000 255.0000\r\n:"), ("PVA=0,0,-1;PVB=0,0,-1", "::")],
        lines.load,
        lines.off,
    )
    with controller, controller.powered():
        controller.home()
        controller.load(segments)


def test_positions_and_identity(bench, lines):
    controller, _ = bench(lines.connect, [("MG _TPA,_TPB", " -7.0000 12.0000\r\n:")])
    assert controller.connect() == controller.identity == "DMC4020 Rev 1.3c-SIM"
    np.testing.assert_array_equal(controller.positions(), [-7, 12])
    controller.disconnect()
    controller.disconnect()


def test_stop_keeps_the_motors_on_and_returns_the_positions(bench, lines):
    where = ("MG _TPA,_TPB", " 1.0000 2.0000\r\n:")
    controller, _ = bench(lines.connect, lines.on, lines.stop, [where], lines.off)
    with controller, controller.powered():
        np.testing.assert_array_equal(controller.stop(), [1, 2])


def test_abort_switches_off_and_powered_has_nothing_left_to_do(bench, lines):
    controller, _ = bench(lines.connect, lines.on, lines.abort)
    with controller, controller.powered():
        controller.abort()
