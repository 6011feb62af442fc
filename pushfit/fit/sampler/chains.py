"""A run of emcee in blocks: its density, its next steps, and how it is kept.

Everything that the next step depends on is in `Run`, so that a run that was written
and read back continues to the same bits. Excluded: where walkers start and when a run
may end.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import emcee
import jax
import jax.numpy as jnp
import numpy as np
from emcee.moves import Move
from emcee.state import State
from jaxtyping import Array, Float

from pushfit.errors import ConvergenceError
from pushfit.fit.problem.problem import Problem
from pushfit.fit.programs.compile import compiled, in_chunks
from pushfit.fit.sampler.checkpoint import load_checkpoint, save_checkpoint
from pushfit.fit.sampler.mixture import Mixture

# Rows per call of the compiled density, the usual number of walkers. A difference move
# asks for half of them; one program with idle rows is still faster than two calls.
CHUNK = 256
TWISTER = "MT19937"
# Names of the arrays of a run.
KEPT = (
    *("chain", "log_prob"),
    *("random_key", "random_position", "random_has_normal", "random_normal"),
    *("weights", "means", "factors"),
)


@dataclass(slots=True, kw_only=True)
class Run:
    """A run so far, and all that its next step depends on.

    Args:
        chain: Points by step and walker, ensembles one after the other.
        log_prob: Log density of each point.
        random: Source of randomness of the next step.
        mixture: Proposal of the independence move.
    """

    chain: Float[np.ndarray, "t k p"]
    log_prob: Float[np.ndarray, "t k"]
    random: np.random.RandomState
    mixture: Mixture

    def advance(
        self,
        log_prob: Callable[[np.ndarray], np.ndarray],
        moves: Sequence[tuple[Move, float]],
        n_steps: int,
    ) -> None:
        """Run the ensembles on, and append their steps to the chain."""
        chain, values = advance(
            log_prob,
            self.chain[-1],
            n_steps,
            moves=moves,
            random=self.random,
            log_prob_start=self.log_prob[-1],
        )
        self.chain = np.concatenate([self.chain, chain])
        self.log_prob = np.concatenate([self.log_prob, values])


def advance(
    log_prob: Callable[[np.ndarray], np.ndarray],
    start: Float[np.ndarray, "k p"],
    n_steps: int,
    *,
    moves: Sequence[tuple[Move, float]],
    random: np.random.RandomState,
    log_prob_start: Float[np.ndarray, " k"] | None = None,
) -> tuple[Float[np.ndarray, "t k p"], Float[np.ndarray, "t k"]]:
    """Steps of emcee from given points.

    Args:
        start: Walkers; left as they are.
        log_prob_start: Log density of `start`, where it is known.
    """
    sampler = emcee.EnsembleSampler(
        len(start), start.shape[1], log_prob, moves=list(moves), vectorize=True
    )
    state = State(
        start, log_prob=log_prob_start, random_state=random.get_state(), copy=True
    )
    # emcee's check of the start takes several ensembles for one.
    sampler.run_mcmc(state, n_steps, skip_initial_state_check=True)
    random.set_state(sampler.random_state)
    return np.asarray(sampler.get_chain()), np.asarray(sampler.get_log_prob())


class Densities:
    """Log prior and log likelihood of many points, by one compiled program."""

    def __init__(self, problem: Problem) -> None:
        """Keep the problem whose densities are asked for."""
        self.problem = problem

    def __call__(
        self, x: Float[np.ndarray, "n p"]
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        """Log prior and log likelihood of each point; -inf where undefined."""
        pair = in_chunks(lambda rows: _log_densities(self.problem, rows), x, CHUNK)
        pair = np.where(np.isnan(pair), -np.inf, pair)
        if np.any(np.isposinf(pair)):
            worst = x[np.argmax(np.max(pair, axis=1))]
            point = ", ".join(
                f"{n} = {v:.6g}" for n, v in zip(self.problem.names, worst, strict=True)
            )
            raise ConvergenceError(
                f"the posterior density is infinite at {point}; check the standard "
                "deviations of the heights and the priors in grasp.toml",
                code="infinite_density",
            )
        return pair[:, 0], pair[:, 1]

    def log_prob(self, x: Float[np.ndarray, "n p"]) -> Float[np.ndarray, " n"]:
        """Unnormalised log posterior density of each point."""
        log_prior, log_likelihood = self(x)
        return log_prior + log_likelihood


@compiled
def _log_densities(problem: Problem, x: Float[Array, "n p"]) -> Float[Array, "n 2"]:
    def one(x: Float[Array, " p"]) -> Float[Array, " 2"]:
        log_likelihood = problem.log_likelihood(problem.state(x))
        return jnp.stack([problem.log_prior(x), log_likelihood])

    return jax.vmap(one)(x)


def keep_run(run: Run, path: Path, *, question: str) -> None:
    """Write a run to a file, from which `resume` goes on with the same question."""
    mixture, state = run.mixture, run.random.get_state(legacy=False)
    random = (*state["state"].values(), state["has_gauss"], state["gauss"])
    parts = (mixture.weights, mixture.means, mixture.factors)
    values = map(np.asarray, (run.chain, run.log_prob, *random, *parts))
    save_checkpoint(path, dict(zip(KEPT, values, strict=True)), question=question)


def resume(path: Path, *, question: str) -> Run | None:
    """A run as `keep_run` wrote it; None if there is none of this question."""
    arrays = load_checkpoint(path, question=question)
    if arrays is None:
        return None
    chain, log_prob, key, position, has_normal, normal, *parts = (
        arrays[name] for name in KEPT
    )
    random = np.random.RandomState()
    random.set_state((TWISTER, key, int(position), int(has_normal), float(normal)))
    mixture = Mixture(**dict(zip(KEPT[-3:], parts, strict=True)))
    return Run(chain=chain, log_prob=log_prob, random=random, mixture=mixture)
