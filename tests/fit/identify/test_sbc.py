"""Simulation-based calibration: the rank of a truth among draws given its data.

Truths come from the prior, data from the truths. If the posterior is right, the rank of
any quantity of the truth among posterior draws is uniform (Talts et al. 2018,
arXiv:1804.06788); the log likelihood ranks the data with it (Modrák et al. 2023,
doi:10.1214/23-BA1404). Draws from a posterior that is wrong in a known way must fail,
or the test could not have seen it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats

from pushfit.fit.problem.derived import samples_mapping
from pushfit.fit.problem.encoding import prior_x_samples
from pushfit.fit.problem.problem import STUDENT_DOF
from pushfit.fit.problem.setup import Setup, build_problem
from pushfit.fit.profiles.least_squares import fit_least_squares, settle_noise
from pushfit.fit.results import FitStatus
from pushfit.fit.sampler.emcee_posterior import Budget, sample_posterior
from pushfit.fit.sweep.posterior import weighted_draws
from pushfit.fit.sweep.prior import make_target
from pushfit.model import Pushes
from tests.fit.tables import case_table, config
from tests.problems import CASES
from tests.tolerances import MAX_Z

SIX = {"K_sn", "K_dn", "K_st", "C_rr", "C_d", "L"}
REACH = (0.0, float(np.pi))
N_RANKED = 99
# Draws that a wrong posterior is made from by weights.
N_DRAWS = 1000
N_BINS, MIN_P = 20, 1e-4
# Fewer per bin than this, and chi-square is no test.
MIN_PER_BIN = 5
# An expected error of 1e-3 in the evidence moves no rank.
RTOL = 1e-3
# A quarter of the usual walkers does not converge every time.
MIN_CONVERGED = 0.9


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """Pushes with their priors, and how posterior draws are made.

    Args:
        setup: Problem; only its heights change from data set to data set.
        reference_alpha: Azimuth of θ_c [rad].
        draws: Sampling coordinates of draws of a data set's posterior; None to leave
            the data set out.
    """

    setup: Setup
    reference_alpha: float
    draws: Callable[[Setup, float, int], np.ndarray | None]


def sweep_draws(setup: Setup, reference_alpha: float, seed: int) -> np.ndarray | None:
    found = weighted_draws(make_target(setup.problem, reference_alpha), seed=seed)
    if not found.is_trusted:
        return None
    return found.resampled(N_DRAWS, np.random.default_rng(seed))[0]


def chain_draws(setup: Setup, reference_alpha: float, seed: int) -> np.ndarray | None:
    """States of a chain, which on average lie far more than τ apart.

    None where it has not converged: that depends on the data, not on their truth, so
    leaving such data out keeps the other ranks uniform.
    """
    fit = fit_least_squares(setup, reference_alpha=reference_alpha, throw=False)
    posterior = sample_posterior(
        setup,
        fit,
        seed=seed,
        reference_alpha=reference_alpha,
        reach=REACH,
        budget=Budget(n_ensembles=2, n_walkers=32),
    )
    if posterior.status is not FitStatus.OK:
        return None
    flat = posterior.chain.reshape(-1, posterior.chain.shape[-1])
    return np.random.default_rng(seed).choice(flat, N_DRAWS, replace=False)


def heights_design(text: str = "", *, repeats: int = 3) -> Design:
    """One sweep and the six parameters."""
    table = case_table(CASES["firm"], noise=0.03, repeats=repeats)
    setup = build_problem(table, config(text))
    return Design(setup=setup, reference_alpha=np.pi / 2, draws=sweep_draws)


def ellipse_design() -> Design:
    """Both sweeps of the paper: e1 and e2 are free, and α* is asked for."""
    table = case_table(
        CASES["paper"],
        noise=0.03,
        repeats=1,
        theta_deg=np.r_[np.arange(5.0, 86.0, 10.0), np.full(6, 15.0)],
        alpha_deg=np.r_[np.full(9, 90.0), np.arange(0.0, 151.0, 30.0)],
    )
    setup = build_problem(table, config())
    return Design(setup=setup, reference_alpha=np.pi / 2, draws=chain_draws)


# What turns the log density of the right posterior into that of a wrong one.
WRONG = {
    "right": lambda values: 0.0,
    # Deviations weighed as if the noise were smaller: chi-square over the square.
    "noise 0.8": lambda values: -0.5 * values["chi_square"] * (0.8**-2 - 1),
    "noise 0.5": lambda values: -0.5 * values["chi_square"] * (0.5**-2 - 1),
    # dK = K d(ln K), as a normal prior of K on the scale of ln K has it.
    "prior without its Jacobian": lambda values: -np.log(values["K_sn"]),
    # Coordinates f instead of e, without the volume of that change.
    "volume dropped": lambda values: -values["log_volume"],
    "repeats alike": lambda values: values["alike"],
}


def ranked(
    design: Design, n: int, seed: int, *, wrong: tuple[str, ...]
) -> dict[str, dict[str, np.ndarray]]:
    """Ranks of n truths among draws, scaled to (0, 1), right posterior and wrong ones.

    Args:
        design: Pushes, priors and engine.
        n: Number of data sets.
        seed: Seed of everything.
        wrong: Names of wrong posteriors.

    Returns:
        For each posterior the ranks of every quantity.
    """
    rng = np.random.default_rng(seed)
    problem = design.setup.problem
    x_true = prior_x_samples(problem, rng, n)
    # Every push misses its angles by errors of its own.
    off = np.zeros((n, 2, problem.pushes.theta.size))
    angle_sd = np.array(design.setup.noise.angle_sd)
    if any(angle_sd):
        off = angle_sd[:, None] * rng.standard_normal(off.shape)
    clean, sigma = map(np.asarray, predictions(problem, jnp.asarray(x_true), off))
    ranks = {name: {} for name in ("right", *wrong)}
    for index in range(n):
        observed = clean[index] + sigma[index] * noise(problem, rng)
        observed += effects(problem, rng)
        data = eqx.tree_at(lambda p: p.observed, problem, jnp.asarray(observed))
        setup = settle_noise(replace(design.setup, problem=data))
        x = design.draws(setup, design.reference_alpha, seed + index)
        if x is None:
            continue
        truth, values = (
            quantities(setup.problem, points, design.reference_alpha)
            for points in (x_true[index : index + 1], x)
        )
        for name, of_this in ranks.items():
            log_weight = np.broadcast_to(WRONG[name](values), len(x))
            weight = np.exp(log_weight - np.max(log_weight))
            chosen = rng.choice(
                len(x), N_RANKED, replace=name != "right", p=weight / weight.sum()
            )
            for quantity in truth.keys() - {"log_volume", "chi_square", "alike"}:
                n_below = np.sum(values[quantity][chosen] < truth[quantity])
                of_this.setdefault(quantity, []).append(
                    (n_below + 0.5) / (N_RANKED + 1)
                )
    return {
        name: {quantity: np.array(u) for quantity, u in of_this.items()}
        for name, of_this in ranks.items()
    }


def noise(problem, rng: np.random.Generator) -> np.ndarray:
    """Noise of unit variance, as the likelihood has it."""
    shape = problem.observed.shape
    if problem.likelihood == "student_t":
        return rng.standard_t(STUDENT_DOF, shape) / stats.t.std(STUDENT_DOF)
    return rng.standard_normal(shape)


def effects(problem, rng: np.random.Generator) -> np.ndarray:
    """What heights of a group have in common [table unit]."""
    if problem.shared is None:
        return np.zeros(problem.observed.shape)
    size = rng.standard_normal(problem.shared.shape[:2])
    return np.einsum("cgn,cg->cn", problem.shared, size)


@eqx.filter_jit
def predictions(problem, x, off):
    """Noise-free heights and noise of each truth, its angles off by so much [rad]."""

    def one(x, off):
        pushes = problem.pushes
        moved = Pushes(pushes.theta + off[0], pushes.alpha + off[1])
        meant = replace(problem, pushes=moved)
        state = meant.state(x)
        return meant.predict(state), noise_of(problem, state)

    return jax.vmap(one)(x, off)


def noise_of(problem, state):
    """Stated standard deviations with the sampled sigma, or the known noise."""
    sigma = state.sigma[:, None]
    return jnp.where(sigma > 0, jnp.hypot(problem.sd, sigma), problem.reference_sigma)


def quantities(problem, x, reference_alpha):
    """All that is reported of each point, and how well it fits its data."""
    values = samples_mapping(problem, x, reference_alpha, reach=REACH)
    more = fits(problem, jnp.asarray(x))
    return values | {name: np.asarray(value) for name, value in more.items()}


@eqx.filter_jit
def fits(problem, x):
    def one(x):
        state = problem.state(x)
        error = jnp.where(problem.mask, problem.predict(state) - problem.observed, 0.0)
        alike = replace(problem, shared=None)
        return {
            "log_likelihood": problem.log_likelihood(state),
            "alike": alike.log_likelihood(state) - problem.log_likelihood(state),
            "chi_square": jnp.sum((error / noise_of(problem, state)) ** 2),
            "log_volume": jnp.asarray(state.log_volume),
        }

    return jax.vmap(one)(x)


def worst_z(ranks: dict[str, np.ndarray]) -> tuple[str, float]:
    """Quantity whose ranks are least uniform in mean or spread, and by how much.

    A uniform number has mean 1/2, variance 1/12, and its squared distance from the
    middle has variance 1/180.
    """
    scores = {}
    for name, u in ranks.items():
        mean = np.sqrt(12 * u.size) * (np.mean(u) - 1 / 2)
        spread = np.sqrt(180 * u.size) * (np.mean((u - 1 / 2) ** 2) - 1 / 12)
        scores[name] = max(abs(mean), abs(spread))
    name = max(scores, key=scores.__getitem__)
    return name, scores[name]


def smallest_p(ranks: dict[str, np.ndarray]) -> float:
    """Chi-square p-value of the histogram that is least flat."""
    counts = [np.histogram(u, bins=N_BINS, range=(0, 1))[0] for u in ranks.values()]
    return min(stats.chisquare(c).pvalue for c in counts)


def check(
    design: Design, n: int, seed: int, *, wrong: tuple[str, ...], asked: set[str]
) -> None:
    """The right posterior passes, and each wrong one is seen."""
    ranks = ranked(design, n, seed, wrong=wrong)
    for name, of_this in ranks.items():
        worst, z = worst_z(of_this)
        print(f"{name}: {of_this['A'].size} data sets, largest |z| {z:.1f}, of {worst}")
    assert asked <= ranks["right"].keys()
    assert ranks["right"]["A"].size >= MIN_CONVERGED * n
    # Of 20 numbers looked at: a false alarm once in 800 seeds.
    assert worst_z(ranks["right"])[1] < MAX_Z, worst_z(ranks["right"])
    if n >= MIN_PER_BIN * N_BINS:
        assert smallest_p(ranks["right"]) > MIN_P
    for name in wrong:
        assert worst_z(ranks[name])[1] > MAX_Z, name


@pytest.mark.slow
def test_a_few_ranks_are_uniform_and_those_of_half_the_noise_are_not():
    asked = SIX | {"theta_c", "log_likelihood"}
    check(heights_design(), 20, seed=0, wrong=("noise 0.5",), asked=asked)


@pytest.mark.slow
def test_ranks_are_uniform_and_those_of_wrong_posteriors_are_not():
    """With sigma sampled, and a normal prior of a positive parameter."""
    text = '[noise]\nsigma = "sampled"\n'
    text += "[parameters.K_sn]\nnormal = { mean = 1000.0, sd = 500.0 }\n"
    wrong = ("noise 0.8", "prior without its Jacobian")
    asked = SIX | {"sigma_height", "theta_c", "log_likelihood"}
    design = heights_design(text, repeats=1)
    check(design, 500, seed=1000, wrong=wrong, asked=asked)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("text", "more"),
    [
        ('[transition]\nsharpness = "auto"\n', {"p"}),
        ('[noise]\nlikelihood = "student_t"\n', set()),
        ("[noise]\ntheta_sd_deg = 1.0\nalpha_sd_deg = 1.0\n", set()),
    ],
    ids=["open transition", "student", "angles"],
)
def test_ranks_are_uniform_with_what_real_hands_ask_for(text, more):
    asked = SIX | more | {"theta_c", "log_likelihood"}
    check(heights_design(text), 250, seed=500, wrong=("noise 0.8",), asked=asked)


@pytest.mark.slow
@pytest.mark.parametrize("text", ["offset_sd = 0.1\n", "gain_sd = 0.1\n"])
def test_ranks_are_uniform_with_what_repeats_have_in_common(text):
    design = heights_design(f"[noise]\n{text}")
    asked = SIX | {"theta_c", "log_likelihood"}
    check(design, 250, seed=700, wrong=("repeats alike",), asked=asked)


@pytest.mark.slow
def test_ranks_of_chains_are_uniform_with_a_direction_in_question():
    wrong = ("noise 0.8", "volume dropped")
    asked = SIX | {"e1", "e2", "theta_c", "alpha_star", "log_likelihood"}
    check(ellipse_design(), 250, seed=0, wrong=wrong, asked=asked)
