"""The grasp and sensor of the model, from a configuration and the unit of the heights.

Heights in a sensor's own unit need no calibration: gain is then 1 and every force,
the preload included, is counted in that unit. Excluded: the conversion to newtons
(`pushfit.config.sensor`).
"""

import math

from pushfit.config import GraspConfig
from pushfit.model import Grasp


def is_calibrated(config: GraspConfig, unit: str) -> bool:
    """Whether stiffness comes out in N/m rather than sensor units per metre."""
    return config.sensor.factor("n", unit) is not None


def make_grasp(config: GraspConfig, unit: str) -> Grasp:
    """Grasp of the model for heights in one unit.

    Args:
        config: Configuration in force; where it leaves the mechanics open the first of
            them stands.

    Returns:
        Grasp with the preload in newtons, or in the unit of uncalibrated heights; 0
        where it is to be estimated, as a transition to be found out is hard.

    Raises:
        ConfigError: If the preload is given in a unit that cannot be converted.
    """
    gain = config.sensor.factor("n", unit)
    gain = 1.0 if gain is None else gain
    preload = config.preload_in(unit)
    sharpness = config.transition.sharpness
    span = config.grasp.support_span_mm
    radius = config.grasp.tip_radius_mm
    length = config.push.length_mm
    return Grasp(
        push_length=length * 1e-3,
        preload=0.0 if preload == "estimate" else float(preload) / gain,
        gain=gain,
        sharpness=math.inf if isinstance(sharpness, str) else sharpness,
        support_span=None if span is None else span * 1e-3,
        tip_radius=None if radius is None else radius * 1e-3,
        mechanics=config.by_mechanics()[0].grasp.mechanics,
    )
