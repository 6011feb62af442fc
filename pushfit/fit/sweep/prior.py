"""What is known of a prior: moments, quantiles and densities of what follows from it.

Priors that differ only by the unit of stiffness and force share everything that takes
time. It is made once for each shape and kept. Excluded: densities, which `Problem` has.
"""

import functools
from collections.abc import Mapping
from dataclasses import dataclass, replace

import jax
import numpy as np
from jaxtyping import Array, Float

from pushfit.fit.problem.encoding import prior_x_samples
from pushfit.fit.problem.priors.conditional_prior import make_conditional_prior
from pushfit.fit.problem.priors.tabulated_density import (
    LogDensity,
    TabulatedDensity,
    tabulate,
)
from pushfit.fit.problem.problem import Problem
from pushfit.fit.problem.repeats.pooling import pool_repeats
from pushfit.fit.programs.compile import compiled
from pushfit.fit.programs.kept import kept
from pushfit.fit.sweep.coordinate_roles import roles_of
from pushfit.fit.sweep.target import QuantileTable, Target, outer_of
from pushfit.model import as_float
from pushfit.parameters import STIFF

# Draws from the prior: moments good to 2 % of a standard deviation.
N_DRAWS = 4000
# Shapes kept at a time, each of a megabyte: tables of one setting share theirs, and a
# batch has few settings.
MAX_SHAPES = 64


@dataclass(frozen=True, slots=True, kw_only=True)
class PriorShape:
    """A prior whose stiffness and preload are in units of their own.

    Args:
        draws: Sampling coordinates but for sampled noise, by name.
        mean: Of the coordinates of the sweep.
        precision: Of the normal distribution with their moments.
        covariance: Of the same.
        shape_sd: Standard deviation of e1 and e2.
        tables: Quantiles of the conditional coordinates by name: first value of the
            number they are given, distance between its values, and entries.
    """

    draws: dict[str, Float[np.ndarray, " n"]]
    mean: Float[np.ndarray, " q"]
    precision: Float[Array, "q q"]
    covariance: Float[Array, "q q"]
    shape_sd: float
    tables: dict[str, tuple[float, float, Float[Array, "r s"]]]


class _Question:
    """A problem that stands for all with the same prior; compares by its prior.

    Stiffness and preload are counted in units of their own priors, so that K_sn and F_0
    are about 1: `ln_stiffness` and `ln_force` are the logs of these units.
    """

    def __init__(self, problem: Problem, reference_alpha: float) -> None:
        self.problem, self.reference_alpha = problem, reference_alpha
        known = {n: p for n, p in problem.priors.items() if not n.startswith("sigma_")}
        scaled = {n: float(p.first) for n, p in known.items() if p.kind == "lognormal"}
        is_scaled = scaled.keys() >= set(STIFF)
        self.ln_stiffness = float(np.log(scaled["K_sn"])) if is_scaled else 0.0
        self.ln_force = float(np.log(scaled.get("F_0", 1.0)))
        units = dict.fromkeys(STIFF, self.ln_stiffness) | {"F_0": self.ln_force}
        self.firsts = {
            name: float(p.first) / np.exp(units.get(name, 0.0))
            for name, p in known.items()
        }
        priors = (
            (name, p.kind, _rounded(self.firsts[name]), _rounded(p.second))
            for name, p in known.items()
        )
        fixed = ((name, _rounded(value)) for name, value in problem.fixed.items())
        grasp = problem.grasp
        self.key = (
            tuple(sorted(priors)),
            tuple(sorted(fixed)),
            (grasp.mechanics, grasp.support_span is None),
            _rounded(reference_alpha),
        )

    @property
    def shifts(self) -> dict[str, float]:
        """What the log of a coordinate differs by in the units of the problem."""
        scale = self.ln_stiffness
        return {"ln_A": scale, "ln_B": scale, "ln_F_0": self.ln_force}

    def in_own_units(self) -> Problem:
        """The problem by priors in these units, without any of sampled noise."""
        priors = {
            name: replace(self.problem.priors[name], first=first)
            for name, first in self.firsts.items()
        }
        names = tuple(n for n in self.problem.names if not n.startswith("ln_sigma_"))
        return replace(self.problem, priors=priors, names=names)

    def __hash__(self) -> int:
        return hash(self.key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Question) and self.key == other.key


def make_target(problem: Problem, reference_alpha: float) -> Target:
    """A problem made ready for the sweep."""
    roles = roles_of(problem)
    question = _Question(problem, reference_alpha)
    shape = _shape(question)
    coordinates = ("outer", roles.inner, *roles.others)
    shift = np.array([question.shifts.get(str(name), 0.0) for name in coordinates])
    tables = {
        name: QuantileTable(
            # All of them are given a stiffness.
            as_float(start + question.ln_stiffness),
            as_float(step),
            values,
        )
        for name, (start, step, values) in shape.tables.items()
    }
    return Target(
        pooled=pool_repeats(problem),
        mean=as_float(shape.mean + shift),
        precision=shape.precision,
        covariance=shape.covariance,
        shape_sd=as_float(shape.shape_sd),
        tables=tables,
        reference_alpha=as_float(reference_alpha),
        roles=roles,
    )


def prior_points(
    problem: Problem, reference_alpha: float, rng: np.random.Generator
) -> Float[np.ndarray, "n p"]:
    """Draws from the prior, in sampling coordinates."""
    question = _Question(problem, reference_alpha)
    shifts, draws = question.shifts, _shape(question).draws
    draws = {name: values + shifts.get(name, 0.0) for name, values in draws.items()}
    for name, prior in problem.priors.items():
        if name.startswith("sigma_"):
            draws[f"ln_{name}"] = prior.sample(rng, N_DRAWS)
    return np.stack([draws[name] for name in problem.names], axis=1)


def marginal_priors(problem: Problem) -> dict[str, TabulatedDensity]:
    """Densities of ln A, ln B and ln C_rr by name of the number, if it is free."""
    question = _Question(problem, 0.0)
    by = dict.fromkeys(("A", "B"), question.ln_stiffness) | {"C_rr": 0.0}
    return {name: t.shifted(by[name]) for name, t in _marginals(question).items()}


def _rounded(value: float | Float[Array, ""]) -> float:
    """Nine digits, so that rounding cannot make two shapes of one."""
    return float(f"{float(value):.9g}")


@functools.lru_cache(maxsize=MAX_SHAPES)
def _shape(question: _Question) -> PriorShape:
    """Draws, moments and tables of a prior."""
    return kept(f"prior {question.key}", lambda: _made(question))


@functools.lru_cache(maxsize=MAX_SHAPES)
def _marginals(question: _Question) -> Mapping[str, TabulatedDensity]:
    problem = question.in_own_units()
    given = make_conditional_prior(problem.priors, problem.fixed)
    densities = {
        "A": given.normal.density(),
        "B": given.tangential.density(),
        "C_rr": given.C_rr,
    }
    return {n: tabulate(d) for n, d in densities.items() if isinstance(d, LogDensity)}


def _made(question: _Question) -> PriorShape:
    problem = question.in_own_units()
    roles, names, rng = roles_of(problem), problem.names, np.random.default_rng(0)
    x = prior_x_samples(problem, rng, N_DRAWS)
    draws = {name: x[:, i] for i, name in enumerate(names)}
    columns = [rng.standard_normal(N_DRAWS), rng.standard_normal(N_DRAWS)]
    if roles.pivot is not None:
        means, alpha = pool_repeats(problem).problem, question.reference_alpha
        columns[0] = np.asarray(_outer(means, as_float(x), as_float(alpha)))
    if roles.inner is not None:
        columns[1] = draws[roles.inner]
    y = np.stack([*columns, *(draws[name] for name in roles.others)], axis=1)
    given = make_conditional_prior(problem.priors, problem.fixed)
    pairs = {"ln_r": given.normal, "ln_s": given.tangential, "ln_L": given.rotation}
    tables = {}
    for name in roles.conditional:
        rows, values = pairs[name].quantiles
        tables[name] = (float(rows[0]), float(rows[1] - rows[0]), as_float(values))
    e1 = problem.priors.get("e1")
    shape_sd = 1.0 if e1 is None else float(np.std(e1.sample(rng, N_DRAWS)))
    mean, precision = _moments(y, roles.names, shape_sd, has_s=roles.has_s)
    for i, name in enumerate((roles.pivot, roles.inner)):
        if name is None:
            mean[i] = 0.0
            precision[i], precision[:, i], precision[i, i] = 0.0, 0.0, 1.0
    return PriorShape(
        draws=draws,
        mean=mean,
        precision=as_float(precision),
        covariance=as_float(np.linalg.inv(precision)),
        shape_sd=shape_sd,
        tables=tables,
    )


def _moments(
    y: Float[np.ndarray, "n q"], names: tuple[str, ...], shape_sd: float, *, has_s: bool
) -> tuple[Float[np.ndarray, " q"], Float[np.ndarray, "q q"]]:
    """Mean and precision of the coordinates; an ellipse hangs on ln s alone."""
    mean, q = np.mean(y, axis=0), len(names)
    apart = [i for i, n in enumerate(names) if has_s and n in ("ln_s", "f1", "f2")]
    joint = [i for i in range(q) if i not in apart]
    precision = np.zeros((q, q))
    covariance = np.cov(y[:, joint].T).reshape(len(joint), len(joint))
    precision[np.ix_(joint, joint)] = np.linalg.inv(covariance)
    for i in apart:
        if names[i] == "ln_s":
            mean[i], precision[i, i] = np.median(y[:, i]), 1.0
        else:
            mean[i] = 0.0
            precision[i, i] = ((1 + np.exp(mean[names.index("ln_s")])) / shape_sd) ** 2
    return mean, precision


@compiled
def _outer(
    problem: Problem, x: Float[Array, "n p"], reference_alpha: Float[Array, ""]
) -> Float[Array, " n"]:
    """Outer coordinate u of each draw, as `outer_of` defines it."""

    def one(row: Float[Array, " p"]) -> Float[Array, ""]:
        z = dict(zip(problem.names, row, strict=True))
        return outer_of(problem, z, reference_alpha)

    return jax.vmap(one)(x)
