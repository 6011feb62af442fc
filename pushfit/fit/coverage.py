"""How often the intervals that a user sees hold the truth, for the user's own pushes.

Truths are drawn from the priors and pushed in the user's directions, with the user's
repeats, channels and noise; each simulated table then goes through the whole
identification. What is counted is therefore what would be printed, verdicts included.
Excluded: text for readers (`pushfit.report.text.coverage`).
"""

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy import stats

from pushfit.config import GraspConfig
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import DataError, FitError, check_seed
from pushfit.fit.identify.fit_table import fit_table
from pushfit.fit.identify.fitted import Fitted, reach_of
from pushfit.fit.identify.identify_table import identify_table
from pushfit.fit.problem.derived import (
    equal_tailed_interval,
    samples_mapping,
)
from pushfit.fit.problem.encoding import prior_x_samples
from pushfit.fit.problem.predictions import predict_draws
from pushfit.fit.results import FitStatus, Identification, Piece, Verdict
from pushfit.parameters import ANGLES, HALF_TURN

# The usual probabilities, that of intervals by default among them.
PROBS = (0.5, 0.9, 0.95)
QUANTITIES = (*ANGLES, "A", "B", "C_rr")
# Probability of the binomial limits.
LIMITS_PROB = 0.95


@dataclass(frozen=True, slots=True, kw_only=True)
class Coverage:
    """How often one kind of interval held the truth.

    Args:
        name: Quantity, as in `summary.json`.
        kind: "interval" (equal-tailed) or "set" (as quoted, pieces and open ends).
        prob: Probability that it claims.
        n_held: Tables in which it held the truth.
        n_tables: Tables in which there was one, and a truth to hold.
    """

    name: str
    kind: str
    prob: float
    n_held: int
    n_tables: int

    @property
    def share(self) -> float:
        """Measured coverage; NaN without tables."""
        return self.n_held / self.n_tables if self.n_tables else float("nan")

    @property
    def limits(self) -> tuple[float, float]:
        """Coverages that this count is compatible with (Clopper and Pearson, 95 %)."""
        if not self.n_tables:
            return 0.0, 1.0
        test = stats.binomtest(self.n_held, self.n_tables)
        low, high = test.proportion_ci(LIMITS_PROB, method="exact")
        return float(low), float(high)

    @property
    def is_compatible(self) -> bool:
        """Whether the claimed probability lies inside the limits."""
        low, high = self.limits
        return low <= self.prob <= high


@dataclass(frozen=True, slots=True, kw_only=True)
class CoverageStudy:
    """Measured coverage for one design.

    Args:
        coverages: Counts by quantity, kind and probability.
        verdicts: How many tables gave each verdict, by angle.
        n_tables: Tables simulated.
        n_failed: Tables without a result, or whose status is not OK; no coverage counts
            them.
        n_pushes: Pushes in each table.
        engine: Engines behind the results, joined by " and ".
        seed: Seed of all randomness.
    """

    coverages: tuple[Coverage, ...]
    verdicts: Mapping[str, Mapping[Verdict, int]]
    n_tables: int
    n_failed: int
    n_pushes: int
    engine: str
    seed: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Simulation:
    """Tables with known truth.

    Args:
        tables: Heights of the same pushes, one table per truth.
        truths: True values by quantity, one per table, as in `samples_mapping`.
    """

    tables: tuple[PeakTable, ...]
    truths: Mapping[str, Float[np.ndarray, " n"]]


def coverage_study(
    table: PeakTable,
    config: GraspConfig,
    *,
    n_tables: int,
    seed: int = 0,
    progress: Callable[[str, float], None] | None = None,
) -> CoverageStudy:
    """Measure the coverage of intervals and sets for the pushes of a table.

    Args:
        table: Peak heights whose directions, repeats, channels and noise are taken.
        config: Configuration in force; truths are drawn from its priors.
        progress: Called with a stage and the share of it that is done.

    Raises:
        ConfigError: If nothing is left to infer, or the seed is below 0.
        DataError: If no usable push is left.
        FitError: If no start gives finite residuals, or the solver stopped at its step
            limit.
    """
    check_seed(seed)
    fitted = fit_table(table, config)
    simulation = simulate_tables(fitted, n_tables, np.random.default_rng(seed))
    trusted = []
    for index, simulated in enumerate(simulation.tables):
        if progress is not None:
            progress(f"table {index + 1} of {n_tables}", index / n_tables)
        try:
            result = identify_table(simulated, config, seed=seed + index)
        except (DataError, FitError):
            continue
        if result.status is FitStatus.OK:
            trusted.append((index, result))
    asked = [name for name in QUANTITIES if name in simulation.truths]
    asked = [name for name in asked if np.ptp(simulation.truths[name]) > 0]
    coverages = []
    for name in asked:
        truths = simulation.truths[name]
        pairs = [(result, float(truths[index])) for index, result in trusted]
        pairs = [(result, truth) for result, truth in pairs if np.isfinite(truth)]
        coverages += _coverages(name, pairs, prob=config.report.prob)
    return CoverageStudy(
        coverages=tuple(coverages),
        verdicts={
            name: Counter(getattr(result, name).verdict for _, result in trusted)
            for name in ANGLES
            if name in asked
        },
        n_tables=n_tables,
        n_failed=n_tables - len(trusted),
        n_pushes=len(fitted.setup.rows),
        engine=" and ".join(sorted({r.posterior.engine for _, r in trusted})),
        seed=seed,
    )


def simulate_tables(fitted: Fitted, n: int, rng: np.random.Generator) -> Simulation:
    """Tables of the same pushes from truths drawn from the priors.

    Returns:
        Tables, each with the unit, channels and stated standard deviations of the
        original; pushes that lift the finger off are flagged `lost_contact`.
    """
    table, setup = fitted.table, fitted.setup
    problem, rows = setup.problem, np.array(setup.rows)
    x = prior_x_samples(problem, rng, n)
    truths = samples_mapping(
        problem, x, fitted.reference_alpha, reach=reach_of(fitted.config)
    )
    angles = np.stack([table.theta, table.alpha])[:, rows]
    found = predict_draws(problem, truths, angles)
    clean = found.heights
    sigma = np.asarray(problem.reference_sigma)[:, : rows.size]
    heights = clean + sigma * rng.standard_normal(clean.shape)
    if problem.shared is not None:
        shared = np.asarray(problem.shared)[:, :, : rows.size]
        effects = rng.standard_normal((n, *shared.shape[:2]))
        heights += np.einsum("cgn,kcg->kcn", shared, effects)
    sds = {c: sd[rows] for c in table.channels if (sd := table.sd(c)) is not None}
    tables = [
        PeakTable.from_arrays(
            theta=table.theta[rows],
            alpha=table.alpha[rows],
            heights=dict(zip(table.channels, values, strict=True)),
            unit=table.unit,
            sd=sds,
            repeat=table.frame["repeat"].to_numpy()[rows],
            flags=tuple("" if c else "lost_contact" for c in contact),
        )
        for values, contact in zip(heights, found.in_contact, strict=True)
    ]
    return Simulation(tables=tuple(tables), truths=truths)


def _coverages(
    name: str, pairs: list[tuple[Identification, float]], *, prob: float
) -> list[Coverage]:
    """Coverage of a quantity's intervals, and of its sets as quoted if an angle."""
    held = {}
    for usual in PROBS:
        held["interval", usual] = [
            holds((equal_tailed_interval(draws, usual, is_axis=is_axis),), truth)
            for result, truth in pairs
            for draws in [result.posterior.samples[name]]
            for is_axis in [name == "alpha_star" and result.config.reach.is_whole]
        ]
    if name in ANGLES:
        held["set", prob] = [
            holds(pieces, truth)
            for result, truth in pairs
            if (pieces := getattr(result, name).sets)
        ]
    return [
        Coverage(
            name=name, kind=kind, prob=stated, n_held=sum(hits), n_tables=len(hits)
        )
        for (kind, stated), hits in held.items()
    ]


def holds(pieces: tuple[Piece, ...], truth: float) -> bool:
    """Whether a set holds a value; an open end holds everything beyond.

    That of an axis may go on beyond 180°, where it starts again.
    """
    for low, high in pieces:
        start = -np.inf if low is None else low
        end = np.inf if high is None else high
        if start <= truth <= end or start <= truth + HALF_TURN <= end < np.inf:
            return True
    return False
