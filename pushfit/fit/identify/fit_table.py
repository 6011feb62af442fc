"""Which noise a table has, by trying more than one: least squares by the likeliest.

Noise as stated comes first. Effects of repeats, angles that err, noise in proportion to
the height and heavy tails are taken where residuals or evidence show them. Excluded:
a fit by one kind of noise (`pushfit.fit.identify.fitted`).
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pushfit.config import GraspConfig
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.checks.violations import (
    ANGLE_ERRORS,
    HEAVY_TAILED,
    NAMING_LEVEL,
    PROPORTIONAL,
    Violation,
    violation_warnings,
)
from pushfit.fit.identify.fitted import Fitted, fit_as_stated, sweep
from pushfit.fit.problem.repeats.effects import repeat_effect
from pushfit.fit.problem.setup import Setup
from pushfit.fit.profiles.angle_errors import steepness
from pushfit.fit.profiles.weights import repeat_gain, share_gain, tail_gain
from pushfit.fit.results import FitStatus, PosteriorResult, ResultWarning

# Log ratio of likelihoods at the residuals of the fit by normal noise. Where that of
# Student-t noise is lower than by this, its evidence is hardly ever the higher one, and
# is not looked at.
MIN_TAIL_GAIN = -0.5
# The same of noise in proportion to the height, above which it is taken: twice it is
# exceeded once in 1000 tables without, half of a chi-square of one degree of freedom.
MIN_SHARE_GAIN = 4.8
# The same of errors of the angles, by repeats alone: exceeded once in 20 tables of
# exact angles, which costs little, as small as errors then come to.
MIN_ANGLE_GAIN = 1.35
# Chance of giving repeats that are alike effects of their own, which costs little: how
# much they may have in common is as small as they differ.
REPEAT_LEVEL = 0.05
# Of the draws that noise is chosen by: whatever the seed, the same noise.
CHOOSING_SEED = 0


def fit_table(
    table: PeakTable,
    config: GraspConfig,
    *,
    searching: Callable[[Setup], None] | None = None,
) -> Fitted:
    """Least squares of a table, with the noise model settled.

    Args:
        searching: Called with the problem once its likelihood was looked at.

    Raises:
        DataError: If no usable push is left.
        ConfigError: If the configuration does not fit the table.
        FitError: If no start gives finite residuals, or the solver stopped at its step
            limit.
    """
    if config.noise.repeat_effect[0] == "auto":
        kind, p_value = repeat_effect(table)
        is_shown = p_value < REPEAT_LEVEL
        config = config.with_keys("noise", repeats=kind if is_shown else "alike")
    if config.noise.likelihood == "auto":
        return _more_evident(table, config, searching)
    return _with_uneven_if_shown(table, config, searching)


def _with_uneven_if_shown(
    table: PeakTable,
    config: GraspConfig,
    searching: Callable[[Setup], None] | None,
) -> Fitted:
    """The fit by angles that err, or by noise in proportion, where either is shown.

    Errors of the angles have to show in what repeats scatter, too: what a wrong model
    leaves is often largest where heights are steep.
    """
    noise = config.noise
    is_open = noise.height_share == "auto"
    if is_open:
        config = config.with_keys("noise", height_share=0.0)
    even = fit_as_stated(table, config, searching)
    # The scatter of repeats holds both already, and stated errors of angles, if they
    # are wrong, look like a share.
    is_held = noise.sigma == "pooled" or noise.theta_sd_deg or noise.alpha_sd_deg
    own = (ANGLE_ERRORS, PROPORTIONAL, HEAVY_TAILED)
    others = [v for v in even.shown if v.code not in own]
    if is_held or not even.shown or any(v.p_value < NAMING_LEVEL for v in others):
        return even
    problem, fit = even.setup.problem, even.fit
    # Noise of several sizes has heavy tails, and these make either likelier.
    tails = tail_gain(problem, fit, "sampled")
    share = share_gain(problem, fit, fit.predicted) if is_open else 0.0
    is_other = bool(even.setup.noise.shared) or noise.height_share not in ("auto", 0.0)
    if noise.theta_sd_deg is None and not is_other:
        steep = np.hypot(*steepness(even.slopes))
        groups = even.table.groups[list(even.setup.rows)]
        _, direction = np.unique(groups, return_inverse=True)
        if repeat_gain(problem, steep, direction) > MIN_ANGLE_GAIN:
            angles = share_gain(problem, fit, steep[np.asarray(problem.mask)])
            if angles > max(share, tails):
                return fit_as_stated(
                    table, config.with_keys("noise", theta_sd_deg="estimate")
                )
    if share > MIN_SHARE_GAIN and share > tails:
        return fit_as_stated(table, config.with_keys("noise", height_share="estimate"))
    return even


def _more_evident(
    table: PeakTable,
    config: GraspConfig,
    searching: Callable[[Setup], None] | None,
) -> Fitted:
    """The fit by normal or by Student-t noise, whichever has the higher evidence."""
    normal = _with_uneven_if_shown(
        table, config.with_keys("noise", likelihood="normal"), searching
    )
    chosen = normal.config.noise
    config = config.with_keys(
        "noise", height_share=chosen.height_share, theta_sd_deg=chosen.theta_sd_deg
    )
    kind = normal.setup.noise.kind
    gain = tail_gain(normal.setup.problem, normal.fit, kind)
    if not gain > MIN_TAIL_GAIN or _is_explained(normal.shown):
        return normal
    rival = normal
    if kind == "pooled":
        # The scatter of few repeats tells the sd of heavy tails badly.
        config = config.with_keys("noise", sigma="sampled")
        rival = fit_as_stated(table, config.with_keys("noise", likelihood="normal"))
    student = fit_as_stated(table, config.with_keys("noise", likelihood="student_t"))
    swept = [sweep(fitted, CHOOSING_SEED) for fitted in (rival, student)]
    gain = log_bayes_factor(*swept)
    if not gain > 0:
        known = {CHOOSING_SEED: swept[0]} if normal is rival else {}
        return replace(normal, swept=known)
    warning = ResultWarning(
        code="student_t_chosen",
        text=f"noise with heavy tails (Student-t) is {np.exp(gain):.2g} times as "
        "probable as normal noise and was taken, so that outlying heights count less; "
        '[noise] likelihood = "normal" has them count in full',
    )
    # What residuals by normal noise show more than tails stays to be said.
    told = violation_warnings(normal.shown, is_adequate=False)
    others = [one for one in told if one.code != HEAVY_TAILED]
    return replace(
        student,
        warnings=(*student.warnings, warning, *others),
        swept={CHOOSING_SEED: swept[1]},
    )


def log_bayes_factor(first: PosteriorResult, second: PosteriorResult) -> float:
    """Log evidence of the second less that of the first; NaN where one has none."""
    evidences = [
        s.log_evidence
        if s.log_evidence is not None and s.status is FitStatus.OK
        else np.nan
        for s in (first, second)
    ]
    return evidences[1] - evidences[0]


def _is_explained(found: tuple[Violation, ...]) -> bool:
    """Whether large residuals have another cause, or there is none to explain."""
    return not found or (
        found[0].p_value < NAMING_LEVEL and found[0].code != HEAVY_TAILED
    )
