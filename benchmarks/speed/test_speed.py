"""Speed of pushfit beside its peers; `make bench` prints the table.

Everything is warm: compiled and loaded before the first round. Tables have 51 rows.
"""

import itertools
import tempfile
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.experimental.compilation_cache import compilation_cache

from benchmarks import tables
from benchmarks.speed import peers, recording_scale, tilting_cost
from pushfit.fit.identify.fit_table import fit_table
from pushfit.fit.identify.fitted import reach_of
from pushfit.fit.identify.identify_many import identify_many
from pushfit.fit.problem.encoding import prior_x_samples
from pushfit.fit.profiles.least_squares import fit_least_squares
from pushfit.fit.programs.folder import PROGRAMS
from pushfit.fit.sampler.emcee_posterior import sample_posterior
from pushfit.fit.sweep.posterior import N_RETURNED, sweep_posterior
from tests.fit.kinds import KINDS
from tests.fit.tables import config
from tests.oracle.exact import exact_posterior

pytestmark = pytest.mark.benchmark(timer=time.process_time, disable_gc=True)

# Tables of a batch, and those that peers fit.
N_TABLES, N_PEER = 32, 8
# Tables of the paper's protocol in a batch.
N_PROTOCOL = 16
# Tables that emcee samples, and steps of lmfit's.
N_SAMPLED, N_STEPS = 3, 1500
N_RECORDED = recording_scale.HOUR
# Tables fitted by tilting mechanics, a second each.
N_TILTED = 3
# Effective draws that a posterior of lmfit's is counted in.
N_EFFECTIVE = 1000
# Rounds with lmfit's emcee, ten seconds each.
N_LONG = 2


@pytest.fixture(scope="module")
def swept() -> list:
    """Tables of one sweep of elevations."""
    return tables.prior_tables(N_TABLES)


@pytest.fixture(scope="module")
def fitted(swept) -> list:
    return [fit_table(table, tables.CONFIG) for table in swept[:N_SAMPLED]]


@pytest.fixture(scope="module")
def questions(fitted) -> dict:
    """What the engines for single tables are asked, besides the table."""
    return {"reference_alpha": 0.0, "reach": reach_of(tables.CONFIG), "seed": 0}


@pytest.fixture(scope="module")
def local_fits(swept) -> dict:
    """Local fits of a few tables by the peers."""
    pairs = [peers.arrays(table) for table in swept[:N_PEER]]

    def all_by(fit) -> float:
        for pair in pairs:
            fit(pair)
        return N_PEER

    return {
        "lmfit `minimize`, one start": lambda: all_by(peers.fit_by_lmfit),
        "SciPy `least_squares`, one start": lambda: all_by(peers.fit_by_scipy),
    }


def in_turn(function, items):
    """A call of the function with the next item, endlessly."""
    endless = itertools.cycle(items)
    return lambda: function(next(endless))


@pytest.mark.parametrize(
    ("peer", "target"),
    [("lmfit `minimize`, one start", 150), ("SciPy `least_squares`, one start", 60)],
)
def test_least_squares(compare, swept, local_fits, peer, target):
    def one(setup) -> float:
        fit_least_squares(setup, reference_alpha=0.0)
        return 1.0

    ours = ("least squares, global, per table", in_turn(one, tables.setups(swept)))
    compare(ours, (peer, local_fits[peer]), rounds=9, target=target)


@pytest.fixture(scope="module")
def posteriors(fitted, questions):
    """Posteriors of all tables by the sweep."""

    def ours(item) -> float:
        sweep_posterior(item.setup, **questions)
        return 1.0

    return in_turn(ours, fitted)


def test_posterior_by_the_sweep_against_emcee(compare, posteriors, fitted, questions):
    def sampled(item) -> float:
        sample_posterior(item.setup, item.fit, **questions)
        return 1.0

    ours = (f"posterior by the sweep, {N_RETURNED} draws, per table", posteriors)
    peer = ("pushfit's emcee until it has converged", in_turn(sampled, fitted))
    compare(ours, peer, rounds=N_SAMPLED, target=500)


def test_posterior_by_the_sweep_against_quadrature(
    compare, posteriors, fitted, questions
):
    def single(item) -> float:
        exact_posterior(item.setup, item.fit, n_draws=N_RETURNED, **questions)
        return 1.0

    ours = (f"posterior by the sweep, {N_RETURNED} draws, per table", posteriors)
    peer = ("adaptive quadrature, one table", in_turn(single, fitted))
    compare(ours, peer, rounds=N_SAMPLED)


@pytest.fixture(scope="module")
def lmfit_runs(swept, fitted):
    """Runs of lmfit's emcee that start in the posterior and need no burn-in."""
    words = {"reference_alpha": 0.0, "reach": reach_of(tables.CONFIG), "seed": 0}
    items = []
    for table, item in zip(swept, fitted, strict=False):
        found = exact_posterior(item.setup, item.fit, n_draws=peers.N_WALKERS, **words)
        starts = np.stack([np.log(found.samples[n]) for n in tables.NAMES], axis=1)
        items.append((peers.arrays(table), starts))
    return in_turn(lambda pair: peers.sample_by_lmfit(*pair, N_STEPS), items)


def test_effective_draws_of_emcee(compare, fitted, questions, lmfit_runs):
    def ours(item) -> float:
        found = sample_posterior(item.setup, item.fit, **questions)
        return found.diagnostics.ess["theta_c"]

    ours = ("emcee, per effective draw of θ_c", in_turn(ours, fitted))
    compare(
        ours,
        ("lmfit `.emcee`", lmfit_runs),
        rounds=N_LONG,
        target=60,
        is_peer_warm=True,
    )


@pytest.fixture
def nothing_compiled(monkeypatch):
    """Forgets, when it is called, all that was compiled or traced."""
    monkeypatch.delenv(PROGRAMS, raising=False)
    folder = jax.config.jax_compilation_cache_dir
    # JAX looks at its settings once, unless it is told to look again.
    jax.config.update("jax_compilation_cache_dir", None)
    compilation_cache.reset_cache()
    yield jax.clear_caches
    jax.config.update("jax_compilation_cache_dir", folder)
    compilation_cache.reset_cache()


def test_emcee_against_nuts(compare, fitted, questions, nothing_compiled):
    def ours() -> float:
        nothing_compiled()
        found = sample_posterior(fitted[0].setup, fitted[0].fit, **questions)
        return found.diagnostics.ess["theta_c"]

    def nuts() -> float:
        nothing_compiled()
        return peers.sample_by_nuts(fitted[0].setup.problem, questions["reach"])

    compare(
        ("emcee from start to end, compiling too, per effective draw of θ_c", ours),
        ("NUTS of numpyro", nuts),
        rounds=N_LONG,
        target=5,
        is_peer_warm=True,
    )


def test_posterior_by_the_sweep_against_lmfit(compare, posteriors, lmfit_runs):
    ours = (f"posterior by the sweep, {N_RETURNED} draws, per table", posteriors)
    peer = (
        f"lmfit `.emcee`, per {N_EFFECTIVE} effective draws",
        lambda: lmfit_runs() / N_EFFECTIVE,
    )
    compare(ours, peer, rounds=N_LONG, target=1000, is_peer_warm=True)


def test_identification_of_many_tables(compare, swept, lmfit_runs):
    def ours() -> float:
        identify_many(swept, tables.CONFIG, seeds=range(N_TABLES), engine="sweep")
        return N_TABLES

    ours = ("whole identification in a batch, per table", ours)
    peer = (
        f"lmfit `.emcee`, per {N_EFFECTIVE} effective draws",
        lambda: lmfit_runs() / N_EFFECTIVE,
    )
    compare(ours, peer, rounds=N_LONG, is_peer_warm=True)


@pytest.mark.parametrize(
    ("name", "target"), [("paper", None), ("tilting", 10)], ids=["paper", "tilting"]
)
def test_identification_of_the_protocol(compare, name, target):
    """126 heights or so, a preload and the ellipse free, beside one plain sweep."""

    def many(kind):
        pushes = [KINDS[kind].table(seed) for seed in range(N_PROTOCOL)]
        settings = config(KINDS[kind].text)

        def run() -> float:
            identify_many(pushes, settings, seeds=range(N_PROTOCOL), engine="sweep")
            return N_PROTOCOL

        return run

    words = {"paper": "the paper's protocol", "tilting": "the same by tilting"}
    base = "plain" if name == "paper" else "paper"
    peers = {"plain": "one sweep without preload", "paper": words["paper"]}
    ours = (f"{words[name]}, whole identification in a batch, per table", many(name))
    compare(ours, (peers[base], many(base)), rounds=3, target=target, is_cost=True)


@pytest.fixture
def recorded():
    """An hour at 2.2 kHz and its number of pushes; the file does not stay."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "recording.csv"
        yield path, recording_scale.write(path, N_RECORDED)


def test_reading_and_peaks(compare, recorded):
    path, n_pushes = recorded

    def million(reader):
        def run() -> float:
            reader(path, n_pushes)
            return N_RECORDED / 1e6

        return run

    ours = (
        "reading a recording and its peaks, per million rows",
        million(recording_scale.extract),
    )
    peer = ("bare `pandas.read_csv`", million(recording_scale.read_bare))
    compare(ours, peer, rounds=3, target=3, is_cost=True)


@pytest.mark.parametrize("has_span", [False, True], ids=["one", "two"])
@pytest.mark.parametrize("where", ["over the prior", "near one point"])
def test_tilting(compare, has_span, where):
    rng = np.random.default_rng(1)
    posed = {
        name: tilting_cost.problem(name, has_span=has_span)
        for name in tilting_cost.MECHANICS
    }
    x = jnp.asarray(prior_x_samples(posed["tilting"], rng, tilting_cost.N_DRAWS))
    if where == "near one point":
        # As walkers of a sampler and steps of a fit are.
        x = jnp.median(x, axis=0) + 0.1 * rng.standard_normal(x.shape)
    model = {n: jax.jit(jax.vmap(tilting_cost.heights(p))) for n, p in posed.items()}

    def heights(name):
        def run() -> float:
            jax.block_until_ready(model[name](x))
            return 1.0

        return run

    supports = "two supports" if has_span else "one support"
    ours = (
        f"tilting, {supports}, {tilting_cost.N_DRAWS} × 51 heights {where}",
        heights("tilting"),
    )
    peer = ("linear mechanics", heights("linear"))
    compare(ours, peer, rounds=15, target=4, is_cost=True)


@pytest.fixture(scope="module")
def tilted_fits():
    """Least squares of the same tables by either mechanics, one after the other."""

    def one(setup) -> float:
        fit_least_squares(setup, reference_alpha=0.0)
        return 1.0

    return {
        name: in_turn(
            one, [tilting_cost.setup(name, seed=seed) for seed in range(N_TILTED)]
        )
        for name in tilting_cost.MECHANICS
    }


def test_least_squares_by_tilting(compare, tilted_fits):
    ours = ("tilting, least squares, one table by itself", tilted_fits["tilting"])
    peer = ("linear mechanics, one table by itself", tilted_fits["linear"])
    compare(ours, peer, rounds=N_TILTED, is_cost=True)
