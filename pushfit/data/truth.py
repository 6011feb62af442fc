"""A simulation as a configuration states it: parameters, grasp and sensor.

Excluded: the simulation itself (`pushfit.data.simulate`).
"""

import numpy as np

from pushfit.config import GraspConfig, PriorSetting
from pushfit.data.grasp import make_grasp
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.recordings.records import Recording
from pushfit.data.simulate import Session, simulate_recording
from pushfit.errors import ConfigError
from pushfit.model import Parameters
from pushfit.parameters import SIX


def simulate_from_config(
    schedule: PushSchedule,
    config: GraspConfig,
    *,
    unit: str,
    noise: float,
    seed: int,
) -> Recording:
    """Record a schedule, angles of the joints included, as a configuration states.

    Args:
        config: Settings; `[parameters]` is the truth and the preload the reading at
            rest.
        noise: Standard deviation of a sample [unit].

    Raises:
        ConfigError: A parameter is missing, the preload cannot be converted, or it or
            the sharpness of the transition has a prior.
    """
    preload = config.preload_in(unit)
    if isinstance(preload, str):
        raise ConfigError(
            "the preload is to be estimated; a simulation needs a number for "
            f"[grasp] preload_{unit}",
            code="no_truth",
        )
    return simulate_recording(
        stated_parameters(config),
        make_grasp(config, unit),
        schedule,
        session=Session(unit=unit, noise=noise, level=preload),
        rng=np.random.default_rng(seed),
    ).recording


def stated_parameters(config: GraspConfig) -> Parameters:
    """Parameters at the centre of what `[parameters]` says.

    Args:
        config: Settings with an entry for each of the six parameters; e1 and e2 may be
            missing, which is a round ellipse.

    Returns:
        The `fixed` value, the mean, the median or the middle of the range of each.

    Raises:
        ConfigError: A parameter is missing, or the sharpness of the transition has a
            prior: a simulation has no default truth.
    """
    if config.parameters.p is not None:
        raise ConfigError(
            "[parameters] p is a prior of the sharpness, which a simulation does not "
            'read; state "hard" or a number for [transition] sharpness',
            code="no_truth",
        )
    values = {name: _centre(prior) for name, prior in config.parameters.items()}
    values.pop("F_0", None)
    missing = set(SIX) - set(values)
    if missing:
        names = ", ".join(sorted(missing))
        raise ConfigError(
            f"[parameters] says nothing about {names}; a simulation needs every "
            "parameter: add NAME = { fixed = value }",
            code="no_truth",
        )
    return Parameters(**values)


def _centre(prior: PriorSetting) -> float:
    """The number that stands for a prior, which states one of these."""
    centres = (
        prior.fixed,
        prior.normal and prior.normal.mean,
        prior.lognormal and prior.lognormal.median,
        prior.uniform and (prior.uniform.low + prior.uniform.high) / 2,
    )
    return next(centre for centre in centres if centre is not None)
