"""What items have in common: the mean and the spread of a population.

Every item was identified by itself under its own prior; here the prior is undone
(`pushfit.fit.population.item_likelihoods`) and the population takes its place.
Excluded: items that are correlated beyond a common population.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy import optimize, stats
from scipy.special import logsumexp

from pushfit.fit.population.item_likelihoods import (
    ItemDraws,
    Likelihoods,
    effective_draws,
    is_present,
    likelihoods,
    normalised,
)
from pushfit.fit.problem.priors.quadrature import draw_from_nodes

# Two leave a spread to its prior alone.
MIN_ITEMS = 3
# Fewer draws that count leave the item's likelihood to chance, by more than 20 %.
MIN_EFFECTIVE = 20.0
# Chance that an item of a normal population is named as outlying, all items together.
OUTLYING = 0.01
# Probability inside an interval.
PROB = 0.9
# Points along mean and spread, over about 6 standard deviations to either side.
N_GRID, HALF_WIDTH = 41, 6.0
# Points along all spreads that there may be, for items taken as normal.
N_SPREADS = 400
# Step of the mean, in standard deviations of it, that does not tell where it is.
COARSE = 0.6
# Probability at the edge of the grid, above which it is too narrow.
MAX_EDGE = 1e-3
# Share of the error of the mean below which no data tell a spread from zero.
SMALLEST_SPREAD = 0.002
# Share of the peak below which a spread is not looked at.
EMPTY = 1e-7
# Grids tried, each to twice as many standard deviations as the one before: 24 at last.
MAX_ROUNDS = 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Population:
    """Mean and spread of φ among items, in the unit of φ.

    Args:
        mean: Posterior mean of the population's mean.
        mean_interval: Interval with a probability of 90 %.
        spread: Posterior median of its standard deviation; None if it may be zero.
        spread_interval: Interval with 90 %; if the spread may be zero the lower end is
            None, and the spread is below the upper end with 90 %.
        n_items: Items that were pooled.
        effective_draws: Fewest draws that count of any of these items.
        outliers: Items that the rest of the population does not predict.
        not_usable: Items that are left out, because too few of their draws lie where
            the population is.
        is_edge_reached: Whether the grid holds too little of the posterior.
    """

    mean: float
    mean_interval: tuple[float, float]
    spread: float | None
    spread_interval: tuple[float | None, float]
    n_items: int
    effective_draws: float
    outliers: tuple[str, ...]
    not_usable: tuple[str, ...]
    is_edge_reached: bool


def pool(items: Sequence[ItemDraws], *, scale: float) -> Population | None:
    """Mean and spread of the population that the items are from.

    The prior of the mean is flat, that of the spread half a normal density,

        p(spread) ∝ exp(-spread² / (2 scale²)),  spread > 0

    Args:
        scale: How much items may well differ [unit of φ].

    Returns:
        The population; None with fewer than three usable items.
    """
    present = [item for item in items if is_present(item)]
    if len(present) < MIN_ITEMS:
        return None
    names = np.array([item.name for item in present], dtype=object)
    every = likelihoods(present)
    # Before the population: draws that count once the prior is undone.
    effective = effective_draws(present, every, mean=0.0, spread=np.inf)
    is_used = effective >= MIN_EFFECTIVE
    grid = None
    # Without items that are not usable the population moves, so look again.
    while grid is None or np.any(effective[is_used] < MIN_EFFECTIVE):
        is_used &= effective >= MIN_EFFECTIVE
        if np.sum(is_used) < MIN_ITEMS:
            return None
        grid = _Grid.around(every.take(is_used), scale)
        mean, spread = grid.middle()
        effective = effective_draws(present, every, mean=mean, spread=spread)
    is_outlying = _tails(every.take(is_used), scale) < OUTLYING / np.sum(is_used)
    spread, spread_interval = grid.spread()
    return Population(
        mean=grid.middle()[0],
        mean_interval=grid.mean_interval(),
        spread=spread,
        spread_interval=spread_interval,
        n_items=int(np.sum(is_used)),
        effective_draws=float(np.min(effective[is_used])),
        outliers=tuple(names[is_used][is_outlying]),
        not_usable=tuple(names[~is_used]),
        is_edge_reached=grid.edge > MAX_EDGE,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Grid:
    """Posterior of mean and ln spread, in steps of the mean that suit each spread.

    A small spread leaves the mean a narrow range and a large one a wide range, so that
    no rectangle holds both.
    """

    mean: Float[np.ndarray, "t s"]
    step: Float[np.ndarray, " s"]
    ln_spread: Float[np.ndarray, " s"]
    weights: Float[np.ndarray, "t s"]

    @classmethod
    def around(cls, items: Likelihoods, scale: float) -> "_Grid":
        """Posterior on a grid that holds it; items taken as normal tell where."""
        ln_s = _all_spreads(items, scale)
        density = _normal_items(items, ln_s, scale).log_density
        kept = np.flatnonzero(density > np.max(density) + np.log(EMPTY))
        low, high = ln_s[kept[0]], ln_s[kept[-1]]
        half_width = HALF_WIDTH
        for _ in range(MAX_ROUNDS):
            ln_spread = np.linspace(low, high, N_GRID)
            simple = _normal_items(items, ln_spread, scale)
            grid = cls._within(
                items,
                ln_spread,
                middle=simple.mean,
                half_width=half_width * simple.sd,
                scale=scale,
            )._finer(items, scale)
            if grid.edge < MAX_EDGE:
                break
            # More means are of no use where spreads are missing.
            if np.sum(grid.weights[[0, -1]]) > np.sum(grid.weights[:, [0, -1]]):
                half_width *= 2
            low = max(low - (high - low) / 4, ln_s[0])
            high = min(high + (high - low) / 4, ln_s[-1])
        return grid

    @classmethod
    def _within(
        cls,
        items: Likelihoods,
        ln_spread: Float[np.ndarray, " s"],
        *,
        middle: Float[np.ndarray, " s"],
        half_width: Float[np.ndarray, " s"],
        scale: float,
    ) -> "_Grid":
        """Posterior on given spreads, and means within a distance of a middle."""
        mean = middle + half_width * np.linspace(-1.0, 1.0, N_GRID)[:, None]
        log_density = items.at(mean, ln_spread) + _log_prior(ln_spread, scale)
        return cls(
            mean=mean,
            step=2 * half_width / (N_GRID - 1),
            ln_spread=ln_spread,
            weights=normalised(log_density + np.log(half_width)),
        )

    def _finer(self, items: Likelihoods, scale: float) -> "_Grid":
        """The same with finer steps of the mean where it is known better than these.

        As where most of an item is in one mode: taken as normal it is as wide as all.
        """
        grid = self
        for _ in range(MAX_ROUNDS):
            mass = np.sum(grid.weights, axis=0)
            parts = grid.weights / np.where(mass > 0, mass, 1.0)
            middle = np.sum(parts * grid.mean, axis=0)
            sd = np.sqrt(np.sum(parts * (grid.mean - middle) ** 2, axis=0))
            is_coarse = (mass > EMPTY) & (grid.step > COARSE * sd)
            if not np.any(is_coarse):
                break
            half_width = (N_GRID - 1) / 2 * grid.step
            finer = np.maximum(HALF_WIDTH * sd, 2 * grid.step)
            grid = grid._within(
                items,
                grid.ln_spread,
                middle=np.where(is_coarse, middle, grid.mean[N_GRID // 2]),
                half_width=np.where(is_coarse, finer, half_width),
                scale=scale,
            )
        return grid

    @property
    def edge(self) -> float:
        """Probability of the outermost points."""
        return float(1.0 - np.sum(self.weights[1:-1, 1:-1]))

    def middle(self) -> tuple[float, float]:
        """Mean of the mean, and of the log of the spread as a spread."""
        ln_spread = np.sum(self.weights * self.ln_spread)
        return float(np.sum(self.weights * self.mean)), float(np.exp(ln_spread))

    def mean_interval(self) -> tuple[float, float]:
        """Equal-tailed interval of the mean, probability even within a step."""

        def excess(value: float, prob: float) -> float:
            below = np.clip((value - self.mean) / self.step + 0.5, 0, 1)
            return float(np.sum(self.weights * below)) - prob

        ends = np.min(self.mean - self.step), np.max(self.mean + self.step)
        low, high = (
            float(np.asarray(optimize.brentq(excess, *ends, args=(prob,))))
            for prob in ((1 - PROB) / 2, (1 + PROB) / 2)
        )
        return low, high

    def spread(self) -> tuple[float | None, tuple[float | None, float]]:
        """Median and interval of the spread; a bound alone if it may be zero."""
        mass = np.sum(self.weights, axis=0)
        with np.errstate(divide="ignore"):
            log_mass = np.log(mass)
        # Density of the spread itself, not of its log: it may be highest at zero.
        order = np.argsort(self.ln_spread - log_mass, kind="stable")
        n_inside = np.searchsorted(np.cumsum(mass[order]), PROB) + 1
        if 0 in order[:n_inside]:
            (high,) = self._spreads(log_mass, [PROB])
            return None, (None, high)
        probs = [(1 - PROB) / 2, 0.5, (1 + PROB) / 2]
        low, middle, high = self._spreads(log_mass, probs)
        return middle, (low, high)

    def _spreads(
        self, log_mass: Float[np.ndarray, " s"], probs: Sequence[float]
    ) -> list[float]:
        """Quantiles of the spread."""
        found = draw_from_nodes(self.ln_spread[None], log_mass[None], np.array([probs]))
        return np.exp(found[0]).tolist()


@dataclass(frozen=True, slots=True, kw_only=True)
class _NormalItems:
    """Closed form of the posterior where all items are normal densities.

    Args:
        mean: Mean of the population's mean at each spread.
        sd: Standard deviation of that mean at each spread.
        log_density: Log density of ln spread, unnormalised.
    """

    mean: Float[np.ndarray, "*n s"]
    sd: Float[np.ndarray, "*n s"]
    log_density: Float[np.ndarray, "*n s"]


def _normal_items(
    items: Likelihoods,
    ln_spread: Float[np.ndarray, " s"],
    scale: float,
    *,
    without_one: bool = False,
) -> _NormalItems:
    """Posterior of normal items, of all or, item by item, of all others.

    References:
        Gelman et al., Bayesian Data Analysis (3rd ed.), section 5.4.
    """
    centre = np.median(items.mean)
    distance = (items.mean - centre)[:, None]
    precision = 1 / (items.sd[:, None] ** 2 + np.exp(2 * ln_spread))
    terms = np.array(
        [precision, precision * distance, precision * distance**2, np.log(precision)]
    )
    total = np.sum(terms, axis=1, keepdims=without_one)
    weight, first, second, log_weight = total - terms if without_one else total
    mean = first / weight
    misfit = second - first * mean
    return _NormalItems(
        mean=centre + mean,
        sd=weight**-0.5,
        log_density=(log_weight - np.log(weight) - misfit) / 2
        + _log_prior(ln_spread, scale),
    )


def _log_prior(
    ln_spread: Float[np.ndarray, " s"], scale: float
) -> Float[np.ndarray, " s"]:
    """Log density of ln spread, from half a normal density: ds = s d(ln s)."""
    return ln_spread - np.exp(2 * ln_spread) / (2 * scale**2)


def _all_spreads(items: Likelihoods, scale: float) -> Float[np.ndarray, " s"]:
    """Logs of all spreads that there may be, from one that no data tell from zero."""
    finest = np.min(items.sd) / np.sqrt(items.sd.size)
    low = SMALLEST_SPREAD * min(finest, scale)
    return np.linspace(np.log(low), np.log(8 * scale), N_SPREADS)


def _tails(items: Likelihoods, scale: float) -> Float[np.ndarray, " n"]:
    """Chance of an estimate as far out as each item's, given all others."""
    ln_spread = _all_spreads(items, scale)
    rest = _normal_items(items, ln_spread, scale, without_one=True)
    variance = rest.sd**2 + np.exp(2 * ln_spread) + items.sd[:, None] ** 2
    z = np.abs(items.mean[:, None] - rest.mean) / np.sqrt(variance)
    top = logsumexp(rest.log_density, axis=1, keepdims=True)
    return np.sum(np.exp(rest.log_density - top) * 2 * stats.norm.sf(z), axis=1)
