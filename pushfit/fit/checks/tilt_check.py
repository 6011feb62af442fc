"""Does tilting matter to θ_c, and which mechanics leads where both were computed.

Excluded: the other warnings of a result (`pushfit.fit.assess.warnings`).
"""

import math

import numpy as np
from jaxtyping import Array, Float

from pushfit.config import GraspConfig
from pushfit.fit.problem.derived import median
from pushfit.fit.problem.setup import Setup
from pushfit.fit.programs.compile import compiled
from pushfit.fit.results import MechanicsAnswer, PosteriorResult, ResultWarning
from pushfit.mechanics.linear import implied_tilt
from pushfit.mechanics.registry import mechanics_named
from pushfit.model import Grasp, Parameters, Pushes
from pushfit.parameters import SIGNED, SIX, TINY

# Below it nothing is said, nor fitted only to see. At 1.4°, of pushes of 1 mm on 40 mm,
# the paper's equations move θ_c by a quarter of its interval and more in 11 of 24
# grasps, where heights have noise of 1 %. Not tuned further [deg].
LARGE_TILT_DEG = 1.0
# A bias of this share of its width lowers the coverage of a 90 % interval to 79 %; of
# half its width to 50 %.
WORTH_OF_WIDTH = 0.25
# θ_c of a contact that never rolls, beside those of one that does [deg].
NEVER_DEG = 90.0
# Tilting mechanics with a log evidence that is lower by this are not what the heights
# say.
WORSE = 5.0
# Log evidence for those behind that is worth a word: a factor of 20.
WORTH_A_WORD = float(np.log(20.0))


def implied_tilt_deg(setup: Setup, posterior: PosteriorResult) -> float:
    """Largest tilt that a linear solution implies at the medians of its draws."""
    problem = setup.problem
    names = [n for n in (*SIX, *SIGNED) if n in posterior.samples]
    middle = {n: median(posterior.ordered[n]) for n in names}
    params = Parameters(**middle)
    tilt = np.asarray(_tilt(params, problem.pushes, problem.grasp))
    return float(np.degrees(np.max(tilt[: len(setup.rows)])))


def is_tilt_large(setup: Setup, linear: PosteriorResult) -> bool:
    """Whether draws by the paper's equations imply a tilt that may matter."""
    return implied_tilt_deg(setup, linear) >= LARGE_TILT_DEG


def does_tilt_matter(
    linear: PosteriorResult, tilting: PosteriorResult, *, prob: float
) -> bool:
    """Whether the paper's equations move θ_c by a good part of its interval.

    Its median or an end of it; the best fit of one table in three is at a kink, by
    either mechanics at the same.
    """
    tail = (1 - prob) / 2
    here, there = (
        np.quantile(
            np.nan_to_num(one.samples["theta_c"], nan=NEVER_DEG), [tail, 0.5, 1 - tail]
        )
        for one in (linear, tilting)
    )
    moved = np.max(np.abs(there - here))
    return bool(moved > WORTH_OF_WIDTH * (here[-1] - here[0]))


def do_draws_tilt(
    linear: PosteriorResult, tilting: PosteriorResult, *, prob: float
) -> bool:
    """Whether tilting mechanics lead where the tilt is large, by draws alone."""
    first, second = linear.log_evidence, tilting.log_evidence
    if first is not None and second is not None and second < first - WORSE:
        return False
    return does_tilt_matter(linear, tilting, prob=prob)


def is_worse(
    tilting: MechanicsAnswer, linear: MechanicsAnswer, *, n_heights: int
) -> bool:
    """Whether the heights themselves speak against tilting mechanics.

    Where evidences cannot be compared the residuals tell, each with the likeliest noise
    of one size: n ln(rms) less is as much more of a log likelihood.
    """
    if tilting.log_evidence is None or linear.log_evidence is None:
        here, there = (max(a.rms_residual or 0.0, TINY) for a in (linear, tilting))
        return n_heights * math.log(there / here) > WORSE
    return tilting.log_evidence < linear.log_evidence - WORSE


def contradicted_tilt(setup: Setup, linear: PosteriorResult) -> ResultWarning:
    """Warn of a tilt that matters, and that the heights speak against."""
    law = mechanics_named(setup.problem.grasp.mechanics)
    return ResultWarning(
        code="large_tilt",
        text="the fit implies that the object tilts by up to "
        f"{implied_tilt_deg(setup, linear):.2g}°, which {law.title} leave out; yet the "
        "heights prefer them to tilting mechanics, so check L, the push length and the "
        "unit of the heights",
    )


def tilt_warning(
    config: GraspConfig, answers: tuple[MechanicsAnswer, ...], tilt_deg: float
) -> ResultWarning | None:
    """Warn of a tilt that the heights or the mechanics that lead leave out.

    Args:
        answers: By all mechanics, the leading ones first.
        tilt_deg: Tilt that the leading ones imply [deg].
    """
    leading, *others = answers
    law = mechanics_named(leading.mechanics)
    if law.sees_tilt:
        return _likelier_without(leading, others, tilt_deg)
    if others or tilt_deg < LARGE_TILT_DEG:
        return None
    is_stated = config.grasp.mechanics != "auto"
    cures = (
        config.why_not("tilting"),
        'set grasp.mechanics = "auto"' if is_stated else None,
    )
    reason = ", and ".join(filter(None, cures)) or "no fit by them was found"
    return ResultWarning(
        code="large_tilt",
        text=f"the fit implies that the object tilts by up to {tilt_deg:.2g}°; "
        f"{law.title} hold for small tilts, and at 1° and more θ_c may be off by a "
        "good part of its interval, or lie beyond it. It is not computed by tilting "
        f"mechanics: {reason}",
    )


def _likelier_without(
    leading: MechanicsAnswer, others: list[MechanicsAnswer], tilt_deg: float
) -> ResultWarning | None:
    """Warn where heights are likelier by mechanics that leave out the leading tilt."""
    for other in others:
        if leading.log_evidence is None or other.log_evidence is None:
            continue
        against = other.log_evidence - leading.log_evidence
        if against >= WORTH_A_WORD:
            title, other_title = (
                mechanics_named(one.mechanics).title for one in (leading, other)
            )
            return ResultWarning(
                code="large_tilt",
                text=f"{title} lead, as by them the object tilts by up to "
                f"{tilt_deg:.2g}°; yet the heights are {np.exp(against):.0f} to 1 "
                f"likelier by {other_title}, whose θ_c stands beside: check L, the "
                "push length and the unit of the heights, and push in more directions",
            )
    return None


@compiled
def _tilt(params: Parameters, pushes: Pushes, grasp: Grasp) -> Float[Array, " n"]:
    return implied_tilt(params, pushes, grasp)
