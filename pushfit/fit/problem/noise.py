"""Which scatter of the heights a fit assumes, and from where it is known.

Given standard deviations are used where repeats do not contradict them; without them,
repeats are pooled when there are enough; else sigma is a parameter like the others.
Excluded: noise that only a fit tells (`pushfit.fit.profiles.weights`).
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
import scipy
from jaxtyping import Float

from pushfit.config import GraspConfig
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import SettingsError
from pushfit.fit.problem.repeats.averaging import MIN_POOLED_DOF
from pushfit.fit.problem.repeats.effects import (
    both_ways,
    effect_sds,
    is_crossed,
    repeat_warning,
    scatter_beside_effects,
    without_repeat_effects,
)
from pushfit.fit.results import ResultWarning

# Chance of doubting correct standard deviations.
CONTRADICTION_LEVEL = 1e-3
# What noise is taken for where "auto" is asked for and nothing has spoken yet.
PLAIN: dict[str, str | float] = {
    "likelihood": "normal",
    "height_share": 0.0,
    "repeats": "alike",
}
# Heights so close to noise-free that sigma would be 0: this share of the tallest.
SMALLEST_SHARE = 1e-9
# Heights that are all the same were rounded, by a step that they do not show: as much
# as that of a sensor of 12 bits. Without it sigma falls to 0 and no draw counts.
ROUNDED_SHARE = 2.0**-12


@dataclass(frozen=True, slots=True, kw_only=True)
class Noise:
    """Noise model of a table.

    Args:
        kind: "given", "pooled" or "sampled".
        sd: Known standard deviation per channel and row; 0 where unknown [table unit].
        sigma: Standard deviation that weights least squares; a first guess where it
            is sampled [table unit].
        degrees_of_freedom: Of the estimate of sigma; infinite where it was given, NaN
            where it is sampled and the residuals will tell.
        angle_sd: Standard deviations of θ and α of every push, which its height
            scatters by as well [rad]; NaN where the residuals are to tell.
        height_share: Noise in proportion to the height, as a share of it; NaN where
            the residuals are to tell.
        shared: Standard deviations of what pushes of a repeat have in common, per
            channel, repeat and row [table unit]; without any, there are no groups.
        warnings: What the user should know.
    """

    kind: str
    sd: Mapping[str, Float[np.ndarray, " n"]]
    sigma: Mapping[str, Float[np.ndarray, " n"]]
    degrees_of_freedom: float
    angle_sd: tuple[float, float] = (0.0, 0.0)
    height_share: float = 0.0
    shared: Mapping[str, Float[np.ndarray, "r n"]] = field(default_factory=dict)
    warnings: tuple[ResultWarning, ...] = ()

    @property
    def follows_fit(self) -> bool:
        """Whether part of it is known only once there is a fit."""
        return any(self.angle_sd) or self.height_share != 0


def with_plain_noise(config: GraspConfig) -> GraspConfig:
    """The configuration with the simplest noise where it leaves the kind open."""
    noise = config.noise
    plain = {name: v for name, v in PLAIN.items() if getattr(noise, name) == "auto"}
    return config.with_keys("noise", **plain)


def choose_noise(table: PeakTable, config: GraspConfig) -> Noise:
    """Noise model that `config.noise.sigma` asks for, or that the table supports.

    Raises:
        SettingsError: If "given" is asked for without sd columns, or "pooled" without
            repeats or with noise that differs from direction to direction, or effects
            of repeats that nothing tells.
    """
    config = with_plain_noise(config)
    kind, stated = config.noise.repeat_effect
    if kind == "alike":
        return _of_each(table, config, PeakTable.pooled_sd)
    if stated is not None and not is_crossed(*both_ways(table)):
        noise = _of_each(table, config, PeakTable.pooled_sd)
        return replace(noise, shared=effect_sds(table, table, kind, stated=stated))
    alone = without_repeat_effects(table, kind)
    noise = _of_each(alone, config, scatter_beside_effects)
    return replace(
        noise,
        shared=effect_sds(table, alone, kind, stated=stated),
        warnings=(*noise.warnings, repeat_warning(table, alone, kind)),
    )


def _of_each(
    table: PeakTable,
    config: GraspConfig,
    scatter: Callable[[PeakTable, str], tuple[float, int]],
) -> Noise:
    """Noise that pushes have one by one.

    Args:
        scatter: What repeats of a channel say of it, and its degrees of freedom.
    """
    choice, sds = config.noise.sigma, stated_sds(table)
    angle_sd, share = config.noise.angle_sd, config.noise.height_share
    height_share = math.nan if share == "estimate" else float(share)
    # Both make repeats scatter beyond the sd of their heights, and unequally.
    is_uneven = any(angle_sd) or height_share != 0
    warnings: tuple[ResultWarning, ...] = ()
    if choice == "given" and sds is None:
        columns = " and ".join(f"{name}_sd_{table.unit}" for name in table.channels)
        raise SettingsError(
            f'[noise] sigma = "given", but the table lacks {columns}; add what is '
            'missing or set sigma = "auto"',
            code="no_given_sigma",
        )
    if choice == "auto" and sds is not None:
        choice, warnings = ("given", ()) if is_uneven else _believed(table, sds)
    if choice == "given" and sds is not None:
        return Noise(
            kind=choice,
            sd=sds,
            sigma=sds,
            degrees_of_freedom=np.inf,
            angle_sd=angle_sd,
            height_share=height_share,
        )
    pooled = {name: scatter(table, name) for name in table.channels}
    dof = min(int(p[1]) for p in pooled.values())
    if choice == "pooled" and dof < 1:
        raise SettingsError(
            '[noise] sigma = "pooled", but no direction was pushed twice; add repeats '
            'or set sigma = "sampled"',
            code="no_repeats",
        )
    if choice == "pooled" and is_uneven:
        raise SettingsError(
            '[noise] sigma = "pooled" with theta_sd_deg, alpha_sd_deg or '
            "height_share: the scatter of repeats holds that of their angles and "
            'heights already; set sigma = "auto"',
            code="pooled_with_uneven",
        )
    if choice == "auto":
        is_even = dof >= MIN_POOLED_DOF and not is_uneven
        choice = "pooled" if is_even else "sampled"
    noise = _from_scatter(table, choice, no_less_than=sds, pooled=pooled)
    return replace(
        noise, angle_sd=angle_sd, height_share=height_share, warnings=warnings
    )


def _from_scatter(
    table: PeakTable,
    kind: str,
    *,
    no_less_than: Mapping[str, Float[np.ndarray, " n"]] | None,
    pooled: Mapping[str, tuple[float, int]],
) -> Noise:
    """Pooled noise, or a first guess of one that is sampled.

    Args:
        no_less_than: Standard deviations that the table states [table unit].
        pooled: Scatter of repeats and its degrees of freedom; see `pooled_sd`.
    """
    used = table.is_used
    step = {n: _step(table.heights(n)[used]) for n in table.channels}
    no_sd = {n: np.full(table.n_pushes, s) for n, s in step.items()}
    known = no_sd if no_less_than is None else no_less_than
    floor = {n: SMALLEST_SHARE * np.max(np.abs(table.heights(n)[used])) for n in known}
    constant = {
        n: np.full(table.n_pushes, max(scatter if dof else 0.0, floor[n], step[n]))
        for n, (scatter, dof) in pooled.items()
    }
    if kind == "pooled":
        least = min(dof for _, dof in pooled.values())
        return Noise(
            kind=kind, sd=no_sd, sigma=constant, degrees_of_freedom=float(least)
        )
    first = {n: np.hypot(constant[n], known[n]) for n in known}
    return Noise(kind=kind, sd=known, sigma=first, degrees_of_freedom=np.nan)


def _step(heights: Float[np.ndarray, " n"]) -> float:
    """Rounding of heights that are all the same; 0 where they differ [table unit]."""
    tallest = float(np.max(np.abs(heights)))
    return ROUNDED_SHARE * tallest if np.ptp(heights) == 0 else 0.0


def stated_sds(table: PeakTable) -> dict[str, Float[np.ndarray, " n"]] | None:
    """Standard deviations of every channel [table unit]; None if one lacks them."""
    sds = {}
    for name in table.channels:
        sd = table.sd(name)
        if sd is None:
            return None
        sds[name] = sd
    return sds


def _believed(
    table: PeakTable, sds: Mapping[str, Float[np.ndarray, " n"]]
) -> tuple[str, tuple[ResultWarning, ...]]:
    """Kind of noise model, by what repeats say of the given standard deviations."""
    p_value, ratio = _contradiction(table, sds)
    if p_value > CONTRADICTION_LEVEL:
        return "given", ()
    text = (
        f"repeated pushes scatter {ratio:.1f} times as much as their standard "
        "deviations say; the extra scatter is estimated and added to them"
    )
    return "sampled", (ResultWarning(code="sd_contradicted", text=text),)


def _contradiction(
    table: PeakTable, sds: Mapping[str, Float[np.ndarray, " n"]]
) -> tuple[float, float]:
    """Chi-square p-value that repeats scatter by their sd, and the ratio of scatter."""
    used = table.is_used
    _, group = np.unique(table.groups[used], return_inverse=True)
    n_repeated = int(group.size - np.max(group) - 1)
    if n_repeated == 0:
        return 1.0, 1.0
    total, dof = 0.0, len(sds) * n_repeated
    for name, sd in sds.items():
        heights, weight = table.heights(name)[used], sd[used] ** -2.0
        mean = np.bincount(group, weight * heights) / np.bincount(group, weight)
        total += float(np.sum(weight * (heights - mean[group]) ** 2))
    return float(scipy.special.chdtrc(dof, total)), float(np.sqrt(total / dof))
