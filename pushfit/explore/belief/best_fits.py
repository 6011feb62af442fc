"""Least squares of the pushes told: which of them no grasp explains.

Excluded: draws (`pushfit.explore.belief.from_fit`).
"""

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Float

from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import FitError
from pushfit.explore.belief.belief import Question
from pushfit.explore.belief.tables import table_of
from pushfit.explore.records import ToldPush
from pushfit.fit.checks.leave_one_out import LeftOut, unpredicted
from pushfit.fit.identify.fitted import prepared, reference_azimuth
from pushfit.fit.problem.setup import Setup, build_problem
from pushfit.fit.profiles.least_squares import fit_least_squares, settle_noise
from pushfit.fit.results import FitResult


def unlike_others(told: Sequence[ToldPush], question: Question) -> tuple[LeftOut, ...]:
    """Pushes that the others do not predict, whatever the mechanics.

    Args:
        told: Pushes of full length, none of them flagged; the rows of what is found.
    """
    found: tuple[LeftOut, ...] = ()
    for _, setup, fit, alpha in _best_fits(told, question):
        found = unpredicted(setup, fit, reference_alpha=alpha)
        if not found:
            break
    return found


def least_residuals(
    told: Sequence[ToldPush], question: Question
) -> Float[np.ndarray, "c n"] | None:
    """How far heights are from the nearest fit, in standard deviations.

    Args:
        told: Pushes of full length, none of them flagged.

    Returns:
        By channel and push; None where no fit is found.
    """
    found = []
    for table, _, fit, _ in _best_fits(told, question):
        residuals = np.zeros((len(table.channels), table.n_pushes))
        where = [table.channels.index(name) for name in fit.channel], list(fit.row)
        observed = np.stack([table.heights(name) for name in table.channels])[where]
        residuals[where] = (observed - fit.predicted) / fit.sigma
        found.append(residuals)
    return min(found, key=lambda residuals: float(np.sum(residuals**2)), default=None)


def _best_fits(
    told: Sequence[ToldPush], question: Question
) -> Iterator[tuple[PeakTable, Setup, FitResult, float]]:
    """Least squares by each mechanics, as far as solvers do not stop."""
    table = table_of(told, question)
    if table is None:
        return
    settings, _ = prepared(table, question.settings)
    for one in settings.by_mechanics():
        alpha = reference_azimuth(table, one)
        setup = settle_noise(build_problem(table, one), alpha)
        try:
            fit = fit_least_squares(setup, reference_alpha=alpha)
        except FitError:
            return
        yield table, setup, fit, alpha
