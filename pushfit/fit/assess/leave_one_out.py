"""Which push the others do not predict, by the scatter that they show themselves.

Where no noise is stated one wrong height is taken for noise of all, and is hardly
farther from the fit than they are. Left out it shows, as externally studentised
residuals do; it is fitted again without it, as a few pushes are no linear problem.
Excluded: heights that are far from the fit by a known noise
(`pushfit.fit.assess.model_checking`).

References:
    Cook & Weisberg (1982), Residuals and Influence in Regression, chapter 2.
"""

from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
import scipy

from pushfit.errors import FitError
from pushfit.fit.problem.predictions import heights_of, predict_points
from pushfit.fit.problem.setup import Setup
from pushfit.fit.profiles.least_squares import fit_least_squares

# Chance of faulting one height of a table of which all are right.
LEVEL = 1e-3
# A wrong height bends the fit towards itself, and is still among the farthest from it.
N_TRIED = 6
# Fewer degrees of freedom of the others show no scatter: a kink at θ_c, which may be
# anywhere between few pushes, goes through all of them.
MIN_FREEDOM = 3
# Of the tallest height: by less the others scatter too, or the model is a little off.
WORTH = 0.02


@dataclass(frozen=True, slots=True, kw_only=True)
class LeftOut:
    """A push that the others do not predict.

    Args:
        row: Of the table.
        channel: In which it is farthest off.
        height: What was measured there [table unit].
        predicted: What the best fit to the others has there [table unit].
        p_value: Chance of one as far off where all pushes are right.
    """

    row: int
    channel: str
    height: float
    predicted: float
    p_value: float


def unpredicted(setup: Setup, *, reference_alpha: float) -> tuple[LeftOut, ...]:
    """Pushes without which all others agree, the most telling first.

        F = [(χ² - χ²₋ᵢ) / c] / [χ²₋ᵢ / (degrees of freedom without push i)]

    Its chance counts as often as there are pushes (Bonferroni).

    Args:
        setup: Problem of normal noise whose size is not known.
        reference_alpha: Azimuth at which θ_c of a mode is quoted [rad].

    Returns:
        Those of them; none where too few pushes are left to show their scatter, where
        no fit arrives, or where all are right.
    """
    try:
        whole = fit_least_squares(setup, reference_alpha=reference_alpha)
        observed = np.asarray(setup.problem.observed)[np.asarray(setup.problem.mask)]
        far = np.zeros(len(setup.rows))
        column = np.searchsorted(setup.rows, whole.row)
        np.maximum.at(far, column, np.abs(observed - whole.predicted) / whole.sigma)
        tried = [
            _without(setup, int(one), whole.chi_square, reference_alpha)
            for one in np.argsort(-far)[:N_TRIED]
        ]
    except FitError:
        return ()
    found = [one for one in tried if one is not None and one.p_value < LEVEL]
    return tuple(sorted(found, key=lambda one: one.p_value))


def _without(
    setup: Setup, column: int, chi_square: float, reference_alpha: float
) -> LeftOut | None:
    """What the others say of a push; None where they say nothing that counts.

    Args:
        column: Of the problem.
        chi_square: Of the best fit with the push.
    """
    problem = setup.problem
    mask = np.asarray(problem.mask)
    others = mask & (np.arange(mask.shape[1]) != column)
    alone = replace(
        setup, problem=replace(problem, mask=jnp.asarray(others)), search=None
    )
    fit = fit_least_squares(alone, reference_alpha=reference_alpha)
    if fit.degrees_of_freedom < MIN_FREEDOM:
        return None
    own = np.flatnonzero(mask[:, column])
    gain = (chi_square - fit.chi_square) / own.size
    ratio = gain * fit.degrees_of_freedom / max(fit.chi_square, np.finfo(float).tiny)
    chance = scipy.special.fdtrc(own.size, fit.degrees_of_freedom, max(ratio, 0.0))
    found = predict_points(problem, fit.estimate[None], problem.pushes)
    predicted = heights_of(problem, found)[0][own, column]
    observed = np.asarray(problem.observed)
    off = np.abs(observed[own, column] - predicted)
    worst = int(np.argmax(off))
    if off[worst] < WORTH * np.max(np.abs(observed[others])):
        return None
    return LeftOut(
        row=setup.rows[column],
        channel=problem.channels[own[worst]],
        height=float(observed[own[worst], column]),
        predicted=float(predicted[worst]),
        p_value=float(min(1.0, len(setup.rows) * chance)),
    )
