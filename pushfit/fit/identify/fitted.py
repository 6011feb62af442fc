"""A table fitted, and drawn from: what precedes all judgement of it.

Excluded: the judgement (`pushfit.fit.identify.identify_table`).
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from jaxtyping import Float

from pushfit.config import GraspConfig
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import ConfigError
from pushfit.fit.assess.warnings import (
    SCATTERED,
    contact_warnings,
    contradiction_warning,
    lost_contact_rows,
    scatter_warning,
)
from pushfit.fit.checks.leave_one_out import LeftOut
from pushfit.fit.checks.model_checking import goodness_of_fit
from pushfit.fit.checks.predictive import predictive_checks
from pushfit.fit.checks.table_checks import table_warnings
from pushfit.fit.checks.violations import (
    Violation,
    violations,
)
from pushfit.fit.identify.progress import Progress
from pushfit.fit.problem.repeats.averaging import averaged, averaging_warning
from pushfit.fit.problem.repeats.effects import (
    repeat_warning,
    without_repeat_effects,
)
from pushfit.fit.problem.setup import Setup, build_problem
from pushfit.fit.profiles.angle_errors import angle_slopes
from pushfit.fit.profiles.least_squares import (
    fit_least_squares,
    search_of,
    settle_noise,
)
from pushfit.fit.results import (
    FitResult,
    FitStatus,
    GoodnessOfFit,
    LikelihoodProfile,
    PosteriorResult,
    ResultWarning,
)
from pushfit.fit.sweep.posterior import sweep_posterior

ENGINES = ("auto", "sweep", "emcee")


@dataclass(frozen=True, kw_only=True)
class Fitted:
    """A table as fitted: what precedes any sampling.

    What follows from the fit is found once, when it is first asked for.

    Args:
        table: Peak heights, with pushes flagged that had lost contact.
        config: Configuration in force.
        setup: Problem, its noise weights settled.
        fit: Least squares.
        reference_alpha: Azimuth at which θ_c is quoted [rad].
        warnings: What came up on the way.
        swept: Draws of the sweep that are known already, by seed.
    """

    table: PeakTable
    config: GraspConfig
    setup: Setup
    fit: FitResult
    reference_alpha: float
    warnings: tuple[ResultWarning, ...]
    swept: Mapping[int, PosteriorResult] = field(default_factory=dict)

    @property
    def mechanics(self) -> str:
        """Name of the mechanics of the fit."""
        return self.setup.problem.grasp.mechanics

    @cached_property
    def slopes(self) -> Float[np.ndarray, "2 2 c n"]:
        """Slopes of the heights in θ and α, behind and ahead [table unit/rad]."""
        return angle_slopes(self.setup.problem, self.fit.estimate)

    @cached_property
    def shown(self) -> tuple[Violation, ...]:
        """What residuals speak against, the most telling first."""
        return violations(self.table, self.setup, self.fit, slopes=self.slopes)


class Listener:
    """Who waits for an answer and hears what is known already; this one ignores it."""

    def searched(self, setup: Setup) -> None:
        """The whole likelihood was looked at, by weights still to be settled."""

    def fitted(self, fitted: Fitted) -> None:
        """Hear of the best fit, before its uncertainty."""

    def confined(self, fitted: Fitted, theta_c: LikelihoodProfile | None) -> None:
        """There is a likelihood set of θ_c, or none."""


def fit_as_stated(
    table: PeakTable,
    config: GraspConfig,
    searching: Callable[[Setup], None] | None = None,
) -> Fitted:
    """Least squares by one kind of noise."""
    given = config.noise.sigma
    config, warnings = prepared(table, config)
    stated, (kind, _) = config.noise.sigma, config.noise.repeat_effect
    if config.noise.angle_errors == "shared":
        if kind != "alike":
            # An average is of all repeats.
            before, table = table, without_repeat_effects(table, kind)
            warnings = (*warnings, repeat_warning(before, table, kind))
            config = config.with_keys("noise", repeats="alike")
        before, table = table, averaged(table, stated)
        if table is not before:
            warnings = (*warnings, averaging_warning(before, table))
            config = config.with_keys(
                "noise", sigma="given" if stated == "pooled" else stated
            )
    reference_alpha = reference_azimuth(table, config)
    setup = build_problem(table, config)
    setup = replace(setup, search=search_of(setup, reference_alpha))
    if searching is not None:
        searching(setup)
    setup, fit = _fit(setup, reference_alpha)
    lost = lost_contact_rows(setup, fit)
    if lost:
        warnings = (*warnings, *contact_warnings(table, config, lost, fit=fit))
        table = table.with_flag(lost, "lost_contact")
        setup, fit = _fit(build_problem(table, config), reference_alpha)
    excess = scatter_warning(table, setup, fit) if given == "auto" else None
    if excess is not None and not setup.noise.warnings:
        warnings = (*warnings, excess)
    if excess is not None and setup.noise.kind == "given":
        config = config.with_keys("noise", sigma="sampled")
        setup, fit = _fit(build_problem(table, config), reference_alpha)
    sigma = setup.noise.kind
    if config.noise.angle_errors == "shared" and sigma == "given":
        # The table given may not state what its averages do.
        sigma = stated
    contradiction = contradiction_warning(setup, fit)
    told = *setup.noise.warnings, *filter(None, [contradiction])
    return Fitted(
        table=table,
        config=config.with_keys("noise", sigma=sigma),
        setup=setup,
        fit=fit,
        reference_alpha=reference_alpha,
        warnings=(*warnings, *told),
    )


def prepared(
    table: PeakTable, config: GraspConfig
) -> tuple[GraspConfig, tuple[ResultWarning, ...]]:
    """The configuration that a table is fitted with, and what it says before."""
    warnings = tuple(table_warnings(table, config))
    if not config.push.length_known and config.noise.sigma == "auto":
        # Unequal pushes scatter by more than any sensor noise.
        config = config.with_keys("noise", sigma="sampled")
    return config, warnings


def _fit(setup: Setup, reference_alpha: float) -> tuple[Setup, FitResult]:
    """Problem with its noise weights settled, and its best fit."""
    setup = settle_noise(setup, reference_alpha)
    return setup, fit_least_squares(setup, reference_alpha=reference_alpha)


def check_engine(engine: str) -> None:
    """Refuse the name of an engine that is not known.

    Raises:
        ConfigError: It is not known.
    """
    if engine not in ENGINES:
        raise ConfigError(
            f"engine = {engine!r} is not known; choose {', '.join(ENGINES[:-1])} or "
            f"{ENGINES[-1]} (what was called exact is the sweep)",
            code="unknown_engine",
        )


def draw_posterior(
    fitted: Fitted,
    *,
    seed: int,
    engine: str,
    progress: Progress | None = None,
    checkpoint: Path | None = None,
) -> PosteriorResult:
    """Draws by the engine asked for.

    Args:
        fitted: A table with its noise settled.
        engine: "sweep", "emcee", or "auto" for the sweep with emcee where its draws
            are not to be trusted.
        progress: Called with a stage and the share of it that is done.
        checkpoint: File in which a run of emcee is kept, to be resumed.

    Raises:
        ConfigError: If the engine is not known.
        FitError: If no start has a finite density.
        ConvergenceError: If the posterior density is infinite at some point.
    """
    check_engine(engine)
    swept = None if engine == "emcee" else sweep(fitted, seed)
    if swept is not None and (engine == "sweep" or swept.status is FitStatus.OK):
        return swept
    from pushfit.fit.sampler import emcee_posterior  # noqa: PLC0415 - slow to load

    chain = emcee_posterior.sample_posterior(
        fitted.setup,
        fitted.fit,
        seed=seed,
        reference_alpha=fitted.reference_alpha,
        reach=reach_of(fitted.config),
        progress=progress,
        checkpoint=checkpoint,
    )
    if swept is None:
        return chain
    return replace(chain, ess=swept.ess, pareto_k=swept.pareto_k)


def sweep(fitted: Fitted, seed: int) -> PosteriorResult:
    """Posterior of a fit by the sweep; the one it keeps for the seed, if any."""
    if seed in fitted.swept:
        return fitted.swept[seed]
    return sweep_posterior(
        fitted.setup,
        seed=seed,
        reference_alpha=fitted.reference_alpha,
        reach=reach_of(fitted.config),
    )


def goodness_of(
    fitted: Fitted,
    posterior: PosteriorResult,
    *,
    seed: int,
    contradicted: Sequence[str] = (),
    left_out: Sequence[LeftOut] = (),
) -> GoodnessOfFit:
    """How well a fit describes its heights; see `goodness_of_fit`."""
    return goodness_of_fit(
        fitted.table,
        fitted.fit,
        fitted.setup.noise,
        seed=seed,
        predictive=predictive_checks(fitted.table, fitted.setup, posterior, seed=seed),
        contradicted=contradicted,
        left_out=left_out,
        is_scattered=any(warning.code == SCATTERED for warning in fitted.warnings),
        likelihood=fitted.setup.problem.likelihood,
    )


def is_comparable(first: Fitted, second: Fitted) -> bool:
    """Whether both answer for the same heights, and know their noise alike."""
    return (
        first.setup.rows == second.setup.rows
        and first.setup.noise.kind == second.setup.noise.kind
    )


def reference_azimuth(table: PeakTable, config: GraspConfig) -> float:
    """Azimuth with the most distinct elevations, unless the configuration names one."""
    if config.grasp.reference_alpha_deg is not None:
        return float(np.radians(config.grasp.reference_alpha_deg))
    names = ("alpha_deg", "theta_deg")
    angles = np.stack([table.frame[n].to_numpy(float)[table.is_used] for n in names])
    if not angles.size:
        return 0.0
    azimuths, counts = np.unique(np.unique(angles, axis=1)[0], return_counts=True)
    return float(np.radians(azimuths[np.argmax(counts)]))


def reach_of(config: GraspConfig) -> tuple[float, float]:
    """Lowest and highest azimuth that the finger can push in [rad]."""
    low, high = config.reach.alpha_deg
    return float(np.radians(low)), float(np.radians(high))
