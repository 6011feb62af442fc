"""Whether the pushes told could be of one grasp at all, before anything is decided.

An interval is narrow also where one wrong height has left hardly a draw. Excluded: an
object that has moved (`pushfit.explore.decide.stopping`).
"""

from collections.abc import Iterator, Sequence

import numpy as np
import scipy
from jaxtyping import Float

from pushfit.data.tables.peak_table import PeakTable
from pushfit.data.text.faults import listed
from pushfit.errors import FitError
from pushfit.explore.belief.belief import Belief, Question
from pushfit.explore.belief.predict import predict
from pushfit.explore.belief.tables import noise_is_known, sd_of, table_of
from pushfit.explore.records import ToldPush, direction_words
from pushfit.fit.assess.warnings import INADEQUATE
from pushfit.fit.checks.leave_one_out import LeftOut, unlike_words, unpredicted
from pushfit.fit.checks.table_checks import unit_slips
from pushfit.fit.identify.fitted import prepared, reference_azimuth
from pushfit.fit.problem.setup import Setup, build_problem
from pushfit.fit.profiles.least_squares import fit_least_squares, settle_noise
from pushfit.fit.results import FitResult

# Chance of faulting heights that are those of a grasp.
LEVEL = 1e-3


def other_unit(told: Sequence[ToldPush], question: Question) -> str | None:
    """Which heights seem to be in another unit, and what to do; None where none do.

    No belief is asked, as such a height leaves none.
    """
    rows = [(n, row) for n, row in enumerate(told, start=1) if not row.is_short]
    table = table_of(told, question)
    words = [
        f"push {number} ({direction_words(row.theta, row.alpha)}): {found}"
        for i, found in ({} if table is None else unit_slips(table)).items()
        for number, row in [rows[i]]
    ]
    if not words:
        return None
    return f"{listed(words)}; correct it, or leave the push out, and begin again"


def misfit(told: Sequence[ToldPush], belief: Belief, question: Question) -> str | None:
    """What no draw explains, and what to do, as a clause; None where one does.

    Chi-square of the draw that is nearest to all heights, as if nothing had been fitted
    to them; of the nearest fit where there are no draws of them. Noise that is learned
    explains everything, so each push is held against the scatter of the others then;
    heavy tails explain everything, too.
    """
    own = [(number, row) for number, row in enumerate(told, start=1) if row.counts]
    is_known = noise_is_known(told, question)
    if not own or belief.likelihood != "normal" or (belief.is_guess and not is_known):
        return None
    if not is_known:
        return _unlike_others(own, question)
    rows = [row for _, row in own]
    if belief.is_guess:
        nearest = _of_nearest_fit(rows, question)
    else:
        nearest = _of_nearest_draw(rows, belief, question)
    if (
        nearest is None
        or scipy.special.chdtrc(nearest.size, np.sum(nearest**2)) > LEVEL
    ):
        return None
    size = np.max(np.abs(nearest), axis=0)
    number, row = own[int(np.argmax(size))]
    return (
        f"no grasp gives all of these heights: push {number} "
        f"({direction_words(row.theta, row.alpha)}) is farthest, by {np.max(size):.0f} "
        "standard deviations; look at it, and begin again with the other pushes, or "
        "with a larger sigma if heights scatter more"
    )


def _of_nearest_draw(
    rows: Sequence[ToldPush], belief: Belief, question: Question
) -> Float[np.ndarray, "c n"]:
    """How far the draw that is nearest to all heights is from each [sd]."""
    residuals = []
    for row in rows:
        found = predict(belief, np.array([row.theta]), np.array([row.alpha]))
        heights = np.array([row.heights[channel] for channel in question.channels])
        noise = belief.noise(sd_of(row, question))
        residuals.append((heights[:, None] - found.heights[0]) / noise)
    r = np.stack(residuals, axis=1)
    chi_square = np.where(belief.weights > 0, np.sum(r**2, axis=(0, 1)), np.inf)
    return r[:, :, int(np.argmin(chi_square))]


def _of_nearest_fit(
    rows: Sequence[ToldPush], question: Question
) -> Float[np.ndarray, "c n"] | None:
    """How far the nearest fit is from each height [sd]; None where none is found."""
    found = []
    for table, _, fit, _ in _best_fits(rows, question):
        residuals = np.zeros((len(table.channels), table.n_pushes))
        where = [table.channels.index(name) for name in fit.channel], list(fit.row)
        observed = np.stack([table.heights(name) for name in table.channels])[where]
        residuals[where] = (observed - fit.predicted) / fit.sigma
        found.append(residuals)
    return min(found, key=lambda residuals: float(np.sum(residuals**2)), default=None)


def _best_fits(
    rows: Sequence[ToldPush], question: Question
) -> Iterator[tuple[PeakTable, Setup, FitResult, float]]:
    """Least squares by each mechanics, as far as solvers do not stop."""
    table = table_of(rows, question)
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


def rejected(belief: Belief) -> str | None:
    """That the model does not describe the heights, and what to do, as a clause."""
    for warning in belief.warnings:
        if warning.code == INADEQUATE:
            return (
                f"{warning.text}; an angle by it would be none of this grasp; ask "
                "`pushfit fit` of their table what it may be, and begin again with "
                "settings that allow for it"
            )
    return None


def _unlike_others(
    own: Sequence[tuple[int, ToldPush]], question: Question
) -> str | None:
    """Which push the others do not predict by any mechanics, by their own scatter."""
    found: tuple[LeftOut, ...] = ()
    for _, setup, fit, alpha in _best_fits([row for _, row in own], question):
        found = unpredicted(setup, fit, reference_alpha=alpha)
        if not found:
            break
    if not found:
        return None

    def name(index: int) -> str:
        number, row = own[index]
        return f"push {number} ({direction_words(row.theta, row.alpha)})"

    words = unlike_words(found, name, question.unit)
    return (
        f"no grasp gives all of these heights: {words}; look at it, correct it, or "
        "leave it out, and begin again"
    )
