"""Warnings that travel with a result: each has a stable code and a sentence.

Excluded: what a table says by itself (`pushfit.fit.checks.table_checks`), and whether
the model describes the heights (`pushfit.fit.checks.model_checking`).
"""

from collections.abc import Iterator, Sequence
from functools import partial

import jax
import numpy as np

from pushfit.config import GraspConfig
from pushfit.data.tables.peak_table import PeakTable
from pushfit.data.text.faults import listed
from pushfit.fit.assess.model_free import direction_disagreement
from pushfit.fit.checks.leave_one_out import LeftOut, unlike_words
from pushfit.fit.checks.model_checking import (
    LEVEL,
    MIN_TESTED,
    chance_of_more,
    label,
)
from pushfit.fit.problem.derived import median
from pushfit.fit.problem.noise import stated_sds
from pushfit.fit.problem.predictions import predict_points
from pushfit.fit.problem.problem import STUDENT_DOF, STUDENT_SCALE
from pushfit.fit.problem.setup import Setup
from pushfit.fit.profiles.weights import likeliest_scale
from pushfit.fit.results import (
    OUTLIER_SIGMA,
    FitResult,
    FitStatus,
    Identification,
    PosteriorResult,
    ResultWarning,
    Verdict,
)
from pushfit.model import as_float, contact
from pushfit.parameters import NAMED, STIFFNESSES

# Codes by which others know that numbers are not to be quoted.
INADEQUATE, SCATTERED = "model_inadequate", "scatter_exceeds_sd"
NOT_CONVERGED = FitStatus.NOT_CONVERGED.name.lower()
# Share of the range of a uniform prior beside a bound, and of a posterior in it that is
# pressed against the bound: twice what is there where heights say nothing.
EDGE, PRESSED = 0.05, 0.1
# Chance, beforehand, of a transition so soft that something else is likelier. At two
# thirds 18 instead of 22 of 27 tables are told of, where a preload, a drift, an offset
# or cross-talk made θ_c wrong by 10° and more; none of 24 that were right is.
SOFT = 0.15
# Share of the tallest height by which none is lower than a lifted finger reads: the
# zero of a sensor drifts. At twice a preload stated half as large passes in the test;
# half changes none.
LOWER = 0.1
# Of the pushes; where more are far from the fit, the model is what does not fit.
FEW_OUTLIERS = 0.25
# Verdicts that need no words, or have had them.
SAID = frozenset(
    {Verdict.DETERMINED, Verdict.ABSENT, Verdict.UNKNOWN, Verdict.PROVISIONAL}
)


def lost_contact_rows(setup: Setup, fit: FitResult) -> tuple[int, ...]:
    """Rows of the table whose push lifted the finger off, by the best fit.

    Returns:
        Rows; by linear mechanics none without a preload, which are even in θ then.
    """
    problem = setup.problem
    found = predict_points(problem, fit.estimate[None], problem.angles)
    is_lost = ~found.in_contact[0, : len(setup.rows)]
    return tuple(row for row, lost in zip(setup.rows, is_lost, strict=True) if lost)


def contact_warnings(
    table: PeakTable, config: GraspConfig, rows: tuple[int, ...], *, fit: FitResult
) -> Iterator[ResultWarning]:
    """Say which pushes were left out because the finger lifted off, and if it cannot.

    A finger that is lifted reads minus the preload, and nothing reads less.
    """
    names = ", ".join(label(table, row) for row in rows)
    yield ResultWarning(
        code="lost_contact",
        text=f"these pushes lifted the finger off and were left out: {names}",
    )
    preload = config.preload_in(table.unit)
    if preload == "estimate" or "height" not in table.channels:
        return
    heights = table.heights("height")
    tallest = float(np.max(np.abs(heights[table.is_used])))
    noise = OUTLIER_SIGMA * float(np.max(fit.sigma))
    row = min(rows, key=heights.__getitem__)
    if heights[row] < -preload - LOWER * tallest - noise:
        yield ResultWarning(
            code="preload_contradicted",
            text=f"a finger that is lifted off reads {-preload:g} {table.unit}, but "
            f"{label(table, row)} reads {heights[row]:.3g}: the preload was larger "
            f"than {preload:g}, and θ_c is wrong with it; state "
            f'grasp.preload_{table.unit} as it was, or as "estimate"',
        )


def scatter_warning(
    table: PeakTable, setup: Setup, fit: FitResult
) -> ResultWarning | None:
    """Say so where given standard deviations do not explain the scatter."""
    chance, times = _scatter(table, setup, fit)
    if chance > LEVEL:
        return None
    return ResultWarning(
        code=SCATTERED,
        text=f"heights scatter {times:.1f} times as much about the fit as their "
        "standard deviations say; either these are too small or the model misses "
        "something. The extra scatter is estimated and widens every interval",
    )


def low_scatter_warning(
    table: PeakTable, setup: Setup, fit: FitResult
) -> ResultWarning | None:
    """Say so where heights scatter less than given standard deviations say."""
    chance, times = _scatter(table, setup, fit)
    if chance < 1 - LEVEL:
        return None
    return ResultWarning(
        code="scatter_below_sd",
        text=f"heights scatter {times:.2g} times as much about the fit as their "
        "standard deviations say; if these are too large, so are the intervals",
    )


def _scatter(table: PeakTable, setup: Setup, fit: FitResult) -> tuple[float, float]:
    """Chance of more scatter by given standard deviations, and how many it is of them.

    Where more is sampled beside them, both are known only if that is of one size.

    Returns:
        Half, and one, where nothing is given that says.
    """
    noise, sds, chi_square = setup.noise, stated_sds(table), fit.chi_square
    is_sampled = noise.kind == "sampled"
    is_unknown = is_sampled and (noise.follows_fit or noise.shared)
    dof = fit.degrees_of_freedom
    if sds is None or noise.kind == "pooled" or dof < 1 or is_unknown:
        return 0.5, 1.0
    own, likelihood = fit.sigma, setup.problem.likelihood
    if is_sampled:
        stated = [sds[c][r] for c, r in zip(fit.channel, fit.row, strict=True)]
        own = np.array(stated)
        chi_square *= float(np.mean((fit.sigma / own) ** 2))
    times = np.sqrt(chi_square / dof)
    if likelihood == "student_t":
        observed = np.asarray(setup.problem.observed)[np.asarray(setup.problem.mask)]
        scaled = (observed - fit.predicted) / own / STUDENT_SCALE
        deviances = (STUDENT_DOF + 1) * np.log1p(scaled**2 / STUDENT_DOF)
        chi_square, times = float(np.sum(deviances)), likeliest_scale(scaled)
    return chance_of_more(chi_square, dof, likelihood), times


def result_warnings(
    setup: Setup, found: Identification, left_out: Sequence[LeftOut] = ()
) -> Iterator[ResultWarning]:
    """What the finished result says.

    Args:
        left_out: Pushes that the others do not predict.
    """
    posterior, goodness = found.posterior, found.goodness_of_fit
    if not goodness.is_adequate:
        yield ResultWarning(code=INADEQUATE, text=goodness.sentence)
    else:
        yield from untested(goodness.degrees_of_freedom)
    yield from against_prior(found.config, posterior, is_adequate=goodness.is_adequate)
    if left_out:
        words = unlike_words(left_out, partial(label, found.table), found.table.unit)
        yield ResultWarning(
            code="outliers",
            text=f"{words}; look at it in the recording, and leave it out if it was "
            "no push",
        )
    elif 0 < len(goodness.outliers) <= FEW_OUTLIERS * np.sum(found.used):
        names = listed(goodness.outliers)
        yield ResultWarning(
            code="outliers",
            text=f"more than {OUTLIER_SIGMA:g} sigma from the fit: {names}; look at "
            "them in the recording, and leave out what was no push; others may show "
            "only then",
        )
    low = low_scatter_warning(found.table, setup, found.fit)
    if low is not None:
        yield low
    yield from convergence_warnings(posterior)
    for quantity, symbol in ((found.theta_c, "θ_c"), (found.alpha_star, "α*")):
        is_asked = quantity.name in posterior.samples
        if is_asked and quantity.verdict not in SAID:
            words = quantity.verdict.value.replace("_", " ")
            text = f"{symbol}: {words} by these data"
            if quantity.verdict is Verdict.WIDE and quantity.interval is not None:
                low, high = quantity.interval
                wanted = found.config.report.wanted_width_deg
                text = (
                    f"{symbol}: its interval is {high - low:.0f}° wide, and [report] "
                    f"wanted_width_deg is {wanted:g}; more pushes narrow it"
                )
            yield ResultWarning(
                code=f"{quantity.name}_{quantity.verdict.value}", text=text
            )
    best = found.fit.estimate[None]
    yield from direction_disagreement(
        found.alpha_star,
        found.alpha_star_model_free,
        found.table,
        grasp=setup.problem.grasp,
        predict=lambda angles: predict_points(setup.problem, best, angles).heights[0],
    )
    yield from bound_warnings(setup, posterior)


def untested(degrees_of_freedom: int) -> Iterator[ResultWarning]:
    """Say so where heights are hardly more than unknowns."""
    if degrees_of_freedom < MIN_TESTED:
        few = f"exceed unknowns by {degrees_of_freedom} only"
        if degrees_of_freedom <= 0:
            few = f"are {'fewer than' if degrees_of_freedom else 'as many as'} unknowns"
        yield ResultWarning(
            code="model_untested",
            text=f"heights {few}, which would not show an outlier or a wrong model, "
            "and intervals take both for absent; push more directions, or each of "
            "them twice",
        )


def improbable(config: GraspConfig, posterior: PosteriorResult) -> tuple[str, ...]:
    """Letters of what heights fix, and have where priors hardly have a draw."""
    if posterior.status is not FitStatus.OK:
        return ()
    found = []
    for name in ("A", "B", "C_rr"):
        draws, before = posterior.ordered[name], posterior.prior_samples[name]
        is_quoted = config.push.length_known or name not in STIFFNESSES
        share = float(np.mean(before <= median(draws)))
        if is_quoted and np.ptp(before) > 0 and min(share, 1 - share) < LEVEL / 2:
            found.append(NAMED[name].prose)
    return tuple(found)


def against_prior(
    config: GraspConfig, posterior: PosteriorResult, *, is_adequate: bool
) -> Iterator[ResultWarning]:
    """What would hardly be so by what is known beforehand.

    Args:
        is_adequate: Whether the model describes the heights; if not, its transition
            says nothing.
    """
    names = improbable(config, posterior)
    if names:
        yield ResultWarning(
            code="far_from_prior",
            text=f"{' and '.join(names)} would be so far out once in 1000 by what is "
            "known beforehand; look at the units, the push length and how angles are "
            "counted, or state a prior that allows for it",
        )
    is_trusted = posterior.status is FitStatus.OK and is_adequate
    if not is_trusted or "p" not in posterior.samples:
        return
    sharpness = median(posterior.ordered["p"])
    if np.mean(posterior.prior_samples["p"] <= sharpness) < SOFT:
        yield ResultWarning(
            code="unusually_soft",
            text=f"the transition is softer (p = {sharpness:.1f}) than {1 - SOFT:.0%} "
            "are by what is known beforehand; a sensor whose zero is off, a preload "
            "that is not stated, a drift in the order of θ, or one component in the "
            "other would look the same, with another θ_c: rule these out, or state a "
            "prior of p that allows for it",
        )


def bound_warnings(setup: Setup, posterior: PosteriorResult) -> Iterator[ResultWarning]:
    """Say where a posterior is pressed against the bound of a uniform prior."""
    for name, prior in setup.problem.priors.items():
        if prior.kind != "uniform" or name not in posterior.samples:
            continue
        low, high = float(prior.first), float(prior.second)
        draws = posterior.samples[name]
        edge = EDGE * (high - low)
        for bound, share in (
            (low, np.mean(draws < low + edge)),
            (high, np.mean(draws > high - edge)),
        ):
            if share > PRESSED:
                yield ResultWarning(
                    code="bound_touched",
                    text=f"{name} presses against its bound {bound:g}; its interval is "
                    "one of the prior, so widen the bound or accept one side",
                )


def contradiction_warning(setup: Setup, fit: FitResult) -> ResultWarning | None:
    """Say so where fixed parameters cannot give the stiffness that the heights show."""
    fixed = {name: float(value) for name, value in setup.problem.fixed.items()}
    if not {"K_sn", "K_dn", "K_st"} & set(fixed):
        return None
    group = contact(setup.problem.data_state(as_float(fit.estimate)).params)
    A, B = (float(value) for value in jax.tree.leaves((group.A, group.B)))
    for name, found in (("K_sn", A), ("K_dn", A), ("K_st", B)):
        if name in fixed and fixed[name] < found:
            symbol = "A" if found == A else "B"
            return ResultWarning(
                code="fixed_value_contradicted",
                text=f"{name} is fixed at {fixed[name]:g}, but the heights want a "
                f"series stiffness {symbol} of {found:.3g}, which cannot exceed it; "
                "check the fixed value, the push length and the calibration",
            )
    return None


def convergence_warnings(posterior: PosteriorResult) -> Iterator[ResultWarning]:
    """Say so where draws are not to be trusted, and why."""
    if posterior.status is FitStatus.OK:
        return
    problems = posterior.diagnostics.problems if posterior.diagnostics else ()
    if posterior.engine == "sweep":
        problems = (
            f"of the weighted draws {posterior.ess or 0:.0f} count, and the tail "
            f"of their weights has the shape {posterior.pareto_k or np.nan:.2f}",
            'the engines "auto" and "emcee" do without weights',
        )
    yield ResultWarning(
        code=posterior.status.name.lower(),
        text="; ".join([posterior.status.value, *problems]),
    )


def handover_warnings(posterior: PosteriorResult) -> tuple[ResultWarning, ...]:
    """What to know where the sweep left a posterior to emcee."""
    if posterior.engine != "emcee" or posterior.pareto_k is None:
        return ()
    text = (
        f"the weighted draws of the sweep were not to be trusted (effective draws "
        f"{posterior.ess or 0:.0f}, Pareto k {posterior.pareto_k:.2f}); these are from "
        "emcee, which gives no evidence"
    )
    return (ResultWarning(code="handed_to_emcee", text=text),)
