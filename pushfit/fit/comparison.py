"""Hard, soft or no rolling, linear or tilting: which model the heights speak for.

Each is a fit of the same pushes with the same priors. They differ in how rolling sets
in, by the paper's switch, by a soft minimum, or never, in whether the object tilts, and
in their noise. Two criteria are kept apart: the evidence, which weighs priors, and the
density of each push predicted from all others (leave-one-out), which hardly does.
Excluded: text for readers (`pushfit.report.text.comparison`).
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from pushfit.arguments import checked
from pushfit.config import GraspConfig
from pushfit.config.rivals import NOISES, rival_configs
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import DataError, check_seed
from pushfit.fit.checks.push_densities import PushDensities, push_densities
from pushfit.fit.checks.table_checks import WRONG, table_warnings
from pushfit.fit.identify.beside import Beside
from pushfit.fit.identify.by_mechanics import fitted_by_leading
from pushfit.fit.identify.fitted import (
    Fitted,
    Listener,
    draw_posterior,
    goodness_of,
)
from pushfit.fit.identify.progress import Progress, Stages
from pushfit.fit.problem.noise import with_plain_noise
from pushfit.fit.problem.repeats.effects import both_ways, is_crossed
from pushfit.fit.problem.setup import build_problem
from pushfit.fit.profiles.least_squares import fit_least_squares, settle_noise
from pushfit.fit.results import FitStatus

# Differences below these tell nothing: a factor of e between evidences; between
# predictive densities two standard errors, and 4, since standard errors of models that
# predict nearly alike are too small (Sivula, Magnusson and Vehtari, arXiv:2008.10296):
# `python -m benchmarks.inference.elpd_errors` finds 0.059 where differences have a
# standard deviation of 0.078.
MIN_LOG_BAYES_FACTOR, MIN_STANDARD_ERRORS, MIN_ELPD = 1.0, 2.0, 4.0
# Standard deviations of every height within this share are one noise: those that two
# searches find for errors of angles differ by less, and what it is worth is too.
SAME_NOISE = 1e-3
# Said where no model has an evidence.
NO_EVIDENCE = "the weights of every sweep have too heavy a tail, and emcee gives none"


@dataclass(frozen=True, slots=True, kw_only=True)
class ModelScore:
    """One model and how well it accounts for the pushes.

    Args:
        name: "hard", "soft" or "no_rolling" by the mechanics that lead;
            "tilting" or "linear" for a hard transition by the other mechanics;
            a key of `NOISES` of the rivals for other noise, all else as configured.
        sharpness: Sharpness of the transition, infinite for a hard switch; None where
            it is one of the unknowns.
        is_adequate: Whether it describes the heights within their noise.
        verdict: The same in a sentence.
        log_evidence: ln p(h); None where the sweep was not to be trusted.
        log_evidence_error: Its standard error.
        densities: Leave-one-out densities; None where draws are not to be trusted, and
            with effects of repeats, which pushes have in common.
        engine: "sweep" or "emcee".
        status: Whether its posterior is to be trusted.
        log_bayes_factor: Log evidence minus the highest of all models.
        elpd_difference: Sum of the densities minus the highest of all models.
        elpd_difference_se: Standard error of the difference; 0 for the best, and None
            for a single push.
    """

    name: str
    sharpness: float | None
    is_adequate: bool
    verdict: str
    log_evidence: float | None
    log_evidence_error: float | None
    densities: PushDensities | None
    engine: str
    status: FitStatus
    log_bayes_factor: float | None = None
    elpd_difference: float | None = None
    elpd_difference_se: float | None = None

    @property
    def elpd_loo(self) -> float | None:
        """Sum of the log leave-one-out densities of all pushes."""
        return None if self.densities is None else float(np.sum(self.densities.elpd))

    @property
    def elpd_loo_se(self) -> float | None:
        """Standard error of `elpd_loo`, from its scatter over pushes."""
        return None if self.densities is None else _sum_se(self.densities.elpd)

    @property
    def p_loo(self) -> float | None:
        """Effective number of parameters by leaving pushes out [-]."""
        return None if self.densities is None else float(np.sum(self.densities.p_loo))

    @property
    def is_less_evident(self) -> bool | None:
        """Whether the evidence speaks against it; None without evidence."""
        if self.log_bayes_factor is None:
            return None
        return self.log_bayes_factor < -MIN_LOG_BAYES_FACTOR

    @property
    def predicts_worse(self) -> bool | None:
        """Whether it predicts pushes worse than the best; None where unknown."""
        if self.elpd_difference is None or self.elpd_difference_se is None:
            return None
        enough = max(MIN_STANDARD_ERRORS * self.elpd_difference_se, MIN_ELPD)
        return self.elpd_difference < -enough


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """The same pushes under several models.

    Args:
        models: Scores: ways of rolling, other mechanics, other noise.
        mechanics: Which the table would be identified by, and all models but one are.
        why_no_evidence: Why there is none; None where there is.
        n_pushes: Number of pushes that all of them answer for.
        noise: Noise model of all of them: "given", "pooled" or "sampled".
        seed: Seed of all randomness.
        left_out: Names of models that came out as the configured one: their noise is
            estimated, and the residuals have none of it.
    """

    models: tuple[ModelScore, ...]
    mechanics: str
    why_no_evidence: str | None
    n_pushes: int
    noise: str
    seed: int
    left_out: tuple[str, ...] = ()

    @property
    def status(self) -> FitStatus:
        """That of the first model whose numbers are not to be trusted."""
        statuses = [model.status for model in self.models]
        return next((s for s in statuses if s is not FitStatus.OK), FitStatus.OK)


@checked
def compare_models(
    table: PeakTable,
    config: GraspConfig,
    *,
    seed: int = 0,
    progress: Progress | None = None,
) -> Comparison:
    """Fit a table with several transitions, by other mechanics, and with other noise.

    The mechanics, the pushes left out and where sigma is known from are settled once,
    under the configuration as it is, so that all models answer for the same heights.
    Sigma is sampled where it would be pooled: repeats tell that of normal constant
    noise alone.

    Args:
        table: Peak heights with their directions.
        config: Configuration in force. A sharpness in it is that of the soft model; a
            statement on C_rr is overruled where nothing rolls.
        seed: Seed of all randomness.
        progress: Called with a stage and the share of it that is done.

    Returns:
        Scores; without evidence where the sweep handed a model to emcee.

    Raises:
        DataError: If no usable push is left, or the table cannot be right.
        ConfigError: If the configuration does not fit the table, or the seed is below
            0.
        FitError: If no start gives finite residuals or a finite density, or the solver
            stopped at its step limit.
        ConvergenceError: If the posterior density is infinite at some point.
    """
    check_seed(seed)
    for warning in table_warnings(table, config):
        if warning.code in WRONG:
            raise DataError(
                f"{table.place}: no models are compared: {warning.text}",
                code=warning.code,
            )
    # Other noise is one of the models, not what all of them have.
    plain = with_plain_noise(config)
    if progress is not None:
        progress("mechanics that lead", 0.0)
    fitted, _ = fitted_by_leading(
        table, plain, seed=seed, stages=Stages(()), hearing=Listener()
    )
    sigma = fitted.setup.noise.kind
    sigma = "sampled" if sigma == "pooled" else sigma
    configs = rival_configs(
        fitted.config.with_keys("noise", sigma=sigma),
        has_repeats=is_crossed(*both_ways(fitted.table)),
    )
    scores = _scores(fitted, configs, seed, progress)
    has_evidence = any(score.log_evidence is not None for score in scores)
    return Comparison(
        models=against_best(scores),
        mechanics=fitted.mechanics,
        why_no_evidence=None if has_evidence else NO_EVIDENCE,
        n_pushes=len(fitted.setup.rows),
        noise=sigma,
        seed=seed,
        left_out=tuple(
            name for name in configs if name not in {s.name for s in scores}
        ),
    )


def against_best(scores: list[ModelScore]) -> tuple[ModelScore, ...]:
    """Scores with their distance from the best, by each criterion.

    Returns:
        The same; a model without a number of its own gets no distance, nor does one
        that has no other to be compared with.
    """
    evidences = [s.log_evidence for s in scores if s.log_evidence is not None]
    densities = [s.densities.elpd for s in scores if s.densities is not None]
    best = max(densities, key=np.sum, default=None)
    compared = []
    for score in scores:
        changes: dict[str, float | None] = {}
        if score.log_evidence is not None and len(evidences) > 1:
            changes["log_bayes_factor"] = score.log_evidence - max(evidences)
        if score.densities is not None and best is not None:
            difference = score.densities.elpd - best
            changes["elpd_difference"] = float(np.sum(difference))
            changes["elpd_difference_se"] = _sum_se(difference)
        compared.append(replace(score, **changes))
    return tuple(compared)


def _scores(
    fitted: Fitted,
    configs: Mapping[str, GraspConfig],
    seed: int,
    progress: Progress | None,
) -> list[ModelScore]:
    """All models, not yet compared: every second one beside the others.

    Returns:
        Without those whose noise the residuals were to tell, and have none of.
    """

    def score(name: str) -> list[ModelScore]:
        own = _refitted(fitted, configs[name])
        is_same = "height_share" in NOISES.get(name, ()) and np.allclose(
            own.setup.problem.sd, fitted.setup.problem.sd, rtol=SAME_NOISE, atol=0.0
        )
        return [] if is_same else [_score(name, own, seed)]

    names, scores = list(configs), []
    others = Beside(lambda _: [one for name in names[1::2] for one in score(name)])
    for index, name in enumerate(names[::2]):
        if progress is not None:
            progress(name.replace("_", " "), 2 * index / len(names))
        scores += score(name)
    return sorted((*scores, *others.result()), key=lambda one: names.index(one.name))


def _refitted(fitted: Fitted, config: GraspConfig) -> Fitted:
    """The same pushes under another configuration."""
    setup = settle_noise(build_problem(fitted.table, config), fitted.reference_alpha)
    return Fitted(
        table=fitted.table,
        config=config,
        setup=setup,
        fit=fit_least_squares(setup, reference_alpha=fitted.reference_alpha),
        reference_alpha=fitted.reference_alpha,
        warnings=fitted.warnings,
    )


def _score(name: str, fitted: Fitted, seed: int) -> ModelScore:
    """Score of one model, before differences to the best."""
    problem, n_pushes = fitted.setup.problem, len(fitted.setup.rows)
    posterior = draw_posterior(fitted, seed=seed, engine="auto")
    is_trusted = posterior.status is FitStatus.OK
    quality = goodness_of(fitted, posterior, seed=seed)
    densities = None
    # No push that has something in common with others can be left out by itself.
    if is_trusted and problem.shared is None:
        densities = push_densities(problem, posterior.samples, n_pushes=n_pushes)
    return ModelScore(
        name=name,
        sharpness=None if "p" in problem.priors else float(problem.grasp.sharpness),
        is_adequate=quality.is_adequate,
        verdict=quality.sentence,
        log_evidence=posterior.log_evidence if is_trusted else None,
        log_evidence_error=posterior.log_evidence_error if is_trusted else None,
        densities=densities,
        engine=posterior.engine,
        status=posterior.status,
    )


def _sum_se(values: Float[np.ndarray, " n"]) -> float | None:
    """Standard error of the sum of values that differ from push to push; None of one.

        √(n V),  V the sample variance with n - 1

    References:
        Vehtari, Gelman and Gabry (2017), doi:10.1007/s11222-016-9696-4, section 5.
    """
    if values.size < 2:
        return None
    return float(np.sqrt(values.size) * np.std(values, ddof=1))
