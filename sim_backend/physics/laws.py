"""Laws of the bench that both engines apply; the exact engine compiles them."""

import math


def surface(arm, height, angle):
    """Return the key's rise under a jack, b tan a + hb (1/cos a - 1), and its derivatives.

    Args:
        arm: Of the jack from the pin, in any unit of length.
        height: Of the surface above the pin, in the same one.
        angle: rad.
    """
    half = math.sin(angle / 2)
    sine, versine = 2 * half * math.cos(angle / 2), 2 * half * half
    secant = 1 / (1 - versine)
    rise = (arm * sine + height * versine) * secant
    slope = (arm + height * sine) * secant * secant
    curvature = (2 * arm * sine + height * (1 + sine * sine)) * secant * secant * secant
    return rise, slope, curvature


def close_loops(finger, period, first, second):
    """Set the motors' torques for a controller sample, from its reference and the encoders.

    With the following error e, read in integer counts, k e + c de/dt + J acceleration + integral,
    limited; the integral k e dt / T grows only while the limit is not reached.

    Args:
        finger: Of `structures.FINGER`.
        period: s.
        first: rad, joint as its encoder sees it.
        second: rad, likewise.
    """
    for j in range(2):
        p0, p2, p3 = finger.cubics[j, 0], finger.cubics[j, 2], finger.cubics[j, 3]
        counts = round(((second if j else first) - finger.start[j]) / finger.radians)
        lag = p0 - finger.start[j] - counts * finger.radians
        change, finger.lag[j] = lag - finger.lag[j], lag
        acceleration = (2 * p2 + 3 * p3) / (period * period)
        torque = finger.stiffness[j] * lag + finger.damping[j] * change / period
        torque += finger.feedforward[j] * acceleration + finger.integral[j] + finger.offset[j]
        if abs(torque) < finger.limit[j]:  # no integrator wind-up while the amplifier saturates
            finger.integral[j] += finger.stiffness[j] * lag * period / finger.integral_time
        finger.torque[j] = min(max(torque, -finger.limit[j]), finger.limit[j])
