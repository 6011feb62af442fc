"""The best push direction without a push model: a cosine through the heights.

    height = c0 + c1 cos 2α + s1 sin 2α   (+ a level for each elevation)

Its minimum is an estimate of α* that no mechanics can bias; where it disagrees with the
model's, one of the two assumptions fails. Excluded: the model's own α*
(`pushfit.mechanics.directions`).
"""

from collections.abc import Callable, Iterator

import numpy as np
import scipy
from jaxtyping import Float, Int

from pushfit.config.schema import ReachSection
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.problem.derived import (
    axis_within,
    equal_tailed_interval,
    highest_density_set,
    median,
)
from pushfit.fit.problem.setup import n_azimuths
from pushfit.fit.results import Quantity, ResultWarning, Verdict
from pushfit.model import Grasp

# Below three azimuths per elevation a cosine passes through any heights.
MIN_AZIMUTHS = 3
# Codes by which others know that the two directions differ.
DISAGREEMENT, ROLLED = "alpha_star_disagreement", "alpha_star_of_rolling_pushes"
# The plainest first. Normal heights have no such wave, or of an object that tilts that
# of resistance upside down.
RESISTING = ("height_tangential", "height")
# Draws of the harmonic: ends of a 90 % interval are then good to 0.03 sd.
N_DRAWS = 4000


def model_free_direction(
    table: PeakTable, *, reach: ReachSection, prob: float, seed: int
) -> Quantity | None:
    """Direction of least height within the reach by a cosine of period 180°.

    Args:
        table: Peak heights; of components the tangential one is used.

    Returns:
        The direction [deg]; None without an elevation pushed in three azimuths and
        rows to spare, or with normal heights alone. NOT_DETERMINED where the amplitude
        may be zero.
    """
    rows, channel = _sweep_rows(table), _channel(table)
    if rows is None or channel is None:
        return None
    heights = table.heights(channel)[rows]
    design, n_levels = _design(table.theta[rows], table.alpha[rows])
    dof = heights.size - design.shape[1]
    if dof < 1:
        return None
    coefficients, *_ = np.linalg.lstsq(design, heights, rcond=None)
    residuals = heights - design @ coefficients
    covariance = np.linalg.inv(design.T @ design) * (residuals @ residuals / dof)
    wave, spread = coefficients[n_levels:], covariance[n_levels:, n_levels:]
    rng = np.random.default_rng(seed)
    # Multivariate t: sigma is known only from the residuals.
    scale = np.sqrt(dof / rng.chisquare(dof, N_DRAWS))
    noise = rng.multivariate_normal(np.zeros(2), spread, N_DRAWS) * scale[:, None]
    draws, least = _minimum(wave + noise), _minimum(wave[None])
    is_axis = reach.is_whole
    if not is_axis:
        draws, least = (axis_within(a, *reach.alpha_deg) for a in (draws, least))
    is_round = _amplitude_may_vanish(wave, spread, dof=dof, prob=prob)
    interval = equal_tailed_interval(draws, prob, is_axis=is_axis)
    sets = highest_density_set(draws, prob, is_axis=is_axis, has_ends=not is_axis)
    return Quantity(
        name="alpha_star_model_free",
        unit="deg",
        estimate=None if is_round else median(least, is_axis=is_axis),
        interval=None if is_round else interval,
        prob=prob,
        sets=() if is_round else sets,
        likelihood_sets=(),
        verdict=Verdict.NOT_DETERMINED if is_round else Verdict.DETERMINED,
        contraction=None,
        note="minimum of c0 + c1 cos 2α + s1 sin 2α",
    )


def direction_disagreement(
    alpha_star: Quantity,
    model_free: Quantity | None,
    table: PeakTable,
    *,
    grasp: Grasp,
    predict: Callable[[Float[np.ndarray, "2 n"]], Float[np.ndarray, "c n"]],
) -> Iterator[ResultWarning]:
    """Model and cosine point in different directions.

    Args:
        grasp: Names the mechanics, by which an object tilts or not.
        predict: Heights that the model gives for θ and α [rad], by channel.
    """
    if model_free is None or model_free.interval is None or alpha_star.interval is None:
        return
    (low, high), (other_low, other_high) = alpha_star.interval, model_free.interval
    width, middle = other_high - other_low, (other_low + other_high) / 2
    if _between((low + high) / 2, middle) <= (high - low + width) / 2:
        return
    where = (
        f"α* is in {low:.0f}° to {high:.0f}° by the model but in {other_low:.0f}° to "
        f"{other_high:.0f}° by a cosine through the heights"
    )
    # What heights leave open of the model turns its own cosine about as far.
    turned = _modelled_minimum(table, predict) if grasp.law.has_length else np.nan
    if _between(turned, middle) <= width:
        yield ResultWarning(
            code=ROLLED,
            text=f"{where}, and by one through those of the model as well: where an "
            "object tilts, pushes that roll meet most resistance along α*, and α* is "
            "that of pushes that do not; sweep the azimuth above θ_c to see it",
        )
    else:
        yield ResultWarning(
            code=DISAGREEMENT,
            text=f"{where}; do not trust either without looking at the figure",
        )


def _modelled_minimum(
    table: PeakTable,
    predict: Callable[[Float[np.ndarray, "2 n"]], Float[np.ndarray, "c n"]],
) -> float:
    """Where the cosine through the heights of the model is least [deg]."""
    rows, channel = _sweep_rows(table), _channel(table)
    if rows is None or channel is None:
        return np.nan
    theta, alpha = table.theta[rows], table.alpha[rows]
    heights = predict(np.stack([theta, alpha]))[table.channels.index(channel)]
    design, n_levels = _design(theta, alpha)
    coefficients, *_ = np.linalg.lstsq(design, heights, rcond=None)
    return float(_minimum(coefficients[None, n_levels:])[0])


def _between(one: float, other: float) -> float:
    """Angle between two axes [deg]."""
    return abs((other - one + 90.0) % 180.0 - 90.0)


def _channel(table: PeakTable) -> str | None:
    """The channel that is least where a push meets least resistance."""
    return next((c for c in RESISTING if c in table.channels), None)


def _sweep_rows(table: PeakTable) -> Int[np.ndarray, " k"] | None:
    """Used rows at elevations that were pushed in enough azimuths."""
    used = np.flatnonzero(table.is_used)
    theta = _elevation(table.theta[used])
    kept = []
    for level in np.unique(theta):
        same = used[theta == level]
        if n_azimuths(table.alpha[same]) >= MIN_AZIMUTHS:
            kept.append(same)
    return np.concatenate(kept) if kept else None


def _elevation(theta: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """What counts as one elevation [deg]."""
    return np.round(np.degrees(theta), 3)


def _design(
    theta: Float[np.ndarray, " n"], alpha: Float[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, "n k"], int]:
    """One level per elevation, then the two waves."""
    elevation = _elevation(theta)
    levels = np.unique(elevation)
    indicator = (elevation[:, None] == levels).astype(float)
    waves = np.stack([np.cos(2 * alpha), np.sin(2 * alpha)], axis=1)
    return np.concatenate([indicator, waves], axis=1), levels.size


def _minimum(wave: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
    """Azimuth of the minimum of each wave, in [0, 180) [deg]."""
    peak = np.degrees(np.arctan2(wave[:, 1], wave[:, 0])) / 2
    return np.mod(peak + 90.0, 180.0)


def _amplitude_may_vanish(
    wave: Float[np.ndarray, " 2"],
    covariance: Float[np.ndarray, "2 2"],
    *,
    dof: int,
    prob: float,
) -> bool:
    """Whether the joint confidence region of (c1, s1) holds the origin (F test)."""
    if np.linalg.matrix_rank(covariance) < 2:
        return not np.any(wave)
    distance = float(wave @ np.linalg.solve(covariance, wave)) / 2
    return bool(distance < scipy.special.fdtri(2, dof, prob))
