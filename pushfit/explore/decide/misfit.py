"""Whether the pushes told could be of one grasp at all, before anything is decided.

An interval is narrow also where one wrong height has left hardly a draw. Excluded: an
object that has moved (`pushfit.explore.decide.stopping`).
"""

from collections.abc import Sequence

import numpy as np
import scipy
from jaxtyping import Float

from pushfit.data.text.faults import listed
from pushfit.explore.belief.belief import Belief, Question
from pushfit.explore.belief.best_fits import least_residuals, unlike_others
from pushfit.explore.belief.predict import predict
from pushfit.explore.belief.tables import noise_is_known, sd_of, table_of
from pushfit.explore.records import ToldPush, direction_words
from pushfit.fit.assess.warnings import INADEQUATE
from pushfit.fit.checks.leave_one_out import unlike_words
from pushfit.fit.checks.table_checks import unit_slips

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
        nearest = least_residuals(rows, question)
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
    """Which push the others do not predict, by the scatter that they show."""
    found = unlike_others([row for _, row in own], question)
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
