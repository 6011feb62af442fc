"""The peers in the benchmarks solve the problem that pushfit solves."""

import importlib
import os
import subprocess
import sys
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from pushfit.fit.problem.encoding import encode
from pushfit.fit.problem.setup import build_problem

pytest.importorskip("lmfit", reason="the peers of the extra bench")
pytest.importorskip("numpyro", reason="the peers of the extra bench")

from benchmarks import tables
from benchmarks.speed import peers

FOLDER = Path(__file__).parents[2] / "benchmarks"
PATHS = [p.relative_to(FOLDER.parent) for p in sorted(FOLDER.rglob("*.py"))]
MODULES = [".".join(p.with_suffix("").parts) for p in PATHS if p.stem != "conftest"]
# Two implementations; a log density near -1000 keeps twelve digits.
RTOL = 1e-10


@pytest.fixture(scope="module")
def table():
    (one,) = tables.prior_tables(1, n_angles=9)
    return one


@pytest.fixture(scope="module")
def problem(table):
    return build_problem(table, tables.CONFIG).problem


@pytest.fixture(scope="module")
def logs():
    """Two points drawn from the priors."""
    rng = np.random.default_rng(1)
    return peers.MEDIANS + peers.SPREADS * rng.standard_normal((2, peers.MEDIANS.size))


@pytest.mark.parametrize("name", MODULES)
def test_a_benchmark_can_be_imported(name):
    assert importlib.import_module(name).__doc__


def test_every_row_of_the_table_of_speed_finds_what_it_asks_for():
    """Three of them ended before they began, by a fixture of too narrow a scope."""
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:xdist", "--setup-plan"]
    options = ["-o", "addopts=--import-mode=importlib", "benchmarks"]
    # A worker of pytest-xdist hands on that it is one: pytest-benchmark stays off then.
    own = {k: v for k, v in os.environ.items() if not k.startswith("PYTEST_")}
    done = subprocess.run(
        [*command, *options],
        cwd=FOLDER.parent,
        env=own,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stdout


@pytest.mark.slow
def test_peers_fit_the_same_residuals(table, problem, logs):
    point = dict(zip(("ln_A", "ln_B", "ln_C_rr"), peers.combined(logs[0]), strict=True))
    y = jnp.asarray([point[name] for name in problem.data_names])
    theirs = peers.residuals(peers.combined(logs[0]), peers.arrays(table))
    ours = np.asarray(problem.data_residuals(y))[: theirs.size]
    np.testing.assert_allclose(theirs, ours, rtol=RTOL)


@pytest.mark.slow
def test_the_sampler_of_lmfit_has_the_same_posterior(table, problem, logs):
    """Log densities may differ by a constant."""
    columns = zip(tables.NAMES, np.exp(logs).T, strict=True)
    x = encode(problem, dict(columns))
    ours = [float(problem.log_prob(jnp.asarray(point))) for point in x]
    pair = peers.arrays(table)
    squares = [np.sum(peers.posterior_residuals(row, pair) ** 2) for row in logs]
    np.testing.assert_allclose(np.diff(squares) / -2, np.diff(ours), rtol=RTOL)
