"""The oracle by quadrature: against closed forms, brute force, and its own bound.

Slow as are the tests that ask it.
"""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from pushfit.fit.problem.derived import samples_mapping
from pushfit.fit.problem.encoding import prior_x_samples
from pushfit.fit.profiles.least_squares import fit_least_squares
from tests.fit.tables import case_table, setup_of
from tests.oracle.cells import Cells, cell_nodes
from tests.oracle.exact import exact_grid, exact_posterior
from tests.problems import CASES, PUSH

pytestmark = pytest.mark.slow

REACH = (0.0, np.pi)
ALPHA = np.pi / 2
WORDS = {"n_draws": 4000, "reference_alpha": ALPHA, "reach": REACH}
# A false alarm once in 1000 per comparison.
KS_LEVEL = 1e-3
# The brute-force sums below have steps of a tenth of a standard deviation; kinks at
# pushed elevations leave them this wrong.
BRUTE_FORCE = 2e-3
# Without data the bound may be smaller than what sums over all cells round off; those
# of one cell, of probabilities below 1, round off by less.
NO_DATA, SUMS = 1e-7, 1e-14
COARSE, FINE = 1e-3, 1e-10  # relative errors that are asked for
# Elevations of one small table: every test of this file shares one compiled program.
FIVE = np.array([10.0, 30.0, 45.0, 60.0, 80.0])


def small_setup(name="firm", *, noise, seed=0, text=""):
    table = case_table(CASES[name], noise=noise, seed=seed, theta_deg=FIVE)
    return setup_of(table, text)


def without_data(setup):
    """The same problem with every entry masked out."""
    masked = eqx.tree_at(
        lambda p: p.mask, setup.problem, jnp.zeros_like(setup.problem.mask)
    )
    return dataclasses.replace(setup, problem=masked)


def log_series_density(values, first, second):
    """Density of the log of two lognormal springs in series, by a plain sum."""
    t = np.linspace(-25, 25, 4001)
    first_log = values[:, None] + np.logaddexp(0, t)
    second_log = values[:, None] + np.logaddexp(0, -t)
    density = stats.norm.pdf(first_log, *first) * stats.norm.pdf(second_log, *second)
    return np.log(np.trapezoid(density, t, axis=1))


def on_grid(axes, pushes, *, preload=0.0, bounded=np.minimum):
    """Log of likelihood times prior over a grid of ln A, ln B and ln C_rr, in NumPy.

    The default priors are lognormal, so C_d / L² is lognormal too; that of one value of
    C_rr is left out.

    Args:
        pushes: θ [rad], height and its standard deviation of each.
        bounded: The tangential force from that of the springs and its limit.
    """
    ln_A, ln_B, ln_C = axes
    rotation = (np.log(0.5 / 0.04**2), np.hypot(0.8, 2 * 0.3))
    log_f = (
        log_series_density(ln_A, (np.log(800), 0.8), (np.log(2000), 0.8))[:, None, None]
        + log_series_density(ln_B, (np.log(400), 0.8), rotation)[:, None]
        + (stats.norm.logpdf(ln_C, np.log(0.3), 0.8) if ln_C.size > 1 else 0.0)
    )
    A, B, C = np.exp(np.stack(np.meshgrid(*axes, indexing="ij")))
    for theta, height, sd in pushes:
        normal = preload + A * PUSH * np.sin(theta)
        tangential = bounded(B * PUSH * np.cos(theta), C * normal)
        found = np.hypot(normal, tangential) - preload
        log_f += stats.norm.logpdf(height, found, sd)
    return log_f


def brute_force(setup, samples):
    """Log evidence and posterior means of ln B and ln C_rr from a dense grid."""
    axes = []
    for name in ("A", "B", "C_rr"):
        logs = np.log(samples[name])
        margin = 0.35 * np.ptp(logs)
        axes.append(np.linspace(logs.min() - margin, logs.max() + margin, 150))
    problem = setup.problem
    columns = (problem.pushes.theta, problem.observed[0], problem.reference_sigma[0])
    pushes = np.stack(columns, axis=1)[np.asarray(problem.mask)[0]]
    log_f = on_grid(axes, pushes, preload=float(problem.grasp.preload))
    top = log_f.max()
    f = np.exp(log_f - top)
    step = np.prod([axis[1] - axis[0] for axis in axes])
    _, B, C = np.meshgrid(*axes, indexing="ij")
    means = [np.sum(f * logs) / f.sum() for logs in (B, C)]
    return np.log(f.sum() * step) + top, means


@pytest.mark.parametrize(
    ("name", "noise"), [("firm", 0.05), ("firm", 0.15), ("blind_magnitude", 0.05)]
)
def test_evidence_and_means_are_those_of_a_dense_grid(name, noise):
    setup = small_setup(name, noise=noise)
    fit = fit_least_squares(setup, reference_alpha=ALPHA)
    result = exact_posterior(setup, fit, seed=1, **WORDS)
    log_evidence, means = brute_force(setup, result.samples)
    assert abs(result.log_evidence - log_evidence) < BRUTE_FORCE
    for quantity, mean in zip(("B", "C_rr"), means, strict=True):
        logs = np.log(result.samples[quantity])
        assert abs(np.mean(logs) - mean) < 4 * np.std(logs) / np.sqrt(logs.size)


def test_without_data_the_evidence_is_one():
    setup = small_setup(noise=0.05)
    fit = fit_least_squares(setup, reference_alpha=ALPHA)
    grid = exact_grid(without_data(setup), fit)
    assert abs(grid.log_evidence) < max(grid.log_evidence_error, NO_DATA)


def test_without_data_draws_follow_the_prior():
    setup = small_setup(noise=0.05)
    fit = fit_least_squares(setup, reference_alpha=ALPHA)
    result = exact_posterior(without_data(setup), fit, seed=3, **WORDS)
    x = prior_x_samples(setup.problem, np.random.default_rng(4), 4000)
    prior = samples_mapping(setup.problem, x, ALPHA, reach=REACH)
    for name in ("K_sn", "K_dn", "K_st", "C_rr", "C_d", "L", "theta_c"):
        pair = result.samples[name], prior[name]
        assert stats.ks_2samp(*pair).pvalue > KS_LEVEL, name
    logs = np.log(result.samples["K_sn"])
    assert stats.kstest(logs, stats.norm(np.log(800), 0.8).cdf).pvalue > KS_LEVEL


@pytest.mark.parametrize("width", [1.0, 0.3, 0.1, 0.03])
@pytest.mark.parametrize("centre", [0.0, 0.37])
def test_error_of_cells_covers_their_error(width, centre):
    """A bell against the normal distribution function, over two cells.

    One that falls between two nodes is seen by no rule: hence cells around modes.
    """
    edges = np.array([-1.0, 0.2, 1.0])
    nodes = cell_nodes(edges[:-1], edges[1:])
    cells = Cells(
        lower=edges[:-1],
        upper=edges[1:],
        log_values=stats.norm.logpdf(nodes, centre, width),
        inner_error=np.zeros_like(nodes),
    )
    truth = np.diff(stats.norm.cdf(edges, centre, width)) * np.exp(-cells.scale)
    assert np.all(np.abs(cells.integrals - truth) <= cells.errors + SUMS)


HARD = {
    "razor_sharp": ("firm", 1e-6),
    "informative": ("firm", 0.02),
    "several_modes": ("blind_magnitude", 0.06),
    "prior_wide": ("blind_magnitude", 2.0),
    "above_every_push": ("one_sided", 0.02),
}


@pytest.mark.parametrize("name", HARD)
def test_the_error_bound_covers_the_error(name):
    case, noise = HARD[name]
    setup = small_setup(case, noise=noise)
    fit = fit_least_squares(setup, reference_alpha=ALPHA)
    coarse, fine = (exact_grid(setup, fit, rtol=rtol) for rtol in (COARSE, FINE))
    difference = abs(coarse.log_evidence - fine.log_evidence)
    assert difference <= coarse.log_evidence_error + fine.log_evidence_error
    assert fine.log_evidence_error < COARSE
