"""What the data fix, and what only the prior does.

The Jacobian of the weighted residuals against the logs of the free parameters is taken
on the user's own pushes; its singular vectors are the combinations that these data can
and cannot tell apart. Excluded: advice in words (`pushfit.fit.assess.advice`).
"""

from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pushfit.fit.problem.derived import median
from pushfit.fit.problem.problem import Problem
from pushfit.fit.problem.slopes import residuals_at
from pushfit.fit.profiles.least_squares import RANK_TOLERANCE
from pushfit.fit.programs.compile import compiled
from pushfit.fit.results import Combination, IdentifiabilityResult
from pushfit.model import Parameters, as_float, contact
from pushfit.parameters import OF_GRASP, POSITIVE, SIGNED

# A direction counts as fixed by the data when they remove this share of its prior
# variance: the error bar is then less than half of the prior's.
MIN_CONTRACTION = 0.75
# Exponents smaller than this are left out of a formula.
SMALLEST_EXPONENT = 0.1


def identifiability(
    problem: Problem,
    samples: Mapping[str, Float[np.ndarray, " n"]],
    prior_samples: Mapping[str, Float[np.ndarray, " m"]],
) -> IdentifiabilityResult:
    """Directions in parameter space by how well the data fix them.

        J = ∂ residuals / ∂ (logs of the free parameters) = U S Vᵀ

    Args:
        samples: Posterior draws; J is taken at their medians.
        prior_samples: Draws from the prior, which give the prior spread along V.

    Returns:
        One direction per free parameter, best determined first; no advice yet.
    """
    names = tuple(name for name in (*POSITIVE, *SIGNED) if name in problem.priors)
    middle = np.array([median(_scaled(n, samples[n])) for n in names])
    jacobian = _log_jacobian(problem, middle, names)
    _, singular_values, vectors = np.linalg.svd(jacobian, full_matrices=True)
    spread = np.array([np.var(_scaled(n, prior_samples[n])) for n in names])
    directions = []
    for value, vector in zip(singular_values, vectors, strict=True):
        prior_variance = float(vector**2 @ spread)
        removed = 1 - 1 / (1 + value**2 * prior_variance)
        directions.append(
            Combination(
                formula=power_product(names, vector),
                singular_value=float(value),
                is_determined=bool(removed > MIN_CONTRACTION),
            )
        )
    floor = RANK_TOLERANCE * singular_values.max()
    return IdentifiabilityResult(
        directions=tuple(directions),
        rank=int(np.sum(singular_values > floor)),
        n_parameters=len(names),
        advice=(),
    )


def power_product(names: tuple[str, ...], direction: Float[np.ndarray, " p"]) -> str:
    """A direction in the logs as a product of powers, the largest of them 1.

    Args:
        direction: Components along their logs (along e1 and e2 themselves).
    """
    scaled = direction / direction[np.argmax(np.abs(direction))]
    terms = []
    for name, exponent in zip(names, scaled, strict=True):
        if abs(exponent) < SMALLEST_EXPONENT:
            continue
        if name in SIGNED:
            terms.append(f"exp({exponent:.2g} {name})")
        else:
            is_one = abs(exponent - 1) < SMALLEST_EXPONENT / 2
            terms.append(name if is_one else f"{name}^{exponent:.2g}")
    return " · ".join(terms)


def _scaled(name: str, values: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    return values if name in SIGNED else np.log(values)


def _log_jacobian(
    problem: Problem, u: Float[np.ndarray, " p"], names: tuple[str, ...]
) -> Float[np.ndarray, "m p"]:
    """Slopes of the residuals, by way of the data coordinates that they depend on."""
    y, slopes = (np.asarray(a) for a in _data_coordinates(problem, as_float(u), names))
    _, jacobians = residuals_at(problem, y[None])
    n_heights = problem.observed.size
    return jacobians[0, :n_heights] @ slopes


@compiled
def _data_coordinates(
    problem: Problem, u: Float[Array, " p"], names: tuple[str, ...]
) -> tuple[Float[Array, " q"], Float[Array, "q p"]]:
    """Data coordinates at logs of parameters, and their derivatives."""

    def coordinates(values: Float[Array, " p"]) -> Float[Array, " q"]:
        point = dict(problem.fixed)
        for name, value in zip(names, values, strict=True):
            point[name] = value if name in SIGNED else jnp.exp(value)
        rest = {name: point.pop(name) for name in OF_GRASP if name in point}
        group = contact(Parameters(**point))
        of_group = {"f1": group.f1, "f2": group.f2}
        known = {"A": group.A, "B": group.B, "C_rr": group.C_rr, "s": group.s}
        logs = known | {"L": group.L} | rest
        y = of_group | {f"ln_{name}": jnp.log(value) for name, value in logs.items()}
        return jnp.stack([y[name] for name in problem.data_names])

    return coordinates(u), jax.jacfwd(coordinates)(u)
