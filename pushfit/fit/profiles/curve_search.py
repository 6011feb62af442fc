"""Best fits along one quantity, as one program.

All searches, of families with θ_c held, of the curve and down from it, are rounds of as
many side by side: they share one evaluation. Excluded: what the curve is made of and
for (`pushfit.fit.profiles.curve`).
"""

from dataclasses import dataclass, replace
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from pushfit.fit.profiles.conditional_likelihood import SOME_ANGLE, Likelihood
from pushfit.fit.programs.compile import compiled
from pushfit.fit.sweep.outer_nodes import (
    again,
    ascending,
    begun,
    neighbouring,
    next_round,
    tempered,
)
from pushfit.fit.sweep.search import Count, Round, in_rounds
from pushfit.fit.sweep.target import Expansion
from pushfit.model import Scalar

# Values of a curve, and those that it begins with.
N_VALUES, N_FIRST = 96, 32
# Points of the pool that are followed side by side: as many fits as a curve has values.
N_TOGETHER = N_VALUES // N_FIRST
# Powers of the profile likelihood that place values, and the share each has; the rest
# gathers where it crosses the level, within so many standard deviations.
TEMPERS = ((1.0, 0.25), (0.2, 0.2), (0.02, 0.2))
CROSSING, AT_CROSSING = 0.15, 0.35
# Sharpness of the transition in each round, for points of the pool in turn and
# afterwards. Across the hard switch the other branch has no slope: a soft one leads
# there, and sharpens round by round. Its own valley may be another one, and so half of
# the points do without. Where forces are searched the switch is rounder, and each of
# them is slow: points of the pool are not followed. The last serves the ways down, too.
FAMILY_SHARPNESS = ((16.0, 1024.0), (4096.0, 4096.0))
SHARPNESS = (256.0, 4096.0, 1e6, 1e6, 1e6, 1e6)
# Fits side by side that have a curve's values free, too, at its end: from every second
# of its points, and from as many others at most.
EVERY = 2
N_OTHERS = N_VALUES - N_VALUES // EVERY

# Points and half the sums of squares of the best fits at the first values.
Best = tuple[Float[Array, "m w"], Float[Array, " m"]]


class Fits(eqx.Module):
    """Fits of a problem.

    Args:
        values: Of a quantity [ln unit, or rad].
        points: Data coordinates.
        costs: Half the sums of squares, very large where the value is impossible, and
            infinite where none was looked at.
    """

    values: Float[Array, " n"]
    points: Float[Array, "n q"]
    costs: Float[Array, " n"]

    @property
    def ascending(self) -> "Fits":
        """These fits, sorted by rising value of the quantity."""
        order = jnp.argsort(self.values)
        return jax.tree.map(lambda a: a[order], self)


class Met(eqx.Module):
    """Where the searches of a numbered round ended, also as fits."""

    ends: Expansion
    fits: Fits
    number: Int[Array, ""]


@compiled
def best_fits(
    target: Likelihood,
    values: Float[Array, " m"],
    *,
    along: Float[Array, "p q"],
    down: Float[Array, "k q"],
    level: Float[Array, ""],
    n_down: Int[Array, ""],
) -> tuple[Fits, Fits]:
    """Fits along a quantity, and those that they lead down to with nothing held.

    From each point they are followed with θ_c as it has it, where it can be held. From
    the best of all at each value the curve is followed with θ_c free.

    Args:
        target: Of a problem at data coordinates, θ_c free.
        values: Range to begin with, `N_FIRST` of them, ascending.
        along: Data coordinates that are followed, a multiple of `N_TOGETHER`.
        down: Those of fits with nothing held, `N_OTHERS` of them, beside the curve's.
        level: Δχ² at the ends of the set that is wanted.
        n_down: Steps down; none is made where it is 0.
    """
    begin = jax.vmap(jax.vmap(target.start, in_axes=(0, None)), in_axes=(None, 0))
    starts, costs = begin(values, along)
    best, angles = _lowest(starts, costs), jnp.zeros(0)
    if not target.problem.grasp.law.is_searched:
        best = best[0], jnp.full(values.shape, jnp.inf)
        angles = jax.vmap(target.critical_angle)(along)
    course = CurveRounds(
        target=target,
        held=_held(angles, target.index),
        ways=starts.reshape(-1, N_VALUES, starts.shape[2]),
        down=down,
        n_down=n_down,
        level=level,
    )
    numbers = jnp.arange(len(course.held))
    _, found = in_rounds(
        course.objective, numbers, course.first(best), state=best, onward=course
    )
    curve, ends = (jax.tree.map(lambda a, i=i: a[i], found) for i in (-2, -1))
    return curve, ends


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CurveRounds:
    """The rounds of searches: of families in turn, of the curve, and down from it.

    Args:
        target: What is to be least, θ_c free.
        held: θ_c, the sharpness of the switch, and which quantity has a value, of each
            search of each round.
        ways: Where families begin, `N_TOGETHER` at a time.
        down: Points that fits with nothing held begin from, beside those of the curve.
        n_down: Steps of these.
        level: Δχ² at the ends of the set that is wanted.
    """

    target: Likelihood
    held: Float[Array, "r n 3"]
    ways: Float[Array, "f n w"]
    down: Float[Array, "k q"]
    n_down: Int[Array, ""]
    level: Scalar

    @property
    def last(self) -> int:
        """Number of the last round of the curve."""
        return len(self.held) - 2

    @property
    def n_ahead(self) -> int:
        """Rounds before those of the curve: two for each way."""
        return self.last + 1 - len(SHARPNESS)

    @property
    def is_free_ahead(self) -> Bool[Array, " w"]:
        """Coordinates that are free where θ_c is held."""
        return replace(self.target, angle=jnp.zeros(())).is_free

    def objective(self, held: Float[Array, "3"]) -> Likelihood:
        """What is to be least in a search."""
        index = held[2].astype(int)
        return replace(self.target, angle=held[0], index=index).softened(held[1])

    def first(self, best: Best) -> Round:
        """Starts of the first round: of families, or of the curve where none are."""
        first = self._ahead(0) if self.n_ahead else self._along(best)
        return replace(first, held=self.held[0])

    def __call__(
        self, number: Int[Array, ""], ends: Expansion, best: Best
    ) -> tuple[Fits, Round, Best]:
        """From one round to the next."""
        # For all stages and for what is kept: the map takes long to compile.
        points = jax.vmap(lambda w, held: self.objective(held).point(w))(
            ends.y, self.held[number]
        )
        met = Met(ends, Fits(ends.y[:, 0], points, ends.cost), number)
        ahead = (self._within, self._beyond) if self.n_ahead else ()
        stages = (*ahead, self._onward, self._downward)
        after = len(ahead) + (number >= self.last)
        stage = jnp.where(number < self.n_ahead, number % 2, after)
        following, best = jax.lax.switch(stage, stages, met, best)
        following = replace(following, held=self.held[number + 1])
        return met.fits.ascending, following, best

    def _ahead(self, way: Count) -> Round:
        """Starts of the first round of families on one way."""
        return begun(self.ways[way], self.is_free_ahead)

    def _within(self, met: Met, best: Best) -> tuple[Round, Best]:
        """From the first round of families to their second."""

        def starts(nodes: Expansion) -> Float[Array, "m k w"]:
            at = nodes.y[:, 0]
            return neighbouring(self.target, nodes, self.is_free_ahead, at=at)

        found = jax.vmap(starts)(jax.tree.map(_by_family, met.ends))
        found = found.reshape(N_VALUES, *found.shape[2:])
        return again(found, self.is_free_ahead), best

    def _beyond(self, met: Met, best: Best) -> tuple[Round, Best]:
        """From families to others, or to the curve."""
        fits, after = met.fits, met.number + 1
        # Without their θ_c.
        w = jax.vmap(self.target.at)(fits.values, fits.points)
        best = _lowest(
            jnp.concatenate([best[0][None], _by_family(w)]),
            jnp.concatenate([best[1][None], _by_family(fits.costs)]),
        )
        following = jax.tree.map(
            partial(jnp.where, after == self.n_ahead),
            self._along(best),
            self._ahead(after // 2),
        )
        return following, best

    def _along(self, best: Best) -> Round:
        """Starts of the curve, at the best of the families."""
        which = jnp.sort(jnp.arange(N_VALUES) % N_FIRST)
        return begun(best[0][which], self.target.is_free)

    def _onward(self, met: Met, best: Best) -> tuple[Round, Best]:
        """From round to round of the curve."""
        target, is_final = self.target, met.number == self.last - 1
        nodes = ascending(met.ends)
        return next_round(
            target, nodes, target.is_free, placing=self._placing, is_final=is_final
        ), best

    def _placing(self, nodes: Expansion) -> Float[Array, " g"]:
        """Where its values are wanted: many where it crosses the level."""
        u = nodes.y[:, 0]
        delta = nodes.cost - jnp.min(nodes.cost)
        miss = (jnp.sqrt(2 * delta) - jnp.sqrt(self.level)) / CROSSING
        at_level = tempered(u, -(miss**2) / 2, ((1.0, AT_CROSSING),))
        return tempered(u, -delta, TEMPERS) + at_level

    def _downward(self, met: Met, best: Best) -> tuple[Round, Best]:
        """From the curve to what it leads down to."""
        free = self.objective(self.held[-1, 0])
        points = met.fits.ascending.points[::EVERY]
        points = jnp.concatenate([points, self.down])
        starts = jax.vmap(lambda y: free.at(y[0], y))(points)
        down = begun(starts, free.is_free.at[0].set(True), self.n_down)
        return replace(down, n_starts=jnp.minimum(self.n_down, 1)), best


def _held(angles: Float[Array, " p"], index: Int[Array, ""]) -> Float[Array, "r n 3"]:
    """What each search of each round is held by; see `CurveRounds`.

    Args:
        angles: θ_c of families; NaN where it has none.
        index: Which quantity has a value, but on the ways down.
    """
    known = jnp.nan_to_num(angles, nan=SOME_ANGLE)[:, None]
    sharpness = jnp.asarray(FAMILY_SHARPNESS)[jnp.arange(angles.size) % 2]
    ahead = jnp.stack(jnp.broadcast_arrays(known, sharpness), axis=2)
    ahead = ahead.reshape(-1, N_TOGETHER, 2, 2).swapaxes(1, 2)
    ahead = jnp.repeat(ahead.reshape(-1, N_TOGETHER, 2), N_FIRST, axis=1)
    after = jnp.asarray([(jnp.nan, p) for p in (*SHARPNESS, SHARPNESS[-1])])
    after = jnp.broadcast_to(after[:, None], (len(after), N_VALUES, 2))
    held = jnp.concatenate([ahead, after])
    which = jnp.broadcast_to(index.astype(float), held.shape[:2]).at[-1].set(0.0)
    return jnp.concatenate([held, which[..., None]], axis=2)


def _by_family(values: Float[Array, "n ..."]) -> Float[Array, "f m ..."]:
    """Fits of families that are followed together, apart."""
    return values.reshape(N_TOGETHER, N_FIRST, *values.shape[1:])


def _lowest(w: Float[Array, "k m w"], costs: Float[Array, "k m"]) -> Best:
    """The best of several fits at each value."""
    best = jnp.argmin(costs, axis=0)
    at = jnp.arange(best.size)
    return w[best, at], costs[best, at]
