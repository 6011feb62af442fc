"""The equations of He & Zhang (2014) in plain Python, one number at a time.

A second route to every prediction: written from the printed page, with `math` and dense
2x2 algebra, and sharing nothing with `pushfit`.
"""

import math
from types import SimpleNamespace

import numpy as np
import scipy.linalg


def numbers(container):
    """The fields of a container as plain floats."""
    return SimpleNamespace(
        **{
            name: value if value is None or isinstance(value, str) else float(value)
            for name, value in vars(container).items()
        }
    )


def normal_force(p, S_p, theta):
    """Eq. (6)."""
    return p.K_sn * p.K_dn / (p.K_sn + p.K_dn) * S_p * math.sin(theta)


def rolled_force(p, S_p, theta):
    """Eq. (8), with S_p for the printed P_p."""
    return p.K_sn * p.K_dn / (p.K_sn + p.K_dn) * p.C_rr * S_p * math.sin(theta)


def unrolled_force(p, S_p, theta):
    """Eq. (10), with S_p for the printed P_p."""
    return p.K_st * p.C_d / (p.L**2 * p.K_st + p.C_d) * S_p * math.cos(theta)


def critical_angle(p):
    """Eq. (11), factor by factor as printed."""
    return math.atan(
        1
        / p.K_dn
        * (p.K_st / p.K_sn)
        * (p.C_d / p.C_rr)
        * ((p.K_sn + p.K_dn) / (p.L**2 * p.K_st + p.C_d))
    )


def rolled_resistance(p, theta):
    """Eq. (13)."""
    vector = [p.C_rr * math.sin(theta), math.sin(theta)]
    return p.K_sn * p.K_dn / (p.K_sn + p.K_dn) * math.hypot(*vector)


def unrolled_resistance(p, theta):
    """Eq. (14), with C_d for the printed C_r."""
    return math.hypot(
        p.K_st * p.C_d / (p.L**2 * p.K_st + p.C_d) * math.cos(theta),
        p.K_sn * p.K_dn / (p.K_sn + p.K_dn) * math.sin(theta),
    )


def support_tensor(p):
    """Stiffness ellipse of the support finger, section 3.1."""
    exponent = 0.5 * np.array([[p.e1, p.e2], [p.e2, -p.e1]])
    return p.K_st * scipy.linalg.expm(exponent)


def series_tensor(p):
    """Support stiffness ellipse in series with the rolling compliance."""
    compliance = np.linalg.inv(support_tensor(p)) + p.L**2 / p.C_d * np.eye(2)
    return np.linalg.inv(compliance)


def soft_minimum(a, b, sharpness):
    """As printed: overflows for small arguments, which the cases avoid."""
    if math.isinf(sharpness):
        return min(a, b)
    return (a**-sharpness + b**-sharpness) ** (-1 / sharpness)


def force(p, grasp, direction):
    """Normal force and tangential force vector of one push (theta, alpha)."""
    p, grasp = numbers(p), numbers(grasp)
    theta, alpha = (float(angle) for angle in direction)
    S_p = grasp.push_length
    normal = abs(grasp.preload + normal_force(p, S_p, theta))
    azimuth = np.array([math.cos(alpha), math.sin(alpha)])
    elastic = series_tensor(p) @ azimuth * S_p * math.cos(theta)
    if grasp.support_span is None:
        size = float(np.linalg.norm(elastic))
        held = soft_minimum(p.C_rr * normal, size, grasp.sharpness)
        return normal, elastic * held / size
    limit = [p.C_rr + grasp.support_span / (2 * p.L), p.C_rr]
    held = [
        math.copysign(soft_minimum(bound * normal, abs(one), grasp.sharpness), one)
        for bound, one in zip(limit, elastic, strict=True)
    ]
    return normal, np.array(held)


def height(p, grasp, direction):
    """Magnitude that the sensor reports for one push (theta, alpha)."""
    normal, tangential = force(p, grasp, direction)
    magnitude = math.hypot(normal, *tangential)
    grasp = numbers(grasp)
    return grasp.gain * (magnitude - grasp.preload) + grasp.offset
