"""Which numbers of a result may be quoted.

No number from numerics that are not to be trusted, no interval around what is not
determined, no stiffness without a push length, no interval of zero width.
"""

from dataclasses import replace

import numpy as np

from pushfit.fit.results import FitStatus, Identification, Piece, Quantity, Verdict

Pieces = tuple[Piece, ...]

# Proportional to the unknown where the push length is unknown.
STIFFNESSES = frozenset({"K_sn", "K_dn", "K_st", "C_d", "A", "B"})
# Verdicts under which an estimate, or an interval, would pretend to knowledge.
UNBOUNDED = frozenset({Verdict.NOT_DETERMINED, Verdict.ONE_SIDED})


def is_trusted(identification: Identification) -> bool:
    """Whether numbers of the posterior may be quoted at all.

    Args:
        identification: The result.
    """
    return (
        identification.status is FitStatus.OK
        and identification.posterior.status is FitStatus.OK
    )


def quoted(quantity: Quantity, identification: Identification) -> Quantity:
    """Quantity without the numbers that must not leave the house.

    Args:
        quantity: One of the result's.
        identification: The result it belongs to.

    Returns:
        The same, with None for what is not to be quoted: everything from a posterior
        that is not to be trusted, stiffness where the push length is unknown, what the
        verdict forbids, an interval of zero width, and numbers that are not finite.
    """
    is_stiffness = quantity.name in STIFFNESSES
    if is_stiffness and not identification.config.push.length_known:
        return replace(
            quantity, estimate=None, interval=None, sets=(), likelihood_sets=()
        )
    has_fit = identification.fit.status is FitStatus.OK
    likelihood_sets = quantity.likelihood_sets if has_fit else ()
    if quantity.verdict is Verdict.FIXED:
        return replace(quantity, interval=None, sets=(), likelihood_sets=())
    if not is_trusted(identification):
        return replace(
            quantity,
            estimate=None,
            interval=None,
            sets=(),
            likelihood_sets=likelihood_sets,
            contraction=None,
        )
    interval, estimate = quantity.interval, quantity.estimate
    if quantity.verdict in UNBOUNDED:
        interval = None
    if quantity.verdict in UNBOUNDED or quantity.verdict is Verdict.SEVERAL_MODES:
        # With several modes the interval covers them all; a middle would lie between.
        estimate = None
    if interval is not None and not (
        np.isfinite(interval).all() and interval[0] < interval[1]
    ):
        interval = None
    if estimate is not None and not np.isfinite(estimate):
        estimate = None
    return replace(
        quantity,
        estimate=estimate,
        interval=interval,
        likelihood_sets=likelihood_sets,
    )


def pieces_for(quantity: Quantity) -> Pieces:
    """The set that shows the verdict: the credible one, else that of the likelihood.

    Args:
        quantity: Already without what is not to be quoted.

    Returns:
        Pieces; none where a one-sided quantity has no bound at all.
    """
    if quantity.verdict is Verdict.SEVERAL_MODES and len(quantity.sets) < 2:
        return quantity.likelihood_sets
    if quantity.verdict is Verdict.ONE_SIDED:
        for pieces in (quantity.sets, quantity.likelihood_sets):
            # Open at both ends is no bound.
            if any((low is None) != (high is None) for low, high in pieces):
                return pieces
        return ()
    return quantity.sets
