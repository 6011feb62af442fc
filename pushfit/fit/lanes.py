"""Tables in a form in which many go through one compiled program side by side.

A lane is one table with repeated pushes pooled, so that its likelihood at given θ_c and
C_rr is a parabola in A, known from two sums over directions. It holds arrays only;
lanes of equal shape are stacked and mapped. Excluded: searching and integrating.
"""

from collections.abc import Mapping

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.special import logsumexp

from pushfit.fit.log_density import Table
from pushfit.fit.noise_grid import make_noise_grid
from pushfit.fit.priors import log_prior_at
from pushfit.fit.problem import Problem
from pushfit.fit.scan import is_linear
from pushfit.model import Contact, Grasp, Pushes, Scalar, forward
from pushfit.numerics import norm2

# Pushes closer than this in both angles are repeats [rad].
SAME_DIRECTION = 1e-9
# Directions come in multiples of this, so that few programs serve all tables.
PADDING = 8
# Sums of squares on which a likelihood without sigma is read.
N_SQUARES = 512
# How far, as a factor, the sums reach beyond those of the data.
SQUARES_MARGIN = 1e3


class Face(eqx.Module):
    """Forces of every direction for one θ_c, at A = 1 and C_rr = 1."""

    normal: Float[Array, " n"]
    tangential: Float[Array, " n"]


class Parabola(eqx.Module):
    """Misfit of every channel as a function of A.

        Q = least + curvature (A - best)²

    One number per channel and not an array of them: loops over two or three entries
    inside of a compiled program cost more than all they compute.
    """

    best: tuple[Scalar, ...]
    curvature: tuple[Scalar, ...]
    least: tuple[Scalar, ...]

    def squares(self, A: Scalar) -> tuple[Scalar, ...]:
        """Q of every channel."""
        channels = zip(self.best, self.curvature, self.least, strict=True)
        return tuple(least + k * (A - best) ** 2 for best, k, least in channels)


class Lane(eqx.Module):
    """One table, pooled by direction.

    With h the heights at A = 1, the misfit of channel c at A = exp(a) is

        Q_c(a) = within_c + Σ w (mean - exp(a) h)²

    Args:
        pushes: Distinct directions, padded.
        mean: Weighted mean height of every channel and direction [table unit].
        weight: Sum of 1/sigma² of the heights behind it; 0 for padding.
        within: Weighted sum of squares of the heights about their means.
        n_heights: Number of heights of every channel.
        grasp: Grasp and sensor.
        constant: Log of what multiplies exp(-Q/2) where sigma is known.
        scatter: Log likelihood over ln Q where it is sampled, sigma integrated out.
        prior_A: Density of ln A.
        prior_B: Density of ln B.
        prior_C: Density of ln C_rr.
        channels: Names of the rows of `mean`.
    """

    pushes: Pushes
    mean: Float[Array, "c n"]
    weight: Float[Array, "c n"]
    within: Float[Array, " c"]
    n_heights: Float[Array, " c"]
    grasp: Grasp
    constant: Float[Array, " c"]
    scatter: tuple[Table, ...]
    prior_A: Table
    prior_B: Table
    prior_C: Table
    channels: tuple[str, ...] = eqx.field(static=True)

    def face(self, u: Scalar) -> Face:
        """Forces at A = 1 and C_rr = 1 where tan θ_c = exp(u) [table unit m/N].

        With θ_c held, the tangential force is proportional to C_rr and the normal
        force does not depend on it.
        """
        group = Contact(A=1.0, B=jnp.exp(u), C_rr=1.0)
        channels = forward(group, self.pushes, self.grasp)
        return Face(channels.height_normal, channels.height_tangential)

    def shape(self, face: Face, c: Scalar) -> Float[Array, "c n"]:
        """Heights at A = 1 and C_rr = exp(c) [table unit m/N]."""
        tangential = jnp.exp(c) * face.tangential
        heights = {
            "height": norm2(face.normal, tangential),
            "height_normal": face.normal,
            "height_tangential": tangential,
        }
        return jnp.stack([heights[name] for name in self.channels])

    def parabola(self, shape: Float[Array, "c n"]) -> Parabola:
        """Misfit as a function of A at given heights."""
        curvature = jnp.sum(self.weight * shape**2, axis=1)
        safe = jnp.where(curvature > 0, curvature, 1.0)
        best = jnp.sum(self.weight * shape * self.mean, axis=1) / safe
        # Not as a difference of large sums: small noise leaves no digits to lose.
        misfit = jnp.sum(self.weight * (self.mean - best[:, None] * shape) ** 2, axis=1)
        return Parabola(tuple(best), tuple(curvature), tuple(self.within + misfit))

    def log_likelihood(self, squares: tuple[Scalar, ...]) -> Scalar:
        """Log likelihood of the misfits Q of the channels."""
        total = jnp.zeros(())
        if not self.scatter:
            for constant, square in zip(self.constant, squares, strict=True):
                total = total + constant - square / 2
            return total
        for table, square in zip(self.scatter, squares, strict=True):
            place = jnp.clip(jnp.log(square), table.start, table.end)
            total = total + table.log_prob(place)
        return total

    def rates(self, squares: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        """About -2 d ln L / dQ: 1 where sigma is known, else n / Q."""
        if not self.scatter:
            return tuple(jnp.ones_like(square) for square in squares)
        return tuple(
            n / jnp.maximum(square, 1e-300)
            for n, square in zip(self.n_heights, squares, strict=True)
        )


def why_not_lane(problem: Problem) -> str | None:
    """Why a problem needs the engines for single tables.

    Args:
        problem: Problem.

    Returns:
        The reason in words; None where a lane holds all of it.
    """
    if problem.grasp.mechanics != "linear":
        return f"{problem.grasp.mechanics} mechanics depend on more than A, B and C_rr"
    if "f1" in problem.data_names:
        return "the stiffness ellipse adds two dimensions"
    if "ln_F_0" in problem.data_names:
        return "the estimated preload adds a dimension"
    if not is_linear(problem):
        return "with a preload or an offset heights are not proportional to A"
    if problem.grasp.support_span is not None:
        return "two supports switch over at two angles"
    if problem.likelihood != "normal":
        return "the Student-t likelihood is no parabola in A"
    if set(problem.data_names) != {"ln_A", "ln_B", "ln_C_rr"}:
        return "A, B or C_rr is fixed"
    if any(prior.kind == "uniform" for prior in problem.priors.values()):
        return "a uniform prior has edges"
    if _is_sampled(problem):
        if len(problem.channels) > 1:
            return "channels whose noise is sampled weigh each other"
        if np.any(np.asarray(problem.sd) > 0):
            return "given and sampled noise add up differently in every row"
    return None


def make_lane(problem: Problem, tables: Mapping[str, Table]) -> Lane:
    """The lane of a problem for which `why_not_lane` has no reason.

    Args:
        problem: Problem with its noise weights settled.
        tables: Densities of ln A, ln B and ln C_rr by name of the number.

    Returns:
        Lane, to be stacked.
    """
    mask, observed = np.asarray(problem.mask), np.asarray(problem.observed)
    used = np.any(mask, axis=0)
    theta, alpha = np.asarray(problem.pushes.theta), np.asarray(problem.pushes.alpha)
    nano = np.rint(np.stack([theta, alpha])[:, used] / SAME_DIRECTION)
    directions, group = np.unique(nano, axis=1, return_inverse=True)
    n_directions, size = directions.shape[1], _padded(directions.shape[1])
    is_sampled = _is_sampled(problem)
    # Where sigma is sampled, Q is in units of the heights and rate(Q) weights it.
    sigma = np.asarray(problem.reference_sigma)
    precision = np.where(mask, 1.0 if is_sampled else sigma**-2, 0.0)[:, used]
    observed = np.where(mask, observed, 0.0)[:, used]

    def summed(values: np.ndarray) -> np.ndarray:
        return np.stack([np.bincount(group, row, minlength=size) for row in values])

    weight = summed(precision)
    mean = summed(precision * observed) / np.where(weight > 0, weight, 1.0)
    within = np.sum(precision * (observed - mean[:, group]) ** 2, axis=1)
    first = np.array([np.argmax(group == g) for g in range(n_directions)])

    def padded(angle: np.ndarray, fill: float) -> np.ndarray:
        kept = angle[used][first]
        return np.concatenate([kept, np.full(size - n_directions, fill)])

    constant = np.where(mask, np.log(sigma) + np.log(2 * np.pi) / 2, 0.0)
    n_heights = np.sum(mask, axis=1).astype(float)
    return Lane(
        pushes=Pushes(padded(theta, 0.5), padded(alpha, 0.0)),
        mean=jnp.asarray(mean),
        weight=jnp.asarray(weight),
        within=jnp.asarray(within),
        n_heights=jnp.asarray(n_heights),
        grasp=problem.grasp,
        constant=jnp.asarray(-np.sum(constant, axis=1)),
        scatter=(_scatter(problem, float(within[0])),) if is_sampled else (),
        prior_A=tables["A"],
        prior_B=tables["B"],
        prior_C=tables["C_rr"],
        channels=problem.channels,
    )


def _padded(n: int) -> int:
    """Directions are padded to a multiple of this: few shapes, little waste."""
    return -(-n // PADDING) * PADDING


def _is_sampled(problem: Problem) -> bool:
    return f"sigma_{problem.channels[0]}" in problem.priors


def _scatter(problem: Problem, within: float) -> Table:
    """Log likelihood of the only channel over the log of its sum of squares."""
    ln_sigma = np.asarray(make_noise_grid(problem).ln_sigma)[0]
    heights = np.asarray(problem.observed)[np.asarray(problem.mask)]
    n = heights.size
    prior = problem.priors[f"sigma_{problem.channels[0]}"]
    prior = np.asarray(log_prior_at(prior, jnp.asarray(ln_sigma)))
    step = np.log(ln_sigma[1] - ln_sigma[0])
    constant = prior + step - n * (ln_sigma + np.log(2 * np.pi) / 2)
    low = max(float(within), n * float(np.exp(2 * ln_sigma[0])))
    high = float(np.sum(heights**2)) * SQUARES_MARGIN
    grid = np.linspace(np.log(low), np.log(max(high, 2 * low)), N_SQUARES)
    exponent = constant - np.exp(grid[:, None] - 2 * ln_sigma) / 2
    return Table(
        start=jnp.asarray(grid[0]),
        step=jnp.asarray(grid[1] - grid[0]),
        values=jnp.asarray(logsumexp(exponent, axis=1)),
        mean=jnp.asarray(np.mean(grid)),
        sd=jnp.asarray(np.std(grid)),
    )
