"""Beliefs from the inference: draws of the posterior, or of the prior to begin with.

Excluded: what one more push changes (`pushfit.explore.belief.learning`), and fits
(`pushfit.explore.decide.misfit`).
"""

import contextlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from jaxtyping import Float

from pushfit.config import GraspConfig
from pushfit.data.grasp import is_calibrated, make_grasp
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import FitError
from pushfit.explore.belief.belief import N_BELIEF_DRAWS, Belief, Question
from pushfit.fit.assess.model_free import direction_disagreement, model_free_direction
from pushfit.fit.assess.verdicts import angle_quantity
from pushfit.fit.assess.warnings import (
    INADEQUATE,
    against_prior,
    convergence_warnings,
    untested,
)
from pushfit.fit.checks.model_checking import (
    explains_little,
    missed_features,
    share_explained,
)
from pushfit.fit.checks.predictive import predictive_checks
from pushfit.fit.checks.table_checks import WRONG, settings_warnings
from pushfit.fit.checks.tilt_check import do_draws_tilt, is_tilt_large
from pushfit.fit.identify.fit_table import fit_table
from pushfit.fit.identify.fitted import (
    draw_posterior,
    prepared,
    reach_of,
    reference_azimuth,
)
from pushfit.fit.identify.progress import Stages, posterior_stage
from pushfit.fit.problem.derived import samples_mapping
from pushfit.fit.problem.encoding import prior_x_samples
from pushfit.fit.problem.predictions import predict_draws
from pushfit.fit.problem.setup import Setup, build_problem, n_azimuths
from pushfit.fit.profiles.least_squares import settle_noise
from pushfit.fit.programs.folder import keep_programs
from pushfit.fit.results import FitStatus, PosteriorResult, ResultWarning
from pushfit.fit.sweep.posterior import sweep_posterior
from pushfit.model import Grasp

# Median A of the default priors [N/m]: the height of a push that nobody has made yet.
TYPICAL_STIFFNESS = 571.0
# Noise of a height, as a share of it, where nothing is known of either.
TYPICAL_NOISE = 0.05
# Sweeps that are tried before emcee, and pushes from which it is worth its minutes.
N_SWEEPS, WORTH_A_CHAIN = 4, 10
# Noise in heights that lets a row set the question and leaves the answer alone.
IMMENSE = 1e6


def believe(
    table: PeakTable | None,
    question: Question,
    seed: int,
    *,
    stages: Stages | None = None,
) -> Belief:
    """What a table of pushes leaves to be believed.

    Where the settings leave the mechanics open and the tilt is large, both are drawn
    by, and those lead that would lead its identification.

    Args:
        stages: Hears which mechanics draws are made by. Without, the log says where
            programs are kept that a first call compiles for minutes.

    Returns:
        `N_BELIEF_DRAWS` draws of the posterior, or of the prior without a usable push,
        or where there are none of the posterior.
    """
    if table is None or not np.any(table.is_used):
        return _prior_belief(question, seed)
    if stages is None:  # a caller in Python, who sees no progress
        keep_programs()
    stages = stages or Stages(())
    settings, warnings = prepared(table, question.settings)
    asked = _with_open_direction(table, question)
    if asked is not table and len(settings.by_mechanics()) > 1:
        # What is asked turns no choice of the mechanics.
        leading = _leading(table, settings, seed, stages)
        settings = settings if leading is None else leading.settings
    drawn = _leading(asked, settings, seed, stages)
    if drawn is None:
        return replace(_prior_belief(question, seed), warnings=warnings)
    belief = belief_from(drawn.setup, drawn.posterior.samples, seed=seed)
    wrong = [WRONG[one.code] for one in warnings if one.code in WRONG]
    told = _told_by_draws(drawn, wrong, n_told=table.n_pushes, seed=seed)
    return replace(belief, warnings=(*warnings, *told))


@dataclass(frozen=True, slots=True, kw_only=True)
class _Drawn:
    table: PeakTable
    settings: GraspConfig
    setup: Setup
    posterior: PosteriorResult


def _leading(
    table: PeakTable, settings: GraspConfig, seed: int, stages: Stages
) -> _Drawn | None:
    """Draws by the mechanics that would lead the identification of a table."""
    first, *others = settings.by_mechanics()
    stages.begin(posterior_stage(first))
    drawn = _drawn(table, first, seed)
    if drawn is None or not others or not is_tilt_large(drawn.setup, drawn.posterior):
        return drawn
    stages.begin(posterior_stage(others[0]))
    other = _drawn(table, others[0], seed)
    prob = settings.report.prob
    if other is not None and do_draws_tilt(drawn.posterior, other.posterior, prob=prob):
        return other
    return drawn


def _drawn(table: PeakTable, settings: GraspConfig, seed: int) -> _Drawn | None:
    """Draws by the sweep, or where they are not to be trusted by emcee.

    A few heights, which leave a posterior of more than one kind, may be drawn well by
    another seed, and emcee would take minutes for them; an exploration waits for more.

    Returns:
        None where neither gives any.
    """
    setup = build_problem(table, settings)
    reference_alpha = reference_azimuth(table, settings)
    # Who waits for the next push is to have one, whatever the heights.
    with contextlib.suppress(FitError):
        if setup.noise.follows_fit:
            setup = settle_noise(setup, reference_alpha)
        for k in range(N_SWEEPS):
            posterior = sweep_posterior(
                setup,
                seed=seed + k,
                reference_alpha=reference_alpha,
                reach=reach_of(settings),
            )
            if posterior.status is FitStatus.OK:
                return _Drawn(
                    table=table, settings=settings, setup=setup, posterior=posterior
                )
        if len(setup.rows) >= WORTH_A_CHAIN:
            fitted = fit_table(table, settings)
            posterior = draw_posterior(fitted, seed=seed, engine="emcee")
            return _Drawn(
                table=fitted.table,
                settings=settings,
                setup=fitted.setup,
                posterior=posterior,
            )
    return None


def _told_by_draws(
    drawn: _Drawn, wrong: Sequence[str], *, n_told: int, seed: int
) -> Iterator[ResultWarning]:
    """What an identification by these draws would say of them.

    Args:
        wrong: What cannot be right, whatever the draws.
        n_told: Pushes of the table, before what keeps a direction open.
    """
    table, posterior, prob = drawn.table, drawn.posterior, drawn.settings.report.prob
    yield from convergence_warnings(posterior)
    if "alpha_star" in posterior.samples:
        reach = drawn.settings.reach
        quantity = angle_quantity(
            "alpha_star", posterior, None, prob=prob, is_axis=reach.is_whole
        )
        free = model_free_direction(table, reach=reach, prob=prob, seed=seed)
        yield from direction_disagreement(
            quantity,
            free,
            table,
            grasp=drawn.setup.problem.grasp,
            predict=partial(_likeliest_heights, drawn),
        )
    checks = predictive_checks(table, drawn.setup, posterior, seed=seed)
    missed = missed_features(checks) or _unexplained(drawn, n_told)
    if wrong:
        missed = f"{wrong[0]} cannot be right"
    if missed is not None:
        yield ResultWarning(
            code=INADEQUATE, text=f"the model does not describe the heights: {missed}"
        )
    else:
        problem = drawn.setup.problem
        yield from untested(int(np.count_nonzero(problem.mask)) - problem.n_free)
    yield from against_prior(drawn.settings, posterior, is_adequate=missed is None)


def _unexplained(drawn: _Drawn, n_told: int) -> str | None:
    """That the likeliest draw explains too little, as a clause.

    As of a fit it is asked where neither a stated noise nor repeats judge the model.
    """
    table, setup = drawn.table, drawn.setup
    problem, rows = setup.problem, np.array([r for r in setup.rows if r < n_told])
    has_repeats = np.unique(table.groups[rows]).size < rows.size
    if setup.noise.kind == "given" or has_repeats:
        return None
    heights = _likeliest_heights(drawn, problem.angles)
    observed = np.asarray(problem.observed)[:, : rows.size]
    off = problem.differences(heights[None])[0, :, : rows.size]
    channel = np.repeat(np.array(problem.channels), rows.size)
    r_squared = share_explained(observed.ravel(), (observed + off).ravel(), channel)
    return explains_little(r_squared, table, rows, n_free=problem.n_free)


def _likeliest_heights(
    drawn: _Drawn, angles: Float[np.ndarray, "2 n"]
) -> Float[np.ndarray, "c n"]:
    """What the likeliest draw gives for pushes along θ and α [rad]."""
    posterior = drawn.posterior
    likeliest = [int(np.argmax(posterior.log_prob))]
    draw = {name: values[likeliest] for name, values in posterior.samples.items()}
    return predict_draws(drawn.setup.problem, draw, angles).heights[0]


def _prior_belief(question: Question, seed: int) -> Belief:
    """Draws of the prior, of which a made-up push only sets the scale."""
    setup = build_problem(_made_up(question), question.settings)
    rng = np.random.default_rng(seed)
    x = prior_x_samples(setup.problem, rng, N_BELIEF_DRAWS)
    reach = reach_of(question.settings)
    samples = samples_mapping(setup.problem, x, question.reference_alpha, reach=reach)
    belief = belief_from(setup, samples, seed=seed, is_guess=True)
    told = settings_warnings(question.config, question.unit)
    return replace(belief, warnings=tuple(told))


def _made_up(question: Question) -> PeakTable:
    """Pushes that nobody made: they say which numbers are free, and their scale."""
    grasp = make_grasp(question.settings, question.unit)
    height = TYPICAL_STIFFNESS * float(grasp.push_length * grasp.gain)
    sigma = question.sigma
    if not is_calibrated(question.config, question.unit):
        height = _typical_height(grasp, sigma) or height
    reach = reach_of(question.settings)
    azimuths = [question.reference_alpha]
    if "alpha_star" in question.ask:
        azimuths.append(_other_azimuth(question.reference_alpha, reach))
    n = len(azimuths)
    given = (
        None if sigma is None else dict.fromkeys(question.channels, np.full(n, sigma))
    )
    return PeakTable.from_arrays(
        theta=np.full(n, np.pi / 4),
        alpha=np.asarray(azimuths),
        heights=dict.fromkeys(question.channels, np.full(n, height)),
        unit=question.unit,
        sd=given,
    )


def _typical_height(grasp: Grasp, sigma: float | None) -> float | None:
    """Height in the unit of a sensor without a scale, as far as anything tells it.

    A preload comes before the noise: a finger that must not lift off is pressed on
    about as hard as it pushes, while a good sensor scatters by far less than 5 %.
    """
    preload = float(grasp.preload * grasp.gain)
    if preload > 0:
        return preload
    return None if sigma is None else sigma / TYPICAL_NOISE


def _with_open_direction(table: PeakTable, question: Question) -> PeakTable:
    """Ask for the ellipse also before a second azimuth was pushed.

    A row that says nothing, at another azimuth, keeps the ellipse among what is free.
    """
    used = table.is_used
    if "alpha_star" not in question.ask or n_azimuths(table.alpha[used]) > 1:
        return table
    alpha = float(table.alpha[used][0])
    other = _other_azimuth(alpha, reach_of(question.settings))
    heights, sds = {}, {}
    for channel in table.channels:
        own = table.heights(channel)
        typical = float(np.max(np.abs(own[used])))
        sd = table.sd(channel)
        stated = np.full(own.size, 1e-3 * TYPICAL_NOISE * typical) if sd is None else sd
        heights[channel] = np.append(own, typical)
        sds[channel] = np.append(stated, IMMENSE * typical)
    return PeakTable.from_arrays(
        theta=np.append(table.theta, np.pi / 4),
        alpha=np.append(table.alpha, other),
        heights=heights,
        unit=table.unit,
        sd=sds,
        flags=(*(";".join(sorted(words)) for words in table.flags), ""),
    )


def _other_azimuth(alpha: float, reach: tuple[float, float]) -> float:
    """An azimuth as far from another as the reach allows, at most a quarter turn."""
    low, high = reach
    ends = [min(alpha + np.pi / 2, high), max(alpha - np.pi / 2, low)]
    return float(max(ends, key=lambda end: abs(end - alpha)))


def belief_from(
    setup: Setup,
    samples: Mapping[str, Float[np.ndarray, " n"]],
    *,
    seed: int,
    is_guess: bool = False,
) -> Belief:
    """Draws as a belief, padded without weight to what programs are compiled for.

    Args:
        samples: Draws of equal weight by name.
    """
    problem, noise = setup.problem, setup.noise
    n = next(iter(samples.values())).size
    rng = np.random.default_rng([seed, n])
    rows = rng.permutation(n)[:N_BELIEF_DRAWS]
    is_own = np.arange(N_BELIEF_DRAWS) < rows.size
    rows = np.resize(rows, N_BELIEF_DRAWS)
    kept = {name: np.asarray(values)[rows] for name, values in samples.items()}
    for name in ("e1", "e2"):
        fixed = float(problem.fixed.get(name, 0.0))
        kept.setdefault(name, np.full(N_BELIEF_DRAWS, fixed))
    used = list(setup.rows)
    scatter, sd = [], []
    for channel, settled in zip(problem.channels, np.asarray(problem.sd), strict=True):
        known = noise.sd[channel][used]
        # Rows that say nothing are not what the next push is like.
        sd.append(float(np.median(known)))
        own = kept.get(f"sigma_{channel}")
        if own is None:
            pooled = float(np.median(noise.sigma[channel][used]))
            own = np.full(N_BELIEF_DRAWS, pooled if noise.kind == "pooled" else 0.0)
        # Errors of the angles, and noise in proportion to the height.
        added = np.maximum(settled[: len(used)] ** 2 - known**2, 0.0)
        scatter.append(np.hypot(own, np.sqrt(np.median(added))))
    return Belief(
        samples=kept,
        log_weights=np.where(is_own, 0.0, -np.inf),
        scatter=np.stack(scatter),
        sd=np.asarray(sd),
        is_sd_used=noise.kind != "pooled",
        channels=problem.channels,
        grasp=problem.grasp,
        likelihood=problem.likelihood,
        is_guess=is_guess,
    )
