"""Which numbers of a result may be quoted, decided once, where the result is made.

No number from numerics that are not to be trusted, no interval around what is not
determined, no stiffness without a push length, no interval of zero width, and no angle
called determined whose interval is wider than the user wants it. Where the model does
not describe the heights, or the table cannot be right, what it makes of them is
provisional: without intervals.
Excluded: the verdicts themselves (`pushfit.fit.assess.verdicts`).
"""

from dataclasses import replace

import numpy as np

from pushfit.fit.results import FitStatus, Identification, Piece, Quantity, Verdict
from pushfit.parameters import ANGLES, STIFFNESSES

Pieces = tuple[Piece, ...]

# What no model was needed for.
MODEL_FREE = "alpha_star_model_free"
# Verdicts that stand where the model does not describe the heights: they claim nothing.
UNTOUCHED = frozenset({Verdict.NOT_DETERMINED, Verdict.ASSUMED})
# Verdicts with a middle.
MIDDLED = frozenset(
    {Verdict.DETERMINED, Verdict.LEARNED, Verdict.PARTLY, Verdict.PROVISIONAL}
)


def is_trusted(identification: Identification) -> bool:
    """Whether numbers of the posterior may be quoted at all."""
    return (
        identification.status is FitStatus.OK
        and identification.posterior.status is FitStatus.OK
    )


def reported(found: Identification) -> Identification:
    """The same without the numbers that must not leave the house.

    Returns:
        The identification with None for what is not to be quoted: everything from a
        posterior that is not to be trusted, stiffness where the push length is unknown,
        what the verdict forbids, an interval of zero width, and numbers that are not
        finite.
    """
    free, fit = found.alpha_star_model_free, found.fit
    if not found.config.push.length_known:
        # Stiffnesses are among the coordinates.
        fit = replace(fit, modes=tuple(replace(m, coordinates={}) for m in fit.modes))
    answers = [
        replace(a, theta_c=_reported(a.theta_c, found)) for a in found.by_mechanics
    ]
    return replace(
        found,
        fit=fit,
        by_mechanics=tuple(answers),
        theta_c=_reported(found.theta_c, found),
        alpha_star=_reported(found.alpha_star, found),
        alpha_star_model_free=None if free is None else _reported(free, found),
        parameters=tuple(_reported(q, found) for q in found.parameters),
        combinations=tuple(_reported(q, found) for q in found.combinations),
    )


def _reported(quantity: Quantity, found: Identification) -> Quantity:
    """One quantity of a result, as far as it may be quoted."""
    nothing = replace(
        quantity, estimate=None, interval=None, sets=(), likelihood_sets=()
    )
    if quantity.name in STIFFNESSES and not found.config.push.length_known:
        return replace(nothing, note="not quoted: the push length is not known")
    verdict = quantity.verdict
    if verdict is Verdict.FIXED:
        return replace(nothing, estimate=quantity.estimate, contraction=None)
    if found.fit.status is not FitStatus.OK:
        quantity = replace(quantity, likelihood_sets=())
    is_of_model = quantity.name != MODEL_FREE
    if is_of_model and not is_trusted(found):
        return as_unknown(quantity)
    is_rejected = not found.goodness_of_fit.is_adequate
    if is_of_model and is_rejected and verdict not in UNTOUCHED:
        estimate = _finite(quantity.estimate) if verdict in MIDDLED else None
        return replace(nothing, estimate=estimate, verdict=Verdict.PROVISIONAL)
    return within_verdict(
        quantity, wanted_width_deg=found.config.report.wanted_width_deg
    )


def as_unknown(quantity: Quantity) -> Quantity:
    """A quantity whose numerics are not to be trusted: the likelihood's sets alone."""
    return replace(
        quantity,
        estimate=None,
        interval=None,
        sets=(),
        contraction=None,
        verdict=Verdict.UNKNOWN,
    )


def within_verdict(quantity: Quantity, *, wanted_width_deg: float) -> Quantity:
    """A quantity of trusted numerics and a model that fits, as its verdict allows.

    Args:
        wanted_width_deg: Widest interval of an angle that counts as determined [deg].

    Returns:
        The same without the numbers that the verdict forbids, an interval of no width,
        and what is not finite; WIDE where it was called determined and is not.
    """
    verdict, interval = quantity.verdict, quantity.interval
    is_open = verdict in (Verdict.NOT_DETERMINED, Verdict.ABSENT, Verdict.ONE_SIDED)
    if is_open or not interval or not np.isfinite(interval).all():
        interval = None
    width = 0.0 if interval is None else interval[1] - interval[0]
    is_pinned = quantity.name in ANGLES and verdict is Verdict.DETERMINED
    if is_pinned and width > wanted_width_deg:
        verdict = Verdict.WIDE
    # With several modes the interval covers them all; a middle would lie between.
    has_middle = verdict in MIDDLED or verdict is Verdict.ASSUMED
    return replace(
        quantity,
        estimate=_finite(quantity.estimate) if has_middle else None,
        interval=interval if width > 0 else None,
        sets=() if verdict is Verdict.NOT_DETERMINED else quantity.sets,
        verdict=verdict,
    )


def _finite(value: float | None) -> float | None:
    return value if value is not None and np.isfinite(value) else None


def pieces_for(quantity: Quantity) -> Pieces:
    """The set that shows the verdict: credible, else by likelihood; may be empty."""
    if quantity.verdict is Verdict.SEVERAL_MODES and len(quantity.sets) < 2:
        return quantity.likelihood_sets
    if quantity.verdict is Verdict.ONE_SIDED:
        for pieces in (quantity.sets, quantity.likelihood_sets):
            # Open at both ends is no bound.
            if any((low is None) != (high is None) for low, high in pieces):
                return pieces
        return ()
    return quantity.sets
