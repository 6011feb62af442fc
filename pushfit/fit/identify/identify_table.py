"""One table through every question: fit, profiles, posterior, checks, advice.

This is the only place that knows the order of things; commands, batches and reports
all start from `identify_table`. Excluded: how each is answered (`pushfit.fit.profiles`,
`pushfit.fit.sweep`, `pushfit.fit.assess`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from pushfit.config import GraspConfig
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.assess.advice import measurements
from pushfit.fit.assess.bands import prediction_bands
from pushfit.fit.assess.identifiability import identifiability
from pushfit.fit.assess.model_free import model_free_direction
from pushfit.fit.assess.reporting_rules import reported
from pushfit.fit.assess.sensitivity import angle_error_warnings
from pushfit.fit.assess.verdicts import angle_quantity, quantities
from pushfit.fit.assess.warnings import (
    handover_warnings,
    improbable,
    result_warnings,
)
from pushfit.fit.checks.leave_one_out import LeftOut, unpredicted
from pushfit.fit.checks.model_checking import contradicted_quantities
from pushfit.fit.checks.push_order import follows_elevation
from pushfit.fit.checks.table_checks import WRONG
from pushfit.fit.checks.tilt_check import implied_tilt_deg, tilt_warning
from pushfit.fit.checks.violations import violation_warnings
from pushfit.fit.identify.by_mechanics import (
    fitted_by_leading,
    mechanics_answer,
    profiles_of,
)
from pushfit.fit.identify.fitted import (
    Fitted,
    Listener,
    check_engine,
    draw_posterior,
    goodness_of,
)
from pushfit.fit.identify.other_readings import other_reading
from pushfit.fit.identify.progress import Stages, stages_of
from pushfit.fit.profiles.conditional_likelihood import imposable
from pushfit.fit.results import (
    GoodnessOfFit,
    Identification,
    LikelihoodProfile,
    MechanicsAnswer,
    PosteriorResult,
    Quantity,
    ResultWarning,
)
from pushfit.fit.results.environment import environment
from pushfit.fit.sampler.checkpoint import check_checkpoint
from pushfit.parameters import ANGLES


def identify_table(
    table: PeakTable,
    config: GraspConfig,
    *,
    seed: int,
    engine: str = "auto",
    is_brief: bool = False,
    stages: Stages | None = None,
    listener: Listener | None = None,
    checkpoint: Path | None = None,
) -> Identification:
    """Everything that a table of peak heights can tell.

    Args:
        engine: "sweep", "emcee", or "auto" for the sweep with emcee where its draws
            are not to be trusted.
        is_brief: Whether to leave out what one row of a table has no place for: sets
            of parameters and combinations, advice, and bands.
        stages: Tells how far the work is; has those of `stages_of`.
        listener: Hears of every answer as soon as it is known.
        checkpoint: File in which a run of emcee is kept, to be resumed.

    Returns:
        The identification; its status says whether intervals may be believed.

    Raises:
        DataError: If no usable push is left.
        ConfigError: If the configuration does not fit the table or the engine.
        FitError: If no start gives finite residuals or a finite density, or the solver
            stopped at its step limit.
        ConvergenceError: If the posterior density is infinite at some point.
    """
    check_engine(engine)
    if checkpoint is not None:
        check_checkpoint(checkpoint)
    stages = stages or Stages(stages_of(config, engine))
    hearing = listener or Listener()
    fitted, others = fitted_by_leading(
        table, config, seed=seed, stages=stages, hearing=hearing
    )
    stages.begin(f"likelihood sets by {fitted.mechanics} mechanics")
    profiles = profiles_of(fitted, tuple(ANGLES) if is_brief else None)
    if len(config.by_mechanics()) == 1:
        hearing.confined(fitted, profiles.get("theta_c"))
        stages.begin(f"posterior by {fitted.mechanics} mechanics")
    if engine == "emcee":
        stages.begin("emcee")
    posterior = draw_posterior(
        fitted,
        seed=seed,
        engine=engine,
        progress=stages.within,
        checkpoint=checkpoint,
    )
    stages.begin("checks")
    return _conclude(
        fitted,
        profiles,
        posterior,
        others=others,
        seed=seed,
        is_brief=is_brief,
    )


def _conclude(
    fitted: Fitted,
    profiles: Mapping[str, LikelihoodProfile],
    posterior: PosteriorResult,
    *,
    others: tuple[MechanicsAnswer, ...],
    seed: int,
    is_brief: bool,
) -> Identification:
    """All that fit, profiles and posterior say together."""
    prob, problem = fitted.config.report.prob, fitted.setup.problem
    theta_c = angle_quantity("theta_c", posterior, profiles.get("theta_c"), prob=prob)
    parameters, combinations = quantities(
        fitted.setup,
        posterior,
        profiles,
        prob=prob,
        unit=fitted.table.unit,
        with_sets=not is_brief,
    )
    left_out = unpredicted(
        fitted.setup, fitted.fit, reference_alpha=fitted.reference_alpha
    )
    contradicted = contradicted_quantities(posterior.samples, profiles, prob=prob)
    goodness, reading = _judged(
        fitted, posterior, seed=seed, contradicted=contradicted, left_out=left_out
    )
    found = Identification(
        table=fitted.table,
        used=fitted.table.is_used,
        config=fitted.config,
        fit=fitted.fit,
        posterior=posterior,
        by_mechanics=(mechanics_answer(fitted, posterior, theta_c), *others),
        theta_c=theta_c,
        reference_alpha_deg=float(np.degrees(fitted.reference_alpha)),
        alpha_star=_alpha_star(fitted, posterior, profiles),
        alpha_star_model_free=model_free_direction(
            fitted.table, reach=fitted.config.reach, prob=prob, seed=seed
        ),
        parameters=parameters,
        combinations=combinations,
        profiles=profiles,
        identifiability=identifiability(
            problem,
            posterior.ordered,
            posterior.prior_samples,
        ),
        goodness_of_fit=goodness,
        bands=()
        if is_brief
        else prediction_bands(
            fitted.table,
            problem,
            fitted.fit,
            samples=posterior.samples,
            prob=prob,
        ),
        warnings=(
            *fitted.warnings,
            *([] if reading is None else [reading]),
            *handover_warnings(posterior),
        ),
        status=posterior.status,
        seed=seed,
        versions=environment(),
    )
    return _with_words(fitted, reported(found), left_out, is_brief=is_brief)


def _alpha_star(
    fitted: Fitted,
    posterior: PosteriorResult,
    profiles: Mapping[str, LikelihoodProfile],
) -> Quantity:
    """The best push direction; by draws where no fit can be held at one."""
    problem = fitted.setup.problem
    return angle_quantity(
        "alpha_star",
        posterior,
        profiles.get("alpha_star"),
        prob=fitted.config.report.prob,
        is_axis=fitted.config.reach.is_whole,
        by_draws="f1" in problem.data_names and "alpha_star" not in imposable(problem),
    )


def _judged(
    fitted: Fitted,
    posterior: PosteriorResult,
    *,
    seed: int,
    contradicted: Sequence[str],
    left_out: tuple[LeftOut, ...],
) -> tuple[GoodnessOfFit, ResultWarning | None]:
    """The goodness of a fit in view of other readings of the table, and the best one.

    None is looked for where nothing is strange, or the table cannot be right anyway.
    """
    goodness = goodness_of(
        fitted, posterior, seed=seed, contradicted=contradicted, left_out=left_out
    )
    # Without a stated noise, or repeats, any table is adequate.
    is_strange = (
        goodness.p_value is None
        or not goodness.is_adequate
        or improbable(fitted.config, posterior)
    )
    wrong = [WRONG[w.code] for w in fitted.warnings if w.code in WRONG]
    reading = None
    if is_strange and not wrong:
        known = {seed: posterior} if posterior.engine == "sweep" else fitted.swept
        reading = other_reading(replace(fitted, swept=known), seed=seed)
    if goodness.is_adequate and (wrong or reading is not None):
        but = "far better if the table is read otherwise"
        if wrong:
            but = f"{wrong[0]} cannot be right"
        sentence = f"{goodness.sentence[:-1]}, but {but}."
        goodness = replace(goodness, is_adequate=False, sentence=sentence)
    return goodness, reading


def _with_words(
    fitted: Fitted,
    found: Identification,
    left_out: tuple[LeftOut, ...],
    *,
    is_brief: bool,
) -> Identification:
    """The result with what its verdicts warn of and call for."""
    setup = fitted.setup
    tilt_deg = implied_tilt_deg(setup, found.posterior)
    tilt = tilt_warning(fitted.config, found.by_mechanics, tilt_deg)
    advice = measurements(
        setup.problem,
        verdicts={q.name: q.verdict for q in (found.theta_c, found.alpha_star)},
        is_calibrated=setup.is_calibrated,
        has_direction=setup.has_direction,
        is_ordered=follows_elevation(fitted.table),
    )
    told = replace(found.identifiability, advice=() if is_brief else advice)
    # One push that is off may look like anything.
    shown = () if left_out else fitted.shown
    return replace(
        found,
        identifiability=told,
        warnings=(
            *found.warnings,
            *result_warnings(setup, found, left_out),
            *violation_warnings(shown, is_adequate=found.goodness_of_fit.is_adequate),
            *angle_error_warnings(setup, found, fitted.slopes),
            *([] if tilt is None else [tilt]),
        ),
    )
