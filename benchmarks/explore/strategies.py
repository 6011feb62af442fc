"""Ways to choose the next push, and likelihood sets: strategies to be compared."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import jax
import jax.numpy as jnp
import numpy as np

from pushfit.explore.belief.belief import Question
from pushfit.explore.belief.predict import predict
from pushfit.explore.limits import Limits
from pushfit.model import Grasp, Parameters, Pushes, forward
from pushfit.parameters import TINY

if TYPE_CHECKING:
    from benchmarks.explore.by_engine import Course

# Without reference pushes, which say nothing of the angles.
LIMITS = Limits(reference_every=0)
# The paper's push length [m].
GRASP = Grasp(push_length=5e-3)
# Elevations that may be pushed at [rad].
THETA = np.radians(np.arange(5.0, 90.0, 5.0))
# Azimuth across the supports, where θ_c is asked for [rad].
ACROSS = np.pi / 2
# Azimuths that may be pushed along [rad].
ALPHA = np.radians(np.arange(0.0, 180.0, 15.0))
# The paper's grids: elevations across the supports, azimuths at 15°, thrice each.
PAPER_THETA = np.radians(np.repeat(np.abs(np.arange(-60.0, 61.0, 15.0)), 3))
PAPER_ALPHA = np.repeat(ALPHA, 3)
# Elevation of the paper's sweep of azimuths [rad].
AT = np.radians(15.0)
Direction = tuple[float, float]
Choice = Callable[["Course", tuple[str, ...], np.random.Generator], Direction]
# Likelihood sets of 90 %: half a chi-square of one degree of freedom.
DROP = 2.706


def by_gain(question: Question) -> Choice:
    """Expected information gain about the angles that are undecided."""

    def choose(course, undecided, rng):
        survey = course.world.surveyor.survey(course.belief, undecided=undecided)
        best = survey.ranks[0]
        return float(survey.theta[best]), float(survey.alpha[best])

    return choose


def _in_turn(elevations: np.ndarray, azimuths: np.ndarray) -> Callable:
    """Elevations across the supports, azimuths at 15°, or one after the other."""

    def strategy(question: Question) -> Choice:
        def choose(course, undecided, rng):
            n, asks = len(course.told), question.ask
            k, angle = n // len(asks), asks[n % len(asks)]
            if angle == "theta_c":
                return float(elevations[k % elevations.size]), ACROSS
            return AT, float(azimuths[k % azimuths.size])

        return choose

    return strategy


def at_random(question: Question) -> Choice:
    """Any candidate."""

    def choose(course, undecided, rng):
        alpha = rng.choice(ALPHA) if "alpha_star" in question.ask else ACROSS
        return float(rng.choice(THETA)), float(alpha)

    return choose


def by_d_optimality(question: Question) -> Choice:
    """Largest determinant of the information at the best fit among the draws."""
    is_open = "alpha_star" in question.ask
    rows = np.stack(np.meshgrid(THETA, ALPHA if is_open else [ACROSS]), -1)
    rows = rows.reshape(-1, 2)
    n_free = 5 if is_open else 3
    # Before as many pushes as numbers are free there is no best fit.
    first = [(THETA[i], a) for i, a in zip((2, 8, 14, 5, 11), ALPHA[::2], strict=False)]
    if not is_open:
        first = [(THETA[i], ACROSS) for i in (2, 8, 14)]

    def choose(course, undecided, rng):
        told = course.told
        if len(told) < n_free:
            theta, alpha = first[len(told)]
            return float(theta), float(alpha)
        x = _best_fit(course)[:n_free]
        candidate = _jacobian(x, rows, question.channels) / course.sigma
        made = np.array([(row.theta, row.alpha) for row in told])
        size = -(-len(made) // 8) * 8
        padded = np.resize(made, (size, 2))
        own = _jacobian(x, padded, question.channels)[: len(made)] / course.sigma
        information = np.einsum("kcp,kcq->pq", own, own) + 1e-9 * np.eye(n_free)
        after = information + np.einsum("kcp,kcq->kpq", candidate, candidate)
        best = int(np.argmax(np.linalg.slogdet(after)[1]))
        return float(rows[best, 0]), float(rows[best, 1])

    return choose


def _best_fit(course: "Course") -> np.ndarray:
    """The draw that fits best: ln A, ln B, ln C_rr, e1 and e2."""
    told, s = course.told, course.belief.samples
    theta, alpha = (np.array([getattr(r, n) for r in told]) for n in ("theta", "alpha"))
    predicted = predict(course.belief, theta, alpha).heights
    seen = np.array([list(row.heights.values()) for row in told])
    best = int(np.argmin(np.sum((predicted - seen[..., None]) ** 2, axis=(0, 1))))
    A = s["K_sn"] * s["K_dn"] / (s["K_sn"] + s["K_dn"])
    B = 1 / (1 / s["K_st"] + s["L"] ** 2 / s["C_d"])
    logs = [float(np.log(v[best])) for v in (A, B, s["C_rr"])]
    return np.array([*logs, s["e1"][best], s["e2"][best]])


def _jacobian(x: np.ndarray, rows: np.ndarray, channels: tuple[str, ...]) -> np.ndarray:
    """Derivatives of the heights, by push, channel and coordinate."""
    return np.asarray(_PROGRAMS[channels](jnp.asarray(x), jnp.asarray(rows)))


def _program(channels: tuple[str, ...]) -> Callable:
    def heights(x, rows):
        A, B, C_rr = jnp.exp(x[0]), jnp.exp(x[1]), jnp.exp(x[2])
        L, e = 0.04, (x[3], x[4]) if x.size > 3 else (0.0, 0.0)
        springs = {"K_sn": 2 * A, "K_dn": 2 * A, "K_st": 2 * B, "C_d": 2 * B * L**2}
        params = Parameters(**springs, C_rr=C_rr, L=L, e1=e[0], e2=e[1])
        found = forward(params, Pushes(rows[:, 0], rows[:, 1]), GRASP)
        return jnp.stack([getattr(found, name) for name in channels], axis=1)

    return jax.jit(jax.jacfwd(heights))


_PROGRAMS: dict[tuple[str, ...], Callable] = {
    channels: _program(channels)
    for channels in (("height",), ("height_normal", "height_tangential"))
}
STRATEGIES: dict[str, Callable[[Question], Choice]] = {
    "gain": by_gain,
    "D-optimal": by_d_optimality,
    "passes": _in_turn(THETA, ALPHA),
    "paper's grid": _in_turn(PAPER_THETA, PAPER_ALPHA),
    "random": at_random,
}


class LikelihoodSets:
    """Likelihood set of θ_c by a grid of θ_c and ln C_rr, A in closed form.

    Args:
        sigma: Noise of a height.
        channels: Heights of a push.
    """

    def __init__(self, sigma: float, channels: tuple[str, ...]) -> None:
        """Lay the grid over all that default priors hold possible."""
        self.sigma, self.channels = sigma, channels
        self.theta_c = np.radians(np.arange(0.125, 90.0, 0.25))
        self.C_rr = 0.3 * np.exp(np.linspace(-3.2, 3.2, 361))
        self.gg, self.gh, self.hh = 0.0, 0.0, 0.0

    def add(self, theta: float, heights: list[float]) -> None:
        """Take in one push."""
        normal = 5e-3 * np.sin(theta)
        held = self.C_rr * np.tan(self.theta_c)[:, None] * 5e-3 * np.cos(theta)
        tangential = np.minimum(self.C_rr * normal, held)
        shapes = [normal, tangential]
        if self.channels == ("height",):
            shapes = [np.hypot(normal, tangential)]
        for shape, height in zip(shapes, heights, strict=True):
            self.gg = self.gg + (shape / self.sigma) ** 2
            self.gh = self.gh + shape * height / self.sigma**2
            self.hh = self.hh + (height / self.sigma) ** 2

    def hull(self) -> tuple[float, float]:
        """Ends of the set of 90 % [deg]."""
        least = self.hh - np.maximum(self.gh, 0.0) ** 2 / np.maximum(self.gg, TINY)
        profile = least.min(axis=1)
        inside = np.degrees(self.theta_c[profile <= profile.min() + DROP])
        return float(inside[0]) - 0.125, float(inside[-1]) + 0.125
