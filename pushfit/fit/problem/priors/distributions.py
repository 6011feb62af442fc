"""Priors of the parameters, on the scale on which they are sampled.

A positive parameter is sampled in its log, so `log_prob` here is the density of the
log: a normal prior on K_sn carries the factor K_sn of that change of variable. The
ellipse numbers e1 and e2 have any sign and are sampled as they are. Excluded: priors of
A and B (`pushfit.fit.problem.priors.conditional_prior`).
"""

import functools
from collections.abc import Mapping

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import scipy
from jax.scipy.stats import norm
from jaxtyping import Array, Float

from pushfit.config import GraspConfig
from pushfit.fit.programs.compile import compiled
from pushfit.model import Scalar, as_float
from pushfit.parameters import OF_GRASP, PARAMETERS, STIFF, Shape

# Of a scale read off the data themselves, which is good to a factor of a few.
SPREAD_OF_A_GUESS = 1.2


class Prior(eqx.Module):
    """Distribution of one parameter.

    Args:
        kind: "normal", "lognormal" or "uniform", all restricted to positive values
            for a positive parameter.
        first: Mean, median or lower bound [unit of the parameter].
        second: Standard deviation, standard deviation of the log, or upper bound.
        is_positive: Whether the parameter is sampled in its log.
    """

    kind: str = eqx.field(static=True)
    first: Scalar = eqx.field(converter=as_float)
    second: Scalar = eqx.field(converter=as_float)
    is_positive: bool = eqx.field(static=True, default=True)

    def log_prob(self, u: Float[Array, "*s"]) -> Float[Array, "*s"]:
        """Normalised log density of u, the log of a positive parameter or its value.

        Returns:
            Log density; -inf outside the bounds of a uniform prior.
        """
        if self.kind == "lognormal":
            return norm.logpdf(u, jnp.log(self.first), self.second)
        value = jnp.exp(u) if self.is_positive else u
        # dK = K d(ln K)
        log_slope = u if self.is_positive else jnp.zeros_like(u)
        if self.kind == "uniform":
            is_inside = (value >= self.first) & (value <= self.second)
            density = -jnp.log(self.second - self.first) + log_slope
            return jnp.where(is_inside, density, -jnp.inf)
        density = norm.logpdf(value, self.first, self.second) + log_slope
        if self.is_positive:
            density = density - norm.logcdf(self.first / self.second)
        return density

    def sample(self, rng: np.random.Generator, n: int) -> Float[np.ndarray, " n"]:
        """Independent draws of u: logs of a positive parameter, else values."""
        first, second = float(self.first), float(self.second)
        if self.kind == "lognormal":
            return rng.normal(np.log(first), second, n)
        if self.kind == "uniform":
            value = rng.uniform(first, second, n)
        else:
            low = -first / second if self.is_positive else -np.inf
            share_above = scipy.special.ndtr(-low) * (1 - rng.uniform(size=n))
            value = first - second * scipy.special.ndtri(share_above)
        return np.log(value) if self.is_positive else np.asarray(value)

    def describe(self) -> str:
        """The prior in words, for reports."""
        first, second = float(self.first), float(self.second)
        if self.kind == "lognormal":
            return f"lognormal, median {first:g}, sd_log {second:g}"
        if self.kind == "uniform":
            return f"uniform from {first:g} to {second:g}"
        return f"normal, mean {first:g}, sd {second:g}"


@compiled
def log_prior_at(prior: Prior, u: Float[Array, " n"]) -> Float[Array, " n"]:
    """`Prior.log_prob` as one program, for callers that are not compiled."""
    return prior.log_prob(u)


def default_priors(stiffness_scale: float | None) -> dict[str, Prior]:
    """Priors of the parameters that `grasp.toml` does not name.

    Args:
        stiffness_scale: Normal series stiffness that the tallest height suggests, for
            heights in sensor units, where no stiffness in N/m can be guessed
            [table unit/m]; None for heights in newtons.
    """
    names = [n for n, p in PARAMETERS.items() if p.prior and n not in OF_GRASP]
    priors = {name: default_prior(name) for name in names}
    if stiffness_scale is None:
        return priors
    support, contact = _shape_of("K_sn")[1], _shape_of("K_dn")[1]
    scale = stiffness_scale / (support * contact / (support + contact))
    for name in STIFF:
        kind, median, _ = _shape_of(name)
        priors[name] = Prior(kind, median * scale, SPREAD_OF_A_GUESS)
    return priors


@functools.cache
def default_prior(name: str) -> Prior:
    """What is known of a parameter of fingers and hand-held boxes."""
    return Prior(*_shape_of(name), PARAMETERS[name].is_positive)


def _shape_of(name: str) -> Shape:
    shape = PARAMETERS[name].prior
    assert shape is not None
    return shape


def priors_from_config(
    config: GraspConfig, defaults: Mapping[str, Prior]
) -> tuple[dict[str, Prior], dict[str, float]]:
    """Priors and fixed values in force; where none is stated, those of `defaults`."""
    priors = dict(defaults)
    fixed = {}
    for name, choice in config.parameters.items():
        is_positive = PARAMETERS[name].is_positive
        if choice.fixed is not None:
            fixed[name] = float(choice.fixed)
            priors.pop(name, None)
        elif choice.lognormal is not None:
            median, sd_log = choice.lognormal.median, choice.lognormal.sd_log
            priors[name] = Prior("lognormal", median, sd_log)
        elif choice.normal is not None:
            mean, sd = choice.normal.mean, choice.normal.sd
            priors[name] = Prior("normal", mean, sd, is_positive)
        elif choice.uniform is not None:
            low, high = choice.uniform.low, choice.uniform.high
            priors[name] = Prior("uniform", low, high, is_positive)
    return priors, fixed
