"""The setpoints of a motion, as the filter of an ODrive follows them."""

import numpy as np
import pytest

from sautereau.robot.drivers.odrive.setpoints import INTERVAL, LEAD, Setpoints, bandwidth
from sautereau.sim_backend.devices.odrive.axis import Setpoint, filtered
from sautereau.trajectory.press import plan_press
from sautereau.trajectory.segments import motion_at, segment_cubics


@pytest.fixture
def rig(odrive_rig):
    return odrive_rig


def followed(setpoints, start, joint, period):
    """Play setpoints through the filter; return its states, one each controller sample."""
    now, states = Setpoint(float(start[joint]), 0.0), []
    for u, w in zip(setpoints.positions[:, joint], setpoints.velocities[:, joint], strict=True):
        for _ in range(INTERVAL):
            states.append(now)
            now, _ = filtered(now, Setpoint(u, w), bandwidth(period), period)
    return np.array([(s.position, s.velocity) for s in states]), now


def test_the_filter_goes_where_the_plan_wants_it(rig):
    plan, period = plan_press(rig), rig.controller.sample_period
    segments = plan.segments
    setpoints = Setpoints.of(segments, period)
    ticks = np.arange(segments.total_samples + 1)
    motion = motion_at(segments, segment_cubics(segments, 1.0, period), ticks)
    cruise = slice(int(plan.cruise.start / period) + 30, int(plan.cruise.end / period) - 2)
    for joint in (0, 1):
        states, end = followed(setpoints, segments.start, joint, period)
        states = states[LEAD * INTERVAL :]
        off = states[: len(motion.position)] - np.column_stack(
            [motion.position[:, joint], motion.velocity[:, joint]]
        )
        assert np.abs(off[:, 0]).max() < 1e-4 / (2 * np.pi) * rig.arm.counts_per_revolution * 2
        relative = off[cruise, 1] / motion.velocity[cruise, joint]
        assert abs(relative.mean()) < 1e-3
        assert np.ptp(relative) < 1.1 / 8 / 16
        assert end.position == pytest.approx(segments.end[joint], abs=20)


def test_a_motion_that_runs_out_comes_to_rest_where_it_says(rig):
    setpoints = Setpoints.of(plan_press(rig).segments, rig.controller.sample_period)
    width, row = bandwidth(rig.controller.sample_period), len(setpoints) // 3
    for joint in (0, 1):
        sent = Setpoint(setpoints.positions[row, joint], setpoints.velocities[row, joint])
        rest, settled = filtered(Setpoint(setpoints.planned[row, joint], 0.0), sent, width, 2.0)
        assert settled
        assert rest.position == pytest.approx(setpoints.run_out[row, joint], abs=0.6)
