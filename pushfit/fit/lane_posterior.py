"""Exact posteriors of many tables at once, each with a bound on its own error.

The integral is that of `integrand`, over u = ln tan θ_c outside and ln C_rr and ln A
inside, in arrays of fixed size. Cells end at every pushed elevation and crowd around
the modes; inner integrals are centred on the ridge and stretched by sinh, where equal
steps converge exponentially. A table for which that is not enough shows it in its error
and is for the adaptive engine. Excluded: single tables.
"""

import functools

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import logsumexp
from jaxtyping import Array, Float

from pushfit.fit.lane_fit import LaneFit, NormalPrior, climb
from pushfit.fit.lanes import Face, Lane, Parabola
from pushfit.fit.programs import compiled
from pushfit.model import Scalar
from pushfit.numerics import sinhc

# Gauss rule of 3 points inside Kronrod's of 7.
NODES = np.array([-0.960491268708020, -0.774596669241483, -0.434243749346802, 0.0])
NODES = np.concatenate([NODES, -NODES[2::-1]])
KRONROD = np.array([0.104656226026467, 0.268488089868333, 0.401397414775962])
KRONROD = np.concatenate([KRONROD, [0.450916538658474], KRONROD[::-1]])
GAUSS = np.array([0.0, 5 / 9, 0.0, 8 / 9, 0.0, 5 / 9, 0.0])

# How many times the square of the 3-point rule's error the 7-point rule may err.
MARGIN = 5.0

# Modes with cells of their own, and the ladder of cells up from each.
N_MODES = 3
LADDER = np.array([1.0, 2.5, 6.0, 15.0, 40.0])
# Cells spread evenly over the prior, and cells kept for the final rule.
N_EVEN, N_CELLS = 20, 44
# Standard deviations of the prior that the outer range covers.
N_SD = 9.5
# Nodes of the inner rules, and the stretch that reaches 7 standard deviations of A.
N_C, N_A, REACH_A = 25, 13, 2.6
# Nodes over the prior of C_rr from which the ridge of a cell is sought, and steps from
# there to that of one of its nodes.
N_SCREEN, N_FOLLOWED = 21, 4
# Newton steps to the mode of ln A.
N_NEWTON = 3
# A density this far below its peak is nothing.
DEPTH = 24.0
# Modes whose misfit is worse by more than this need no cells.
FAR = 30.0
# Outer nodes that share the processor's cache.
BATCH = 8


class LanePosterior(eqx.Module):
    """Posterior of one table on its nodes.

    Args:
        u: Outer nodes, ascending.
        log_mass: Log of weight times integrand of each, -inf where left out.
        log_density: Log of the integrand.
        is_joined: Whether a node and the next belong to adjoining cells.
        centre: ln C_rr at t = 0 for each node.
        scale: Stretch of sinh(t).
        t: Inner nodes.
        log_inner: Log density of t.
        log_evidence: Log marginal likelihood.
        error: Bound on its relative error.
    """

    u: Float[Array, " n"]
    log_mass: Float[Array, " n"]
    log_density: Float[Array, " n"]
    is_joined: Array
    centre: Float[Array, " n"]
    scale: Float[Array, " n"]
    t: Float[Array, "n m"]
    log_inner: Float[Array, "n m"]
    log_evidence: Scalar
    error: Scalar


class Ridge(eqx.Module):
    """Where the density over ln C_rr sits at given u, and how far it reaches.

    Args:
        centre: Mode of ln C_rr.
        scale: Its standard deviation.
        first: Where density begins.
        last: Where it ends.
        ln_A: Mode of ln A there.
        log_density: About the log of the integral over C_rr and A.
    """

    centre: Scalar
    scale: Scalar
    first: Scalar
    last: Scalar
    ln_A: Scalar
    log_density: Scalar


def integrate_lane(lane: Lane, fit: LaneFit) -> LanePosterior:
    """Integrate the posterior of a table.

    Args:
        lane: Table.
        fit: Its modes.

    Returns:
        Nodes, evidence and error bound.
    """
    edges = _edges(lane, fit)
    middle = (edges[1:] + edges[:-1]) / 2
    width = edges[1:] - edges[:-1]
    seen = jax.lax.map(lambda u: _ridge(lane, u), middle, batch_size=BATCH)
    log_screen = _screened_mass(middle, width, seen.log_density)
    kept = jnp.sort(jnp.argsort(-log_screen)[:N_CELLS])
    low, half = edges[:-1][kept], width[kept] / 2
    u = (low + half)[:, None] + half[:, None] * jnp.asarray(NODES)[None]
    ridges = jax.tree.map(lambda x: jnp.repeat(x[kept], NODES.size), seen)
    inner = jax.lax.map(
        lambda part: _over_C(lane, *part), (u.ravel(), ridges), batch_size=BATCH
    )
    centre, scale, t, log_inner, log_f, inner_error = inner
    log_f = log_f.reshape(u.shape)
    peak = jnp.max(log_f)
    peak = jnp.where(jnp.isfinite(peak), peak, 0.0)
    f = jnp.exp(log_f - peak)
    kronrod, gauss = half * (f @ jnp.asarray(KRONROD)), half * (f @ jnp.asarray(GAUSS))
    total = jnp.sum(kronrod)
    left_out = jnp.exp(logsumexp(log_screen) - peak) - jnp.exp(
        logsumexp(log_screen[kept]) - peak
    )
    error = jnp.sum(_rule_errors(f, half, kronrod, gauss)) + jnp.maximum(left_out, 0.0)
    mass = half[:, None] * f * jnp.asarray(KRONROD)[None]
    error = error + jnp.sum(mass * inner_error.reshape(u.shape))
    last = jnp.arange(u.size) % NODES.size == NODES.size - 1
    adjoining = jnp.repeat(jnp.append(jnp.diff(kept) == 1, False), NODES.size)
    return LanePosterior(
        u=u.ravel(),
        log_mass=jnp.log(mass).ravel() + peak,
        log_density=log_f.ravel(),
        is_joined=jnp.where(last, adjoining, True),
        centre=centre,
        scale=scale,
        t=t,
        log_inner=log_inner,
        log_evidence=jnp.log(total) + peak,
        error=error / jnp.where(total > 0, total, 1.0),
    )


def _screened_mass(middle: Array, width: Array, log_f: Array) -> Array:
    """About the log of the integral over every cell, from its middle and its slope."""
    gap = middle[2:] - middle[:-2]
    slope = (log_f[2:] - log_f[:-2]) / jnp.where(gap > 0, gap, 1.0)
    slope = jnp.concatenate([slope[:1], slope, slope[-1:]])
    rise = jnp.clip(jnp.nan_to_num(slope) * width / 2, -20.0, 20.0)
    mass = log_f + jnp.log(jnp.where(width > 0, width, 1.0)) + jnp.log(sinhc(rise))
    return jnp.where((width > 0) & ~jnp.isnan(mass), mass, -jnp.inf)


def _rule_errors(f: Array, half: Array, kronrod: Array, gauss: Array) -> Array:
    """Error of every cell.

    The 7-point rule has more than twice the digits of the 3-point rule inside it.
    """
    mean = kronrod / jnp.where(half > 0, 2 * half, 1.0)
    spread = half * (jnp.abs(f - mean[:, None]) @ jnp.asarray(KRONROD))
    safe = jnp.where(spread > 0, spread, 1.0)
    difference = jnp.abs(kronrod - gauss)
    error = jnp.minimum(safe, safe * (MARGIN * difference / safe) ** 2)
    return jnp.where(spread > 0, error, difference)


def _edges(lane: Lane, fit: LaneFit) -> Float[Array, " e"]:
    """Ends of the cells: pushed elevations, ladders from the modes, an even spread."""
    theta = lane.pushes.theta
    used = jnp.any(lane.weight > 0, axis=0) & (theta > 0) & (theta < jnp.pi / 2)
    tables = (lane.prior_A, lane.prior_B, lane.prior_C)
    centre = lane.prior_B.mean - lane.prior_C.mean - lane.prior_A.mean
    spread = N_SD * jnp.sqrt(sum(table.sd**2 for table in tables))
    low, high = centre - spread, centre + spread
    knots = jnp.log(jnp.tan(jnp.clip(jnp.abs(theta), 1e-3, jnp.pi / 2 - 1e-3)))
    knots = jnp.where(used, knots, low)
    if np.isfinite(lane.grasp.sharpness):
        knots = knots[:1]
    distance = jnp.abs(fit.u[:N_MODES, None] - fit.u[None, :N_MODES])
    is_near = distance < fit.width[None, :N_MODES] / 2
    is_repeat = jnp.any(jnp.tril(is_near, -1), axis=1)
    matters = (fit.chi_square[:N_MODES] < fit.chi_square[0] + FAR) & ~is_repeat
    rungs = jnp.concatenate([-jnp.asarray(LADDER), jnp.asarray(LADDER)])
    ladders = fit.u[:N_MODES, None] + fit.width[:N_MODES, None] * rungs[None]
    ladders = jnp.where(matters[:, None], ladders, low)
    even = jnp.linspace(low, high, N_EVEN + 1)
    edges = jnp.concatenate([knots, ladders.ravel(), even])
    return jnp.sort(jnp.clip(jnp.nan_to_num(edges, nan=low), low, high))


def _ridge(lane: Lane, u: Scalar) -> Ridge:
    """Mode of ln C_rr at given u: a screen over the prior, then damped Gauss-Newton."""
    face, low, high = lane.face(u), lane.prior_C.start, lane.prior_C.end
    grid = jnp.linspace(low, high, N_SCREEN)
    step = grid[1] - grid[0]
    level, a = jax.vmap(lambda c: _laplace(lane, face, u, c))(grid)
    level = jnp.where(jnp.isfinite(level), level, -jnp.inf)
    top = jnp.argmax(level)
    centre, scale, _ = climb(lane, face, (grid[top], a[top]), _normal_prior(lane, u))
    centre = jnp.clip(centre, low, high)
    scale = jnp.minimum(scale, lane.prior_C.sd)
    best, ln_A = _laplace(lane, face, u, centre)
    # How far the screen sees any density on either side of the ridge.
    seen = level > best - DEPTH
    return Ridge(
        centre=centre,
        scale=scale,
        first=jnp.min(jnp.where(seen, grid - step, centre)),
        last=jnp.max(jnp.where(seen, grid + step, centre)),
        ln_A=ln_A,
        log_density=best + jnp.log(scale),
    )


def _normal_prior(lane: Lane, u: Scalar) -> NormalPrior:
    """Prior of ln C_rr and ln A at given u, as if it were normal."""
    return NormalPrior(
        jnp.stack([lane.prior_C.mean, lane.prior_A.mean, lane.prior_B.mean - u]),
        jnp.stack([lane.prior_C.sd, lane.prior_A.sd, lane.prior_B.sd]) ** -2,
    )


def _laplace(lane: Lane, face: Face, u: Scalar, c: Scalar) -> tuple[Scalar, Scalar]:
    """About the log of the integral over A, and the mode of ln A."""
    parabola = lane.parabola(lane.shape(face, c))
    a, sd = _mode_of_A(lane, parabola, u + c)
    return _log_joint(lane, parabola, u + c, a) + jnp.log(sd) + _log_C(lane, c), a


def _log_C(lane: Lane, c: Scalar) -> Scalar:
    return lane.prior_C.log_prob(c)


def _mode_of_A(lane: Lane, parabola: Parabola, ratio: Scalar) -> tuple[Scalar, Scalar]:
    """Mode and standard deviation of ln A, priors taken as normal."""
    precision_A, precision_B = lane.prior_A.sd**-2, lane.prior_B.sd**-2
    mean_A, mean_B = lane.prior_A.mean, lane.prior_B.mean - ratio
    total = precision_A + precision_B
    prior = (precision_A * mean_A + precision_B * mean_B) / total
    reach = 9 * jax.lax.rsqrt(total)

    def weighted(A: Scalar) -> tuple[Scalar, Scalar]:
        rates = lane.rates(parabola.squares(A))
        weights = [k * rate for k, rate in zip(parabola.curvature, rates, strict=True)]
        off = [w * (A - best) for w, best in zip(weights, parabola.best, strict=True)]
        return jnp.asarray(sum(weights)), jnp.asarray(sum(off))

    weight, off = weighted(jnp.exp(mean_A))
    # With sigma known this is the best A; else a first guess of it.
    best = jnp.exp(mean_A) - off / weight
    start = jnp.where(best > 0, jnp.log(jnp.where(best > 0, best, 1.0)), prior)
    a = jnp.clip(start, prior - reach, prior + reach)
    for _ in range(N_NEWTON):
        A = jnp.exp(a)
        weight, off = weighted(A)
        pull = precision_A * (a - mean_A) + precision_B * (a - mean_B)
        second = weight * A**2 + total
        a = a - jnp.clip((off * A + pull) / second, -1.0, 1.0)
    return a, jax.lax.rsqrt(second)


def _log_joint(lane: Lane, parabola: Parabola, ratio: Scalar, a: Scalar) -> Scalar:
    """Log of likelihood times the priors of A and B, where ln B = ln A + ratio."""
    likelihood = lane.log_likelihood(parabola.squares(jnp.exp(a)))
    return likelihood + lane.prior_A.log_prob(a) + lane.prior_B.log_prob(a + ratio)


def _over_A(lane: Lane, face: Face, u: Scalar, c: Scalar) -> tuple[Scalar, Scalar]:
    """Log of the integral over A, and its relative error."""
    parabola = lane.parabola(lane.shape(face, c))
    log_f, _ = nodes_of_A(lane, parabola, u + c)
    log_total, error = _trapezoid(log_f, 2 * REACH_A / (N_A - 1))
    return log_total + _log_C(lane, c), error


def nodes_of_A(
    lane: Lane, parabola: Parabola, ratio: Scalar
) -> tuple[list[Scalar], list[Scalar]]:
    """Log density of t at equal steps of it, and ln A there.

    A list and not an array, so that compiled code keeps every node in a register.
    """
    centre, sd = _mode_of_A(lane, parabola, ratio)
    t = np.linspace(-REACH_A, REACH_A, N_A)
    a = [centre + sd * float(np.sinh(x)) for x in t]
    slope = [jnp.log(sd) + float(np.log(np.cosh(x))) for x in t]
    log_f = [
        _log_joint(lane, parabola, ratio, x) + s for x, s in zip(a, slope, strict=True)
    ]
    return log_f, a


def _trapezoid(log_f: list[Scalar], step: Scalar | float) -> tuple[Scalar, Scalar]:
    """Log of the sum over equal steps, and its error from every other node."""
    log_f = [jnp.where(jnp.isnan(value), -jnp.inf, value) for value in log_f]
    peak = functools.reduce(jnp.maximum, log_f)
    peak = jnp.where(jnp.isfinite(peak), peak, 0.0)
    f = [jnp.exp(value - peak) for value in log_f]
    ends = (f[0] + f[-1]) / 2
    fine, coarse = sum(f) - ends, 2 * (sum(f[::2]) - ends)
    safe = jnp.where(fine > 0, fine, 1.0)
    # Halving the step squares the error of an exponentially convergent sum.
    relative = jnp.minimum(jnp.abs(fine - coarse) / safe, 1.0)
    return jnp.log(fine * step) + peak, relative**2 + ends / safe


def _over_C(lane: Lane, u: Scalar, ridge: Ridge):
    """Integral over ln C_rr and ln A at given u.

    Args:
        lane: Table.
        u: ln tan θ_c.
        ridge: Ridge in the middle of the cell of u.

    Returns:
        Centre and scale of the ridge at u, nodes t, log density of t, log integral over
        C_rr and A, and its error.
    """
    face, low, high = lane.face(u), lane.prior_C.start, lane.prior_C.end
    normal, start = _normal_prior(lane, u), (ridge.centre, ridge.ln_A)
    centre, scale, _ = climb(lane, face, start, normal, n_steps=N_FOLLOWED)
    centre = jnp.clip(centre, low, high)
    scale = jnp.minimum(scale, lane.prior_C.sd)
    below = jnp.minimum(jnp.maximum(8 * scale, centre - ridge.first), centre - low)
    above = jnp.minimum(jnp.maximum(8 * scale, ridge.last - centre), high - centre)
    first, last = -jnp.arcsinh(below / scale), jnp.arcsinh(above / scale)
    t = jnp.linspace(first, last, N_C)
    c = centre + scale * jnp.sinh(t)
    log_f, inner_error = jax.vmap(lambda c: _over_A(lane, face, u, c))(c)
    log_inner = log_f + jnp.log(scale * jnp.cosh(t))
    log_inner = jnp.where(jnp.isnan(log_inner), -jnp.inf, log_inner)
    total, error = _trapezoid(list(log_inner), t[1] - t[0])
    share = jax.nn.softmax(log_inner)
    return centre, scale, t, log_inner, total, error + jnp.sum(share * inner_error)


@compiled
def integrate_lanes(lanes: Lane, fits: LaneFit) -> LanePosterior:
    """`integrate_lane` of stacked lanes and their fits."""
    return jax.vmap(integrate_lane)(lanes, fits)
