"""Weighted draws from a posterior, proposed where the sweep found its mass.

A draw follows the sheet: u, the inner coordinate, ln s, the Gaussian rest, what the
prior alone knows, and the noise. Its weight is the posterior density, as `Problem` has
it, over the density of the proposal, so that no approximation of the sweep biases
anything: it only costs effective draws. Excluded: how many are drawn, and smoothing
their weights (`pushfit.fit.sweep.posterior`).
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import logsumexp, ndtri
from jax.scipy.stats import norm
from jaxtyping import Array, Float, Int

from pushfit.fit.sweep.cholesky import (
    back_solve,
    cholesky,
    log_diagonal,
    solve,
    squared_length,
)
from pushfit.fit.sweep.likelihood import sigma_nodes
from pushfit.fit.sweep.segments import draw_segment, with_tails
from pushfit.fit.sweep.sheet import (
    N_STRATA,
    Sheet,
    T,
    local,
    prior_given,
)
from pushfit.fit.sweep.target import SMALLEST_SLOPE, Expansion, Target
from pushfit.mechanics.combinations import anisotropy_stretch
from pushfit.mechanics.numerics import norm2
from pushfit.model import Scalar
from pushfit.parameters import TINY

# The Gaussian rest in several widths, and as the prior has it: shares of each. By one
# width alone far fewer draws count.
WIDTHS, SHARES = (1.0, 1.7, 3.5), (0.55, 0.2, 0.1, 0.15)
# The same with an unknown sharpness: the last has it from the prior, the rest given it.
# Its likelihood is flat towards a hard transition, and steep where it is too soft.
SHARES_WITH_P = (0.45, 0.15, 0.1, 0.1, 0.2)
# Normal scores end here, at 4.75, since their tables do at 5: 1e-6 of a prior is
# beyond.
SMALLEST = 1e-6
# Steps towards the B of a round contact of the same K_st.
N_ROUND = 3


class Draw(eqx.Module):
    """A weighted draw.

    Args:
        x: Sampling coordinates.
        log_weight: Log of posterior over proposal density; -inf where impossible.
        log_prob: Unnormalised log posterior density.
        outer: u, by which draws are sorted before they are thinned.
    """

    x: Float[Array, "*n p"]
    log_weight: Float[Array, "*n"]
    log_prob: Float[Array, "*n"]
    outer: Float[Array, "*n"]


class Uniforms:
    """Numbers in (0, 1), handed out in order."""

    def __init__(self, values: Float[Array, " d"]) -> None:
        """Keep the numbers; none is handed out yet."""
        self.values, self.used = values, 0
        self.scores = _score(values)

    def one(self) -> Scalar:
        """The next number."""
        self.used += 1
        return self.values[self.used - 1]

    def score(self) -> Scalar:
        """The next number as a standard normal score."""
        self.used += 1
        return self.scores[self.used - 1]


def _score(share: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Standard normal score below which a share lies."""
    return ndtri(jnp.clip(share, SMALLEST, 1 - SMALLEST))


def n_uniforms(target: Target) -> int:
    """Largest count of uniform numbers that one draw uses up."""
    return 5 + len(target.pooled.problem.names)


def draw(target: Target, sheet: Sheet, uniform: Float[Array, " d"]) -> Draw:
    """One draw, made of uniform numbers.

    Args:
        uniform: As many numbers in (0, 1) as `n_uniforms` says.
    """
    numbers, roles = Uniforms(uniform), target.roles
    held, place, log_q = _swept(sheet, numbers)
    node = jax.tree.map(lambda a: a[place], sheet.nodes)
    score = jnp.zeros(())
    if roles.has_s:
        score, log_s = _score_of_s(sheet.strata[place], numbers)
        ln_s, _ = target.tables["ln_s"].draw(target.seen(node.y)["ln_B"], score)
        held, log_q = jnp.concatenate([held, ln_s[None]]), log_q + log_s
    y = held
    if held.size < target.mean.size:
        rest, log_rest = _rest(target, node, held, numbers)
        y, log_q = jnp.concatenate([held, rest]), log_q + log_rest
    z = target.seen(y)
    log_q = log_q + _conditional(target, z, score, numbers)
    difference = target.differences_at(z)
    log_q = log_q + _noise(target, z, difference, numbers)
    x = target.vector(z)
    log_prob = target.log_prob_of(x, difference)
    log_weight = log_prob + _stand_ins(target, y) - log_q
    return Draw(
        x=x,
        log_weight=jnp.where(jnp.isnan(log_weight), -jnp.inf, log_weight),
        log_prob=log_prob,
        outer=y[0],
    )


def _swept(
    sheet: Sheet, numbers: Uniforms
) -> tuple[Float[Array, " 2"], tuple[Int[Array, ""], Int[Array, ""]], Scalar]:
    """Outer and inner coordinate, the node nearest to them, log density."""
    along = draw_segment(sheet.outer, numbers.one())
    u = sheet.u
    gap = u[along.segment + 1] - u[along.segment]
    outer = u[along.segment] + along.share * gap
    # Of the two nodes around it, the nearer one more often.
    j = along.segment + (numbers.one() < along.share)
    across = draw_segment(jax.tree.map(lambda a: a[j], sheet.inner), numbers.one())
    t = jnp.asarray(T)
    step = t[across.segment + 1] - t[across.segment]
    scale = jax.tree.map(lambda a: a[j], sheet.scale)
    inner, log_slope = scale.at(t[across.segment] + across.share * step)
    k: Int[Array, ""] = across.segment + (across.share >= 0.5)
    slope, limit = sheet.ridge[j, k]
    inner = inner + jnp.clip(slope * (outer - u[j]), -limit, limit)
    log_density = along.log_density + across.log_density - log_slope
    return jnp.stack([outer, inner]), (j, k), log_density


def _score_of_s(shares: Float[Array, " s"], numbers: Uniforms) -> tuple[Scalar, Scalar]:
    """Normal score of ln s, and the log of its density over the prior's."""
    ends = jnp.cumsum(shares)
    wanted = numbers.one() * ends[-1]
    i = jnp.minimum(jnp.sum(ends < wanted), N_STRATA - 1)
    own = jnp.maximum(shares[i], TINY)
    part = jnp.clip((wanted - (ends[i] - shares[i])) / own, 0.0, 1.0)
    return _score((i + part) / N_STRATA), jnp.log(own * N_STRATA)


def _rest(
    target: Target, node: Expansion, held: Float[Array, " h"], numbers: Uniforms
) -> tuple[Float[Array, " k"], Scalar]:
    """The Gaussian coordinates and the log density of their mixture."""
    near = local(target, node, held)
    precision, mean, _ = prior_given(target, held)
    n, k = held.size, near.centre.size
    prior = cholesky(precision[n:, n:])
    offset = solve(prior, -(precision[n:, :n] @ (held - mean[:n])))
    has_p = target.roles.others[-1] == "ln_p"
    shares = SHARES_WITH_P if has_p else SHARES
    scores = jnp.stack([numbers.score() for _ in range(k)])
    which = jnp.sum(numbers.one() > np.cumsum(shares)[:-1])
    width = jnp.asarray([*WIDTHS, 1.0, 1.0])[which]
    # The score of the last coordinate is its own: it comes first, the others given it.
    own, centre = near.factor[-1, -1], near.centre[-1]
    p_mean, p_sd = mean[-1], 1 / jnp.sqrt(precision[-1, -1])
    moved = scores.at[-1].set(own * (p_mean + p_sd * scores[-1] - centre))
    scaled = width * jnp.where(which > len(WIDTHS), moved, scores)
    around = near.centre + back_solve(near.factor, scaled)
    anywhere = mean[n:] + offset + back_solve(prior, scores)
    rest = jnp.where(which == len(WIDTHS), anywhere, around)
    square = squared_length(near.factor, rest - near.centre)
    levels = [
        log_diagonal(near.factor) - square / (2 * w**2) - k * np.log(w) for w in WIDTHS
    ]
    from_prior = squared_length(prior, rest - mean[n:] - offset)
    levels.append(log_diagonal(prior) - from_prior / 2)
    if has_p:
        others = square - (own * (rest[-1] - centre)) ** 2
        others = others + ((rest[-1] - p_mean) / p_sd) ** 2
        levels.append(log_diagonal(near.factor) - jnp.log(own * p_sd) - others / 2)
    log_density = logsumexp(jnp.stack(levels) + np.log(shares))
    return rest, log_density - k * np.log(2 * np.pi) / 2


def _conditional(
    target: Target, z: dict[str, Scalar], s_score: Scalar, numbers: Uniforms
) -> Scalar:
    """Fill in what the prior alone knows; the log density of it all."""
    log_q = jnp.zeros(())
    for name in target.roles.conditional:
        if name == "ln_s":
            z[name], log_density = _ln_s(target, z, s_score)
        elif name == "ln_r":
            z[name], log_density = target.tables[name].draw(z["ln_A"], numbers.score())
        else:
            state = target.pooled.problem.state(target.vector(z))
            spring = jnp.log(state.params.K_st) - z["ln_s"]
            z[name], log_density = target.tables[name].draw(spring, numbers.score())
        log_q = log_q + log_density
    return log_q


def _ln_s(target: Target, z: dict[str, Scalar], score: Scalar) -> tuple[Scalar, Scalar]:
    """Ln s from its prior given B, and the log density of such draws.

    With an ellipse K_st is not B (1 + s). The table is entered with the B of a round
    contact of the same K_st, so that a narrow prior of K_st is met.
    """
    table = target.tables["ln_s"]
    half = norm2(z.get("f1", jnp.zeros(())), z.get("f2", jnp.zeros(()))) / 2

    def quantile(score: Scalar) -> Scalar:
        def closer(_: Int[Array, ""], longer: Scalar) -> Scalar:
            s = jnp.exp(table.draw(z["ln_B"] + longer, score)[0])
            cosh = jnp.cosh(anisotropy_stretch(half, s) * half)
            return jnp.log1p(2 * s * (cosh - 1) / (1 + s) ** 2) / 2

        longer = jax.lax.fori_loop(0, N_ROUND, closer, jnp.zeros(()))
        return table.draw(z["ln_B"] + longer, score)[0]

    if "f1" not in z:
        return table.draw(z["ln_B"], score)
    ln_s, slope = jax.jvp(quantile, (score,), (jnp.ones(()),))
    slope = jnp.maximum(jnp.abs(slope), SMALLEST_SLOPE)
    return ln_s, norm.logpdf(score) - jnp.log(slope)


def _noise(
    target: Target,
    z: dict[str, Scalar],
    difference: Float[Array, "c n"],
    numbers: Uniforms,
) -> Scalar:
    """Fill in every sampled noise; the log density of it all."""
    log_q = jnp.zeros(())
    if not target.roles.sigmas:
        return log_q
    for channel, name in enumerate(target.pooled.problem.channels):
        nodes, level = sigma_nodes(target.pooled, channel, difference[channel])
        drawn = draw_segment(with_tails(nodes, level), numbers.one())
        gap = nodes[drawn.segment + 1] - nodes[drawn.segment]
        z[f"ln_sigma_{name}"] = nodes[drawn.segment] + drawn.share * gap
        log_q = log_q + drawn.log_density
    return log_q


def _stand_ins(target: Target, y: Float[Array, " q"]) -> Scalar:
    """Log density of swept coordinates that stand for nothing."""
    total = jnp.zeros(())
    for i, name in enumerate((target.roles.pivot, target.roles.inner)):
        if name is None:
            total = total + norm.logpdf(y[i], target.mean[i])
    return total
