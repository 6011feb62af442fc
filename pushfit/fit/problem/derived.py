"""From points in sampling coordinates to everything that is reported of them.

θ_c and α* are functions of the parameters, so their posterior is that of the draws:
no propagated standard error ever stands in for it. Angles leave here in degrees.
Excluded: which verdict a quantity gets (`pushfit.fit.assess.verdicts`).
"""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from pushfit.fit.problem.problem import Problem
from pushfit.fit.programs.compile import compiled, in_chunks
from pushfit.fit.results import Piece
from pushfit.mechanics.directions import best_direction, critical_angle
from pushfit.model import as_float, contact
from pushfit.parameters import HALF_TURN, SIX

# Data coordinates of one call.
N_POINTS = 128
# A density estimate has fewer bumps than this, and as many bins.
MAX_PIECES, N_BINS = 100, 512


def samples_mapping(
    problem: Problem,
    x_samples: Float[np.ndarray, "n p"],
    reference_alpha: float,
    *,
    reach: tuple[float, float],
) -> dict[str, Float[np.ndarray, " n"]]:
    """Every reported quantity at each point.

    Args:
        reference_alpha: Azimuth at which θ_c is taken [rad].
        reach: Lowest and highest azimuth for α* [rad].

    Returns:
        The six parameters, A and B; e1, e2, f1, f2 and alpha_star [deg] where the
        ellipse is free; F_0, p and sigma_<channel> where sampled; theta_c [deg], NaN
        where the contact never rolls.
    """
    x, alpha = as_float(x_samples), as_float(reference_alpha)
    columns = _quantities(problem, x, reference_alpha=alpha, reach=reach)
    return {name: np.asarray(values) for name, values in columns.items()}


def critical_angles(
    problem: Problem, points: Float[np.ndarray, "k q"], reference_alpha: float
) -> Float[np.ndarray, " k"]:
    """θ_c at many data coordinates [rad]; see `critical_angle_at`."""
    alpha = as_float(reference_alpha)
    problem = problem.of_data
    return in_chunks(lambda rows: _angles(problem, rows, alpha), points, N_POINTS)


def critical_angle_at(
    problem: Problem,
    y: Float[Array, " q"],
    reference_alpha: Float[Array, ""],
) -> Float[Array, ""]:
    """θ_c at data coordinates; NaN where the contact never rolls [rad]."""
    state = problem.data_state(y)
    grasp = state.grasp(problem.grasp)
    return critical_angle(state.params, grasp, reference_alpha)


@compiled
def _angles(
    problem: Problem, points: Float[Array, "k q"], reference_alpha: Float[Array, ""]
) -> Float[Array, " k"]:
    return jax.vmap(lambda y: critical_angle_at(problem, y, reference_alpha))(points)


@compiled
def _quantities(
    problem: Problem,
    x_samples: Float[Array, "n p"],
    *,
    reference_alpha: Float[Array, ""],
    reach: tuple[float, float],
) -> dict[str, Float[Array, " n"]]:
    theta = _middle_elevation(problem)

    def one(x: Float[Array, " p"]) -> dict[str, Float[Array, ""]]:
        state = problem.state(x)
        p, group = state.params, contact(state.params)
        grasp = state.grasp(problem.grasp)
        angle = critical_angle(p, grasp, reference_alpha)
        values = {name: getattr(p, name) for name in SIX}
        values |= {"A": group.A, "B": group.B, "theta_c": jnp.degrees(angle)}
        if "e1" in problem.priors:
            direction = best_direction(p, grasp, theta, reach=reach)
            values |= {"e1": p.e1, "e2": p.e2, "f1": group.f1, "f2": group.f2}
            values["alpha_star"] = jnp.degrees(direction)
        if "F_0" in problem.priors:
            values["F_0"] = state.preload
        if state.sharpness is not None:
            values["p"] = state.sharpness
        for channel, sigma in zip(problem.channels, state.sigma, strict=True):
            if f"sigma_{channel}" in problem.priors:
                values[f"sigma_{channel}"] = sigma
        return values

    return jax.vmap(one)(x_samples)


def _middle_elevation(problem: Problem) -> Float[Array, ""]:
    """Median |θ| of the pushes: where α* is asked for with two supports."""
    used = jnp.any(problem.mask, axis=0)
    return jnp.nanmedian(jnp.where(used, jnp.abs(problem.pushes.theta), jnp.nan))


def median(samples: Float[np.ndarray, " n"], *, is_axis: bool = False) -> float:
    """Middle of the draws, of an axis in [0, 180) by its circular mean; NaN of none.

    Args:
        samples: Draws; NaN is left out.
        is_axis: Whether the draws are azimuths of period 180° [deg].
    """
    finite = _ascending(samples)
    if finite.size == 0:
        return float("nan")
    if not is_axis:
        return float(_quantiles(finite, 0.5))
    centre, offsets = unwrapped(finite)
    return float(np.mod(centre + np.median(offsets), HALF_TURN))


def equal_tailed_interval(
    samples: Float[np.ndarray, " n"], prob: float, *, is_axis: bool = False
) -> tuple[float, float]:
    """Interval that leaves (1 - prob) / 2 of the draws on either side.

    Args:
        samples: Draws; NaN is left out.
        is_axis: Whether the draws are azimuths of period 180° [deg].

    Returns:
        Lower and upper end. For an axis the lower lies in [0, 180) and the upper may
        exceed 180, so that upper - lower is always the width.

    Examples:
        >>> equal_tailed_interval(np.arange(101.0), 0.5)
        (25.0, 75.0)
        >>> axis = np.array([178.0, 179.0, 0.0, 1.0, 2.0])
        >>> [round(end, 6) for end in equal_tailed_interval(axis, 0.5, is_axis=True)]
        [179.0, 181.0]
    """
    finite = _ascending(samples)
    if finite.size == 0:
        return float("nan"), float("nan")
    tails = [(1 - prob) / 2, (1 + prob) / 2]
    if not is_axis:
        low, high = _quantiles(finite, tails)
        return float(low), float(high)
    centre, offsets = unwrapped(finite)
    low, high = np.quantile(offsets, tails)
    start = float(np.mod(centre + low, HALF_TURN))
    return start, start + float(high - low)


def _ascending(samples: Float[np.ndarray, " n"]) -> Float[np.ndarray, " m"]:
    """Draws without NaN in ascending order; those that are so pass unchanged."""
    ends = samples[[0, -1]] if samples.size else samples
    if np.all(samples[1:] >= samples[:-1]) and np.all(np.isfinite(ends)):
        return samples
    return np.sort(samples[np.isfinite(samples)])


def _quantiles(
    ascending: Float[np.ndarray, " n"], shares: float | list[float]
) -> Float[np.ndarray, "..."]:
    """Values below which shares of the draws lie, linear between one and the next."""
    # NumPy's own would put them in order again.
    at = np.multiply(shares, ascending.size - 1)
    return np.asarray(np.interp(at, np.arange(ascending.size), ascending))


def highest_density_set(
    samples: Float[np.ndarray, " n"],
    prob: float,
    *,
    is_axis: bool = False,
    has_ends: bool = False,
) -> tuple[Piece, ...]:
    """Smallest set with the given probability, in as many pieces as it needs.

    Args:
        samples: Draws; NaN is left out.
        is_axis: Whether the draws are azimuths of period 180° [deg].
        has_ends: Whether many draws may be one and the same, the lowest or the highest,
            as best directions beyond a reach are.

    Returns:
        Pieces, ascending; for an axis each as in `equal_tailed_interval`. An end that
        many draws are at is a piece without width, or the end of one.
    """
    finite = samples[np.isfinite(samples)]
    if finite.size == 0 or np.ptp(finite) == 0:
        return ()
    if is_axis:
        centre, offsets = unwrapped(finite)
        pieces = _densest(offsets, prob)
        starts = np.mod(centre + pieces[:, 0], HALF_TURN)
        widths = pieces[:, 1] - pieces[:, 0]
        return tuple(
            (float(start), float(start + width))
            for start, width in sorted(zip(starts, widths, strict=True))
        )
    if has_ends:
        return _with_ends(finite, prob)
    return tuple((float(low), float(high)) for low, high in _densest(finite, prob))


def _with_ends(finite: Float[np.ndarray, " n"], prob: float) -> tuple[Piece, ...]:
    """The smallest set of draws of which many may be the lowest or the highest one.

    A point has no width: it comes before any density. One that fewer draws are at than
    an interval leaves out on a side is no more than a tail.
    """
    shares = {
        end: float(np.mean(finite == end)) for end in (finite.min(), finite.max())
    }
    points: list[float] = []
    left = prob
    for end in sorted(shares, key=lambda end: -shares[end]):
        if left > 0 and shares[end] >= (1 - prob) / 2:
            points.append(float(end))
            left -= shares[end]
    rest = finite[~np.isin(finite, points)]
    pieces: list[list[float]] = []
    if left > 0 and np.ptp(rest) > 0:
        pieces = _densest(rest, left * finite.size / rest.size).tolist()
    bin_width = np.ptp(finite) / N_BINS
    for point in points:
        beside = [p for p in pieces if min(abs(e - point) for e in p) < 2 * bin_width]
        for piece in beside:
            piece[:] = min(point, *piece), max(point, *piece)
        if not beside:
            pieces.append([point, point])
    return tuple((low, high) for low, high in sorted(pieces))


def _densest(draws: Float[np.ndarray, " n"], prob: float) -> Float[np.ndarray, "k 2"]:
    """Ends of the pieces in which the density of draws is highest."""
    from arviz_stats.base.array import array_stats  # noqa: PLC0415 - slow to load

    # Draws of equal weight repeat, which any other bandwidth takes for narrow modes.
    bandwidth = array_stats.get_bw(np.unique(draws), bw="isj")
    pieces = array_stats.hdi(
        draws,
        prob=prob,
        method="multimodal",
        max_modes=MAX_PIECES,
        bw=bandwidth,
        grid_len=N_BINS,
    )
    pieces = np.asarray(pieces).reshape(-1, 2)
    # Unused places are NaN, and a single bin of the density has no width.
    return pieces[pieces[:, 0] < pieces[:, 1]]


def axis_within(
    degrees: Float[np.ndarray, " n"], low: float, high: float
) -> Float[np.ndarray, " n"]:
    """Axes as azimuths from `low` to `high`; those beyond count at the nearer end.

    Args:
        degrees: Azimuths of period 180° [deg].
        low: Lowest azimuth of the reach [deg].
        high: Highest, less than a half turn above it [deg].
    """
    angle = low + np.mod(degrees - low, HALF_TURN)
    is_low = low + HALF_TURN - angle < angle - high
    return np.where(angle <= high, angle, np.where(is_low, low, high))


def unwrapped(
    degrees: Float[np.ndarray, " n"],
) -> tuple[float, Float[np.ndarray, " n"]]:
    """Circular mean of axes and the signed distance of each from it [deg]."""
    half = HALF_TURN / 2
    turned = np.exp(1j * np.pi * degrees / half)
    centre = float(np.mod(np.angle(np.mean(turned)) * half / np.pi, HALF_TURN))
    return centre, np.mod(degrees - centre + half, HALF_TURN) - half


def contraction(
    posterior: Float[np.ndarray, " n"], prior: Float[np.ndarray, " m"]
) -> float:
    """Share of the prior variance that the data removed, on the scale of the prior.

        1 - var_posterior / var_prior

    Returns:
        At most 1; negative where the data contradict the prior.
    """
    return 1.0 - float(np.var(posterior) / np.var(prior))
