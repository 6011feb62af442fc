"""A table by each of the mechanics that apply, side by side, and which of them lead.

Excluded: what is asked of those that lead (`pushfit.fit.identify.identify_table`), and
when a tilt matters (`pushfit.fit.checks.tilt_check`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from pushfit.config import GraspConfig
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import FitError
from pushfit.fit.assess.reporting_rules import as_unknown, within_verdict
from pushfit.fit.assess.verdicts import angle_quantity
from pushfit.fit.checks.tilt_check import (
    contradicted_tilt,
    does_tilt_matter,
    is_worse,
)
from pushfit.fit.identify.beside import Beside, Tell, at_once
from pushfit.fit.identify.fit_table import fit_table
from pushfit.fit.identify.fitted import (
    Fitted,
    Listener,
    is_comparable,
    reach_of,
    sweep,
)
from pushfit.fit.identify.progress import Stages
from pushfit.fit.problem.setup import Setup
from pushfit.fit.profiles.profiles import likelihood_profiles
from pushfit.fit.results import (
    FitStatus,
    LikelihoodProfile,
    MechanicsAnswer,
    PosteriorResult,
    Quantity,
    ResultWarning,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Measured:
    """One of the mechanics, ready to be compared with the other."""

    fitted: Fitted
    swept: PosteriorResult
    answer: MechanicsAnswer


@dataclass(frozen=True, slots=True, kw_only=True)
class _ByOne:
    """A table by one of the mechanics, and who hears of it."""

    table: PeakTable
    config: GraspConfig
    seed: int
    hearing: Listener

    @property
    def by(self) -> str:
        """How names of stages tell this mechanics."""
        return f"by {self.config.grasp.mechanics} mechanics"

    def fitted(
        self, tell: Tell, searching: Callable[[Setup], None] | None = None
    ) -> Fitted:
        """Best fit by least squares, told as soon as it is there."""
        fitted = fit_table(self.table, self.config, searching=searching)
        tell(partial(self.hearing.fitted, fitted))
        return fitted

    def measured(self, fitted: Fitted, tell: Tell) -> _Measured:
        """What a fit says of evidence and θ_c by this mechanics."""
        profiles = profiles_of(fitted, ("theta_c",))
        tell(partial(self.hearing.confined, fitted, profiles.get("theta_c")))
        swept = sweep(fitted, self.seed)
        fitted = replace(fitted, swept={self.seed: swept})
        prob = fitted.config.report.prob
        theta_c = angle_quantity("theta_c", swept, profiles.get("theta_c"), prob=prob)
        answer = mechanics_answer(fitted, swept, theta_c)
        return _Measured(fitted=fitted, swept=swept, answer=answer)

    def all(self, tell: Tell) -> _Measured:
        """The fit, and what it says of evidence and θ_c."""
        return self.measured(self.fitted(tell), tell)


def fitted_by_leading(
    table: PeakTable,
    config: GraspConfig,
    *,
    seed: int,
    stages: Stages,
    hearing: Listener,
) -> tuple[Fitted, tuple[MechanicsAnswer, ...]]:
    """Least squares by the mechanics that lead, and what the other ones answer.

    Others than the first that do not fit at all are only said.
    """
    first, *rest = (
        _ByOne(table=table, config=one, seed=seed, hearing=hearing)
        for one in config.by_mechanics()
    )
    others: list[Beside[_Measured]] = []

    def searching(setup: Setup) -> None:
        # One first look is enough for who waits, and nothing beside it slows it down.
        hearing.searched(setup)
        others.extend(Beside(one.all) for one in rest)

    stages.begin(f"least squares {first.by}")
    fitted = first.fitted(at_once, searching)
    if not rest:
        return fitted, ()
    stages.begin(f"posterior {first.by}")
    found, warnings = [first.measured(fitted, at_once)], []
    for one, other in zip(rest, others, strict=True):
        stages.begin(f"fit and posterior {one.by}")
        try:
            found.append(other.result())
        except FitError as error:
            text = f"no fit {one.by}: {error}"
            warnings.append(ResultWarning(code="one_mechanics", text=text))
    (leading, *behind), told = _leading_first(found)
    fitted, warnings = leading.fitted, [*warnings, *told]
    fitted = replace(fitted, warnings=(*fitted.warnings, *warnings))
    return fitted, tuple(one.answer for one in behind)


def _leading_first(
    measured: list[_Measured],
) -> tuple[list[_Measured], list[ResultWarning]]:
    """The mechanics that the table is identified by, before the other."""
    if len(measured) < 2:
        return measured, []
    linear, tilting = measured
    fitted = linear.fitted
    if not is_comparable(fitted, tilting.fitted):
        no_evidence = {"log_evidence": None, "log_evidence_error": None}
        tilting = replace(tilting, answer=replace(tilting.answer, **no_evidence))
    prob, n_heights = fitted.config.report.prob, fitted.fit.n_data
    if not does_tilt_matter(linear.swept, tilting.swept, prob=prob):
        return [linear, tilting], []
    if is_worse(tilting.answer, linear.answer, n_heights=n_heights):
        return [linear, tilting], [contradicted_tilt(fitted.setup, linear.swept)]
    return [tilting, linear], []


def mechanics_answer(
    fitted: Fitted, posterior: PosteriorResult, theta_c: Quantity
) -> MechanicsAnswer:
    """What stands beside the other mechanics."""
    best, wanted = fitted.fit.modes[0], fitted.config.report.wanted_width_deg
    is_trusted = posterior.status is FitStatus.OK
    problem = fitted.setup.problem
    observed = np.asarray(problem.observed)[np.asarray(problem.mask)]
    rms_residual = float(np.sqrt(np.mean((observed - fitted.fit.predicted) ** 2)))
    return MechanicsAnswer(
        mechanics=fitted.mechanics,
        theta_c=within_verdict(theta_c, wanted_width_deg=wanted)
        if is_trusted
        else as_unknown(theta_c),
        best_fit_deg=best.theta_c_deg,
        chi_square=best.chi_square,
        log_evidence=posterior.log_evidence,
        log_evidence_error=posterior.log_evidence_error,
        rms_residual=rms_residual,
    )


def profiles_of(
    fitted: Fitted, wanted: Sequence[str] | None
) -> dict[str, LikelihoodProfile]:
    """Likelihood profiles as the configuration wants them."""
    return likelihood_profiles(
        fitted.setup,
        fitted.fit,
        reference_alpha=fitted.reference_alpha,
        prob=fitted.config.report.prob,
        reach=reach_of(fitted.config),
        wanted=wanted,
    )
