"""Which push the others do not predict, by the scatter that they show themselves.

Where no noise is stated one wrong height is taken for noise of all, and is hardly
farther from the fit than they are. Left out it shows: by externally studentised
residuals first, and where these doubt a push by a fit without it, as a few pushes are
no linear problem. Excluded: heights that are far from the fit by a known noise
(`pushfit.fit.checks.model_checking`).

References:
    Cook & Weisberg (1982), Residuals and Influence in Regression, chapter 2.
"""

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
import pandas as pd
import scipy
from jaxtyping import Int

from pushfit.data.text.faults import listed
from pushfit.errors import FitError
from pushfit.fit.problem.predictions import predict_points
from pushfit.fit.problem.setup import Setup
from pushfit.fit.profiles.least_squares import (
    RANK_TOLERANCE,
    fit_least_squares,
    polish,
    search_of,
    settle_noise,
)
from pushfit.fit.results import FitResult
from pushfit.model import as_float
from pushfit.parameters import TINY

# Chance of faulting one height of a table of which all are right.
LEVEL = 1e-3
# The same by a linear problem, of what is worth fits with and without it: 85 of 87
# wrong heights that these name pass, at a quarter of it 84, and at five halves 86.
DOUBT = 0.2
# Of 1, what the leverage of a push leaves that alone holds a number of the model: it is
# met, whatever it is.
ALONE = 0.2
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


def unpredicted(
    setup: Setup, whole: FitResult, *, reference_alpha: float
) -> tuple[LeftOut, ...]:
    """Pushes without which all others agree, the most telling first.

        F = [(χ² - χ²₋ᵢ) / c] / [χ²₋ᵢ / (degrees of freedom without push i)]

    Both χ² are by the noise that the other pushes have. Its chance counts as often as
    there are pushes (Bonferroni).

    Args:
        setup: Problem and its provenance, its noise settled.
        whole: Its best fit.
        reference_alpha: Azimuth at which θ_c of a mode is quoted [rad].

    Returns:
        Those of them; none where all are right, normal noise is stated, or too few
        pushes are left to show their scatter.
    """
    if setup.noise.kind == "given" and setup.problem.likelihood == "normal":
        return ()
    found = []
    for column in np.searchsorted(setup.rows, _doubted(setup, whole)).tolist():
        # Without a push that holds a number there may be no best fit.
        with contextlib.suppress(FitError):
            one = _without(setup, column, whole, reference_alpha=reference_alpha)
            if one is not None and one.p_value < LEVEL:
                found.append(one)
    return tuple(sorted(found, key=lambda one: one.p_value))


def unlike_words(
    found: Sequence[LeftOut], name: Callable[[int], str], unit: str
) -> str:
    """What is off, as a clause.

    Args:
        found: What `unpredicted` has found, one at least.
        name: Of the push of a row.
        unit: Of the heights.
    """
    worst, *others = found
    names = listed([name(one.row) for one in others])
    return (
        f"{name(worst.row)} has {worst.channel}_{unit} = {worst.height:.3g} where the "
        f"others give {worst.predicted:.3g}, by far more than they scatter"
        f"{f' (or it is {names})' if others else ''}"
    )


def _doubted(setup: Setup, whole: FitResult) -> Int[np.ndarray, " k"]:
    """Rows of heights that are far off by studentised residuals, or hold their number.

    t² = g (degrees of freedom - 1) / (χ² - g)   with g = r² / (1 - leverage)

    Returns:
        A few at most, the farthest first, and then those without which another number
        of the model would be free.
    """
    freedom = whole.degrees_of_freedom - 1
    if freedom < MIN_FREEDOM:
        return np.zeros(0, int)
    axes, sizes, _ = np.linalg.svd(whole.jacobian, full_matrices=False)
    axes = axes[: whole.n_data, sizes > RANK_TOLERANCE * sizes[0]]
    alone = np.maximum(1 - np.sum(axes**2, axis=1), TINY)
    observed = np.asarray(setup.problem.observed)[np.asarray(setup.problem.mask)]
    residuals = (observed - whole.predicted) / whole.sigma
    gain = np.minimum(residuals**2 / alone, whole.chi_square)
    ratio = gain * freedom / np.maximum(whole.chi_square - gain, TINY)
    chance = scipy.special.fdtrc(1, freedom, ratio)
    chance[chance * chance.size >= DOUBT] = 1.0
    order = np.lexsort((alone, chance))
    doubted = order[(chance < 1.0)[order] | (alone < ALONE)[order]]
    return pd.unique(np.asarray(whole.row)[doubted])[:N_TRIED]


def _without(
    setup: Setup, column: int, whole: FitResult, *, reference_alpha: float
) -> LeftOut | None:
    """What the others say of a push; None where they say nothing that counts.

    Args:
        column: Of the problem.
        whole: The best fit with the push.
    """
    # Tails, and what repeats have in common, may be what explains the push.
    problem = replace(setup.problem, likelihood="normal", shared=None)
    mask = np.asarray(problem.mask)
    others = mask & (np.arange(mask.shape[1]) != column)
    # A wrong height is most of the noise of its channel, if it is counted.
    noise = replace(
        setup.noise, kind="sampled", angle_sd=(0.0, 0.0), height_share=0.0, shared={}
    )
    rest = replace(problem, mask=jnp.asarray(others))
    rest_setup = replace(setup, problem=rest, noise=noise, search=None)
    alone = settle_noise(rest_setup, reference_alpha)
    fit = fit_least_squares(alone, reference_alpha=reference_alpha)
    if fit.degrees_of_freedom < MIN_FREEDOM:
        return None
    own = np.flatnonzero(mask[:, column])
    sigma = np.array(alone.problem.reference_sigma)
    sigma[own, column] = [np.median(sigma[c, others[c]]) for c in own]
    starts = search_of(alone, reference_alpha).valleys.copy()
    starts[-1] = whole.estimate
    weighed = replace(problem, reference_sigma=as_float(sigma))
    with_it, without = (
        polish(replace(weighed, mask=counted), starts)[1][0]
        for counted in (problem.mask, rest.mask)
    )
    gain = (with_it - without) / own.size
    ratio = gain * fit.degrees_of_freedom / max(without, TINY)
    chance = scipy.special.fdtrc(own.size, fit.degrees_of_freedom, ratio)
    found = predict_points(problem, fit.estimate[None], problem.angles)
    predicted = found.heights[0, own, column]
    observed = np.asarray(problem.observed)
    off = np.abs(observed[own, column] - predicted)
    worst = int(np.argmax(off / sigma[own, column]))
    if off[worst] < WORTH * np.max(np.abs(observed[others])):
        return None
    return LeftOut(
        row=setup.rows[column],
        channel=problem.channels[own[worst]],
        height=float(observed[own[worst], column]),
        predicted=float(predicted[worst]),
        p_value=float(min(1.0, len(setup.rows) * chance)),
    )
