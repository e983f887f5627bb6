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


def close_loop(finger, j, lag, acceleration, period):
    """Set the torque of a motor for a controller sample.

    With the following error e it is k e + c de/dt + J acceleration + integral, limited; the
    integral k e dt / T grows only while the limit is not reached.

    Args:
        finger: Of `structures.FINGER`.
        j: Number of the joint.
        lag: rad, following error of the encoder.
        acceleration: rad/s^2, of the reference.
        period: s.
    """
    limit, change, finger.lag[j] = finger.limit[j], lag - finger.lag[j], lag
    torque = finger.stiffness[j] * lag + finger.damping[j] * change / period
    torque += finger.feedforward[j] * acceleration + finger.integral[j] + finger.offset[j]
    if abs(torque) < limit:  # no integrator wind-up while the amplifier saturates
        finger.integral[j] += finger.stiffness[j] * lag * period / finger.integral_time
    finger.torque[j] = min(max(torque, -limit), limit)
