"""Parameters and grasps with answers known by hand, tagged by what makes them hard.

Round numbers make the series springs round: L² K_st = 2 C_d gives B = K_st / 3, and
angles follow from tan θ_c = B / (A C_rr).
"""

import math
from dataclasses import dataclass, field

import numpy as np

from pushfit.data.simulate import Session
from pushfit.model import Grasp, Parameters, Pushes

THETA_DEG = np.arange(5.0, 90.0, 5.0)
# Clear of every critical angle of the cases, so that differences do not straddle it.
SMOOTH_THETA_DEG = np.array([7.0, 22.0, 38.0, 53.0, 68.0, 83.0])
# A BioTac's fluid pressure as in public recordings: idle near 2440 counts, some 500
# counts per push, a few counts lost on release, slow drift, hardly any noise.
BIOTAC = Session(
    level=2440.0,
    drift=0.3,
    noise=0.7,
    step=0.1,
    undershoot=0.012,
    limit=4095.0,
    quantum=1.0,
    unit="counts",
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """A grasp whose answers are known from elsewhere.

    Args:
        params: Parameters.
        grasp: Grasp and sensor.
        A: Normal series stiffness [N/m].
        B: Unrolled tangential series stiffness, geometric mean [N/m].
        alpha_deg: Azimuth at which `critical_angle_deg` holds.
        critical_angle_deg: θ_c; NaN where the contact never rolls.
        soft_axis_deg: Azimuth of least resistance; NaN where there is none.
        tags: What makes the case hard.
    """

    params: Parameters
    grasp: Grasp
    A: float
    B: float
    alpha_deg: float = 90.0
    critical_angle_deg: float
    soft_axis_deg: float = math.nan
    tags: frozenset[str] = field(default_factory=frozenset)

    def pushes(self, theta_deg=THETA_DEG) -> Pushes:
        """Elevations at one azimuth, or at five where the azimuth matters."""
        direction = {"ellipse", "two_supports"} & self.tags
        alpha_deg = np.arange(10.0, 180.0, 36.0) if direction else [self.alpha_deg]
        return sweep(theta_deg, alpha_deg)


def sweep(theta_deg, alpha_deg) -> Pushes:
    """Every elevation at every azimuth."""
    theta, alpha = np.meshgrid(np.radians(theta_deg), np.radians(alpha_deg))
    return Pushes(theta=theta.ravel(), alpha=alpha.ravel())


def paper_parameters(**changes: float) -> Parameters:
    """A = 400 and B = 100 N/m, C_rr = 0.25: A C_rr = B."""
    values = {"K_sn": 1200, "K_dn": 600, "K_st": 300, "C_rr": 0.25}
    return Parameters(**(values | {"C_d": 0.24, "L": 0.04} | changes))


def ellipse(ratio: float, stiff_axis_deg: float) -> dict[str, float]:
    """The two shape numbers of an ellipse with this ratio of axes."""
    twice = 2 * math.radians(stiff_axis_deg)
    size = math.log(ratio)
    return {"e1": size * math.cos(twice), "e2": size * math.sin(twice)}


PUSH = 0.005
PLAIN = Grasp(push_length=PUSH)
# F_0 = √2 N makes C_rr F_0 / (S_p R) one half, hence θ_c = 45° - 30°.
HALF_PRELOAD = math.sqrt(2)
# Axes of K at 600 and 150 N/m, of B at 120 and 75 N/m.
TILTED_ELLIPSE = ellipse(4.0, 30.0)

CASES = {
    "paper": Case(
        params=paper_parameters(),
        grasp=PLAIN,
        A=400,
        B=100,
        critical_angle_deg=45,
    ),
    "blind_magnitude": Case(
        params=Parameters(1300, 2600 / 3, 201, 0.3, 0.1608, 0.04),
        grasp=PLAIN,
        A=520,
        B=67,
        critical_angle_deg=math.degrees(math.atan(67 / 156)),
        tags=frozenset({"hard_from_heights"}),
    ),
    "firm": Case(
        params=Parameters(1300, 2600 / 3, 450, 0.5, 0.36, 0.04),
        grasp=PLAIN,
        A=520,
        B=150,
        critical_angle_deg=math.degrees(math.atan(150 / 260)),
    ),
    "one_sided": Case(
        params=paper_parameters(K_st=360, C_d=0.288, C_rr=0.1),
        grasp=PLAIN,
        A=400,
        B=120,
        critical_angle_deg=math.degrees(math.atan(3)),
        tags=frozenset({"one_sided"}),
    ),
    "soft": Case(
        params=paper_parameters(),
        grasp=Grasp(push_length=PUSH, sharpness=6.0),
        A=400,
        B=100,
        critical_angle_deg=45,
        tags=frozenset({"soft"}),
    ),
    "sensor_units": Case(
        params=paper_parameters(),
        grasp=Grasp(push_length=PUSH, gain=250.0, offset=40.0),
        A=400,
        B=100,
        critical_angle_deg=45,
        tags=frozenset({"gain"}),
    ),
    "preload": Case(
        params=paper_parameters(),
        grasp=Grasp(push_length=PUSH, preload=HALF_PRELOAD),
        A=400,
        B=100,
        critical_angle_deg=15,
        tags=frozenset({"preload"}),
    ),
    "never_rolls": Case(
        params=paper_parameters(),
        grasp=Grasp(push_length=PUSH, preload=4.0),
        A=400,
        B=100,
        critical_angle_deg=math.nan,
        tags=frozenset({"preload", "never_rolls"}),
    ),
    "ellipse": Case(
        params=paper_parameters(**TILTED_ELLIPSE),
        grasp=PLAIN,
        A=400,
        B=math.sqrt(120 * 75),
        alpha_deg=30,
        critical_angle_deg=math.degrees(math.atan(1.2)),
        soft_axis_deg=120,
        tags=frozenset({"ellipse"}),
    ),
    "two_supports": Case(
        params=paper_parameters(),
        grasp=Grasp(push_length=PUSH, support_span=0.06, sharpness=8.0),
        A=400,
        B=100,
        critical_angle_deg=45,
        soft_axis_deg=90,
        tags=frozenset({"two_supports", "soft"}),
    ),
    "everything": Case(
        params=paper_parameters(**TILTED_ELLIPSE),
        grasp=Grasp(
            push_length=PUSH,
            preload=0.3,
            gain=2.0,
            offset=0.1,
            support_span=0.06,
            sharpness=7.5,
        ),
        A=400,
        B=math.sqrt(120 * 75),
        critical_angle_deg=math.nan,
        tags=frozenset(
            {"ellipse", "two_supports", "soft", "preload", "gain", "no_closed_form"}
        ),
    ),
}
