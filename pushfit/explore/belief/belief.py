"""What is believed of a grasp: weighted draws of its parameters, whoever made them.

`believe` is the only contact of this package with the inference of `pushfit.fit`. A
belief takes in one more push by new weights, which costs microseconds; when few draws
are left with weight, `believe` is asked again. Excluded: choosing pushes.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float
from scipy.special import logsumexp

from pushfit.config import GraspConfig
from pushfit.data.grasp import is_calibrated, make_grasp
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.derived import samples_mapping
from pushfit.fit.identify import (
    draw_posterior,
    fit_table,
    prepared,
    reach_of,
    reference_azimuth,
)
from pushfit.fit.problem import STUDENT_DOF
from pushfit.fit.results import FitStatus
from pushfit.fit.setup import Setup, build_problem, n_azimuths
from pushfit.fit.starts import prior_x_samples
from pushfit.fit.sweep.posterior import sweep_posterior
from pushfit.model import Grasp

# Draws of a belief, always as many: programs are compiled for one shape. A gain from
# so many loses 0.4 % of the best one, from 500 it loses 4 %.
N_DRAWS = 8192
# Median A of the default priors [N/m]: the height of a push that nobody has made yet.
TYPICAL_STIFFNESS = 571.0
# Noise of a height, as a share of it, where nothing is known of either.
TYPICAL_NOISE = 0.05
# Noise in heights that lets a row set the question and leaves the answer alone.
IMMENSE = 1e6
PARAMETERS = ("K_sn", "K_dn", "K_st", "C_rr", "C_d", "L", "e1", "e2", "F_0")


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """What is asked, and through which sensor.

    Args:
        config: Settings in force.
        ask: The angles asked for, of "theta_c" and "alpha_star".
        channels: Height channels of every push.
        unit: Unit of the heights.
        sigma: Stated standard deviation of a height; None where it is to be learned
            [unit].
        reference_alpha: Azimuth at which θ_c is asked for [rad].
    """

    config: GraspConfig
    ask: tuple[str, ...]
    channels: tuple[str, ...]
    unit: str
    sigma: float | None
    reference_alpha: float

    @property
    def settings(self) -> GraspConfig:
        """Settings with θ_c quoted where it is asked for."""
        azimuth = float(np.degrees(self.reference_alpha))
        grasp = self.config.grasp.model_copy(update={"reference_alpha_deg": azimuth})
        return self.config.model_copy(update={"grasp": grasp})


@dataclass(frozen=True, slots=True, kw_only=True)
class Belief:
    """Draws of everything that is not known, with their weights.

    Args:
        samples: Draws by name: the parameters, F_0 where it is free, and the angles
            theta_c and alpha_star [deg].
        log_weights: Log of the weight of every draw, up to a constant.
        scatter: Noise that is not stated with each height, by channel and draw [unit].
        sd: Noise to expect that is stated with a height, by channel [unit].
        is_sd_used: Whether the sd stated with a height counts.
        channels: Names of the rows of `scatter`.
        grasp: Grasp and sensor.
        likelihood: "normal" or "student_t".
        is_guess: Whether only the priors speak.
    """

    samples: Mapping[str, Float[np.ndarray, " n"]]
    log_weights: Float[np.ndarray, " n"]
    scatter: Float[np.ndarray, "c n"]
    sd: Float[np.ndarray, " c"]
    is_sd_used: bool
    channels: tuple[str, ...]
    grasp: Grasp
    likelihood: str
    is_guess: bool

    @property
    def weights(self) -> Float[np.ndarray, " n"]:
        """Weights that sum to 1."""
        return np.exp(self.log_weights - logsumexp(self.log_weights))

    @property
    def effective_share(self) -> float:
        """Effective number of draws (Kish) over those there were."""
        weights = self.weights
        n = np.count_nonzero(np.isfinite(self.log_weights))
        return float(1.0 / (n * np.sum(weights**2)))

    @property
    def sigma(self) -> Float[np.ndarray, " c"]:
        """Noise to expect of the next height, by channel [unit]."""
        variance = (self.scatter**2) @ self.weights + self.sd**2
        return np.sqrt(variance)

    @property
    def parameters(self) -> dict[str, Float[np.ndarray, " n"]]:
        """What heights are predicted from."""
        return {name: self.samples[name] for name in PARAMETERS if name in self.samples}

    def updated(
        self,
        heights: Float[np.ndarray, " c"],
        predicted: Float[np.ndarray, "c n"],
        sd: Float[np.ndarray, " c"] | None,
    ) -> "Belief":
        """The belief after one more push.

        Args:
            heights: Measured heights, by channel [unit].
            predicted: Noise-free height of the push, by channel and draw [unit].
            sd: Standard deviations stated with the heights [unit].

        Returns:
            A belief with new weights on the same draws.
        """
        stated = self.sd if sd is None or not self.is_sd_used else sd
        noise = np.hypot(self.scatter, stated[:, None])
        r = (heights[:, None] - predicted) / noise
        if self.likelihood == "student_t":
            density = -(STUDENT_DOF + 1) / 2 * np.log1p(r**2 / STUDENT_DOF)
        else:
            density = -(r**2) / 2
        change = np.sum(density - np.log(noise), axis=0)
        return replace(self, log_weights=self.log_weights + change)


BeliefSource = Callable[[PeakTable | None, Question, int], Belief]


def believe(table: PeakTable | None, question: Question, seed: int) -> Belief:
    """What a table of pushes leaves to be believed.

    Args:
        table: Pushes made so far; None where there are none.
        question: What is asked, and through which sensor.
        seed: Seed of the draws.

    Returns:
        `N_DRAWS` draws of the posterior, or of the prior without a usable push.
    """
    if table is None or not np.any(table.is_used):
        return _prior_belief(question, seed)
    table = _with_open_direction(table, question)
    settings, _ = prepared(table, question.settings)
    setup = build_problem(table, settings)
    posterior = sweep_posterior(
        setup,
        seed=seed,
        reference_alpha=reference_azimuth(table, settings),
        reach=reach_of(settings),
    )
    if posterior.status is not FitStatus.OK:
        fitted = fit_table(table, question.settings)
        posterior = draw_posterior(fitted, seed=seed, engine="emcee")
        setup = fitted.setup
    return _belief(setup, posterior.samples, seed=seed, is_guess=False)


def noise_is_known(question: Question, table: PeakTable | None) -> bool:
    """Whether the scatter of the heights rests on more than a default prior.

    Args:
        question: What is asked.
        table: Pushes made so far.

    Returns:
        True where it is stated with the heights or in advance.
    """
    if question.sigma is not None:
        return True
    if table is None:
        return False
    return all(table.sd(channel) is not None for channel in table.channels)


def _prior_belief(question: Question, seed: int) -> Belief:
    """Draws of the prior, of which a made-up push only sets the scale."""
    setup = build_problem(_made_up(question), question.settings)
    rng = np.random.default_rng(seed)
    x = prior_x_samples(setup.problem, rng, N_DRAWS)
    reach = reach_of(question.settings)
    samples = samples_mapping(setup.problem, x, question.reference_alpha, reach)
    return _belief(setup, samples, seed=seed, is_guess=True)


def _made_up(question: Question) -> PeakTable:
    """Pushes that nobody made: they say which numbers are free, and their scale."""
    grasp = make_grasp(question.settings, question.unit)
    height = TYPICAL_STIFFNESS * float(grasp.push_length * grasp.gain)
    sigma = question.sigma
    if not is_calibrated(question.config, question.unit) and sigma is not None:
        height = sigma / TYPICAL_NOISE
    reach = reach_of(question.settings)
    azimuths = [question.reference_alpha]
    if "alpha_star" in question.ask:
        azimuths.append(_other_azimuth(question.reference_alpha, reach))
    n = len(azimuths)
    given = (
        None if sigma is None else dict.fromkeys(question.channels, np.full(n, sigma))
    )
    return PeakTable.from_arrays(
        theta=np.full(n, np.pi / 4),
        alpha=np.asarray(azimuths),
        heights=dict.fromkeys(question.channels, np.full(n, height)),
        unit=question.unit,
        sd=given,
    )


def _with_open_direction(table: PeakTable, question: Question) -> PeakTable:
    """Ask for the ellipse also before a second azimuth was pushed.

    A row that says nothing, at another azimuth, keeps the ellipse among what is free.
    """
    used = table.is_used
    if "alpha_star" not in question.ask or n_azimuths(table.alpha[used]) > 1:
        return table
    alpha = float(table.alpha[used][0])
    other = _other_azimuth(alpha, reach_of(question.settings))
    heights, sds = {}, {}
    for channel in table.channels:
        own = table.heights(channel)
        typical = float(np.max(np.abs(own[used])))
        sd = table.sd(channel)
        stated = np.full(own.size, 1e-3 * TYPICAL_NOISE * typical) if sd is None else sd
        heights[channel] = np.append(own, typical)
        sds[channel] = np.append(stated, IMMENSE * typical)
    return PeakTable.from_arrays(
        theta=np.append(table.theta, np.pi / 4),
        alpha=np.append(table.alpha, other),
        heights=heights,
        unit=table.unit,
        sd=sds,
        flags=(*(";".join(sorted(words)) for words in table.flags), ""),
    )


def _other_azimuth(alpha: float, reach: tuple[float, float]) -> float:
    """An azimuth as far from another as the reach allows, at most a quarter turn."""
    low, high = reach
    ends = [min(alpha + np.pi / 2, high), max(alpha - np.pi / 2, low)]
    return float(max(ends, key=lambda end: abs(end - alpha)))


def _belief(
    setup: Setup,
    samples: Mapping[str, Float[np.ndarray, " n"]],
    *,
    seed: int,
    is_guess: bool,
) -> Belief:
    """Draws as a belief, padded without weight to what programs are compiled for."""
    problem, noise = setup.problem, setup.noise
    n = next(iter(samples.values())).size
    rng = np.random.default_rng([seed, n])
    rows = rng.permutation(n)[:N_DRAWS]
    is_own = np.arange(N_DRAWS) < rows.size
    rows = np.resize(rows, N_DRAWS)
    kept = {name: np.asarray(values)[rows] for name, values in samples.items()}
    for name in ("e1", "e2"):
        fixed = float(problem.fixed.get(name, 0.0))
        kept.setdefault(name, np.full(N_DRAWS, fixed))
    used = list(setup.rows)
    scatter, sd = [], []
    for channel in problem.channels:
        known = noise.sd[channel][used]
        # Rows that say nothing are not what the next push is like.
        sd.append(float(np.median(known)))
        own = kept.get(f"sigma_{channel}")
        if own is None:
            pooled = float(np.median(noise.sigma[channel][used]))
            own = np.full(N_DRAWS, pooled if noise.kind == "pooled" else 0.0)
        scatter.append(own)
    return Belief(
        samples=kept,
        log_weights=np.where(is_own, 0.0, -np.inf),
        scatter=np.stack(scatter),
        sd=np.asarray(sd),
        is_sd_used=noise.kind != "pooled",
        channels=problem.channels,
        grasp=problem.grasp,
        likelihood=problem.likelihood,
        is_guess=is_guess,
    )


def has_direction(belief: Belief) -> Bool[np.ndarray, ""]:
    """Whether heights of the belief depend on the azimuth."""
    return np.asarray("alpha_star" in belief.samples)
