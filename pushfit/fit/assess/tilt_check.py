"""Does tilting matter to θ_c, and which mechanics leads where both were computed."""

import numpy as np
from jaxtyping import Array, Float

from pushfit.config import GraspConfig
from pushfit.fit.problem.derived import PARAMETERS
from pushfit.fit.programs import compiled
from pushfit.fit.results import MechanicsAnswer, Notice, PosteriorResult
from pushfit.fit.setup import Setup
from pushfit.mechanics.displacements import displacements
from pushfit.model import Grasp, Parameters, Pushes

# Below this tilt θ_c is not off by a degree: nothing is fitted [deg].
LARGE_TILT_DEG = 2.0
# A bias of this share of its width lowers the coverage of a 90 % interval to 79 %; of
# half its width to 50 %.
WORTH_OF_WIDTH = 0.25
# The same where there is no interval [deg].
WORTH_DEG = 2.0
# Tilting mechanics with a log evidence that is lower by this, or a chi-square that is
# larger by twice as much, are not what the heights say.
WORSE = 5.0


def implied_tilt_deg(setup: Setup, posterior: PosteriorResult) -> float:
    """Largest tilt that a linear solution implies.

    Args:
        setup: Problem by linear mechanics.
        posterior: Draws; the tilt is that of their medians.

    Returns:
        Tilt of the push that tilts the object most [deg].
    """
    problem = setup.problem
    names = [n for n in (*PARAMETERS, "e1", "e2") if n in posterior.samples]
    middle = {n: float(np.median(posterior.samples[n])) for n in names}
    params = Parameters(**middle)
    tilt = np.asarray(_tilt(params, problem.pushes, problem.grasp))
    return float(np.degrees(np.max(tilt[: len(setup.rows)])))


def does_tilt_matter(
    linear: MechanicsAnswer, tilting: MechanicsAnswer, tilt_deg: float
) -> bool:
    """Whether the paper's equations move θ_c by a good part of its interval.

    Args:
        linear: By the paper's equations.
        tilting: By tilting mechanics.
        tilt_deg: Tilt that the first implies [deg].
    """
    best, other = linear.best_fit_deg, tilting.best_fit_deg
    if tilt_deg < LARGE_TILT_DEG or best is None or other is None:
        return False
    worth = WORTH_DEG
    if linear.theta_c.interval is not None:
        worth = WORTH_OF_WIDTH * float(np.ptp(linear.theta_c.interval))
    return abs(other - best) >= worth


def is_worse(tilting: MechanicsAnswer, linear: MechanicsAnswer) -> bool:
    """Whether the heights themselves speak against tilting mechanics.

    Args:
        tilting: By tilting mechanics.
        linear: By the paper's equations.
    """
    if tilting.log_evidence is None or linear.log_evidence is None:
        return tilting.chi_square > linear.chi_square + 2 * WORSE
    return tilting.log_evidence < linear.log_evidence - WORSE


def tilt_notice(
    config: GraspConfig, answers: tuple[MechanicsAnswer, ...], tilt_deg: float
) -> Notice | None:
    """Warn of a large tilt where the paper's equations lead all the same.

    Args:
        config: Configuration as given.
        answers: By all mechanics, the leading ones first.
        tilt_deg: Tilt that the leading ones imply [deg].
    """
    leading, *others = answers
    if leading.mechanics == "tilting" or tilt_deg < LARGE_TILT_DEG:
        return None
    start = f"the fit implies that the object tilts by up to {tilt_deg:.0f}°"
    if others:
        if not does_tilt_matter(leading, others[0], tilt_deg):
            return None
        text = (
            f"{start}, which the paper's equations leave out; yet the heights prefer "
            "them to tilting mechanics, so check L, the push length and the unit of "
            "the heights"
        )
    else:
        reason = config.why_not_tilting() or 'set grasp.mechanics = "auto"'
        text = (
            f"{start}; the paper's equations hold for small tilts, and at 2° and more "
            "θ_c may be off by several degrees beyond its interval. It is not computed "
            f"by tilting mechanics: {reason}"
        )
    return Notice(code="large_tilt", text=text)


@compiled
def _tilt(params: Parameters, pushes: Pushes, grasp: Grasp) -> Float[Array, " n"]:
    return displacements(params, pushes, grasp).tilt
