"""The next push, as one sentence of advice in a result.

The push is that of `pushfit next` for the same table, within `[explore]` and `[reach]`
or as far back as a push went: whichever tells most of an angle that is still open.
Excluded: the choice itself (`pushfit.explore.decide.next_push`).
"""

from dataclasses import replace

import numpy as np

from pushfit.explore.belief.belief import Question
from pushfit.explore.belief.from_fit import belief_from
from pushfit.explore.decide.gain import outlook
from pushfit.explore.decide.intervals import AskedAngle
from pushfit.explore.decide.next_push import Surveyor
from pushfit.explore.limits import Limits
from pushfit.fit.problem.setup import build_problem
from pushfit.fit.results import Identification, Verdict
from pushfit.parameters import ANGLES

# What removing a tenth of the variance of a normal angle tells, -ln(0.9) / 2: a push
# that tells less is not worth recommending [nat].
WORTHWHILE = 0.05


def with_next_push(found: Identification) -> Identification:
    """An identification that says which push would tell most of what is open.

    Returns:
        The same with a sentence for each angle that was asked for and is not
        determined, unless no single push would tell much.
    """
    sentences = [
        sentence
        for angle in (found.theta_c, found.alpha_star)
        if angle.name in found.posterior.samples
        and angle.verdict is not Verdict.DETERMINED
        and (sentence := _sentence(found, angle.name)) is not None
    ]
    told = found.identifiability
    told = replace(told, advice=(*sentences, *told.advice))
    return replace(found, identifiability=told)


def _sentence(found: Identification, angle: str) -> str | None:
    """The best push for one angle in words; None where none is worth making."""
    table, prob = found.table, found.config.report.prob
    low, high = found.config.reach.theta_deg
    pushed = float(np.degrees(np.min(table.theta)))
    low = min(low, pushed) if pushed < 0 else low
    limits = Limits.of(found.config, theta_deg=(low, high))
    question = Question(
        config=found.config,
        ask=(angle,),
        channels=table.channels,
        unit=table.unit,
        sigma=None,
        reference_alpha=float(np.radians(found.reference_alpha_deg)),
    )
    setup = build_problem(table, question.settings)
    belief = belief_from(setup, found.posterior.samples, seed=found.seed)
    survey = Surveyor(question, limits).survey(belief, undecided=question.ask)
    # A push shorter than the others would make no row of the table.
    if survey.length_share < 1 or not np.any(survey.gains > WORTHWHILE):
        return None
    best = int(survey.ranks[0])
    target = AskedAngle(
        values=belief.samples[angle],
        is_axis=angle == "alpha_star" and found.config.reach.is_whole,
        width=np.inf,
        prob=prob,
    )
    heights = survey.predicted.heights[best]
    width = outlook(
        heights, target, weights=belief.weights, sigma=belief.sigma
    ).expected_width
    wide = float(f"{width:.2g}")
    after = f" and is expected to leave a {100 * prob:g} % interval of {wide:g}°"
    return (
        f"One more push at θ = {np.degrees(survey.theta[best]):.0f}°, "
        f"α = {np.degrees(survey.alpha[best]):.0f}° would tell most of "
        f"{ANGLES[angle].prose}{after if np.isfinite(width) else ''}."
    )
