"""What is believed of a grasp: weighted draws of its parameters, whoever made them.

A belief takes in one more push by new weights, which costs microseconds. Excluded:
where draws come from (`pushfit.explore.belief.from_fit`), and choosing pushes.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import get_args

import numpy as np
import scipy
from jaxtyping import Float

from pushfit.config import GraspConfig
from pushfit.data.tables.peak_table import PeakTable
from pushfit.data.tables.rules import CHANNELS
from pushfit.errors import ConfigError, counted
from pushfit.fit.assess.model_free import DISAGREEMENT
from pushfit.fit.assess.warnings import INADEQUATE, NOT_CONVERGED
from pushfit.fit.problem.problem import STUDENT_DOF
from pushfit.fit.results import ResultWarning
from pushfit.model import Grasp
from pushfit.parameters import PARAMETERS, SensorUnit

# Draws of a belief, always as many: programs are compiled for one shape. A gain from
# so many loses 0.4 % of the best one, from 500 it loses 4 %.
N_BELIEF_DRAWS = 8192
# Fewer effective draws give no interval: 400 know the ends of one of 90 % to 3 % of its
# width. Weighed priors come to so few, which are not drawn anew.
FEWEST_DRAWS = 400
# Words that ask for angles.
ASKABLE: dict[str, tuple[str, ...]] = {
    "theta_c": ("theta_c",),
    "alpha_star": ("alpha_star",),
    "both": ("theta_c", "alpha_star"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Question:
    """What is asked, and through which sensor.

    Args:
        config: Settings of grasp, sensor and priors.
        ask: The angles asked for, of "theta_c" and "alpha_star".
        channels: Height channels of the sensor.
        unit: Unit of the heights.
        sigma: Stated standard deviation of a height; None where it is to be learned
            [table unit].
        reference_alpha: Azimuth at which θ_c is asked for [rad].
    """

    config: GraspConfig
    ask: tuple[str, ...]
    channels: tuple[str, ...]
    unit: str
    sigma: float | None
    reference_alpha: float

    def __post_init__(self) -> None:
        """Refuse a sensor whose heights could be in no table.

        Raises:
            ConfigError: Its channels, unit or noise are none.
        """
        unknown = [name for name in self.channels if name not in CHANNELS]
        units = get_args(SensorUnit)
        if unknown or not self.channels:
            problem = f"channels {unknown} are not known" if unknown else "no channel"
            problem += f"; name some of {', '.join(CHANNELS)}, in a tuple"
        elif self.unit not in units:
            problem = f"unit = {self.unit!r} is not known; take {', '.join(units)}"
        elif self.sigma is not None and not 0 < self.sigma < np.inf:
            problem = f"sigma = {self.sigma} is no standard deviation; state a positive"
            problem += " one in the unit of the heights, or none to have it learned"
        else:
            return
        raise ConfigError(problem, code="sensor")

    @property
    def settings(self) -> GraspConfig:
        """Settings with θ_c quoted where it is asked for."""
        azimuth = float(np.degrees(self.reference_alpha))
        return self.config.with_keys("grasp", reference_alpha_deg=azimuth)


@dataclass(frozen=True, slots=True, kw_only=True)
class Belief:
    """Draws of everything that is not known, with their weights.

    Args:
        samples: Draws by name: the parameters, F_0 and p where they are free, and the
            angles theta_c and alpha_star [deg].
        log_weights: Log of the weight of every draw, up to a constant.
        scatter: Noise that no height states, by channel and draw [table unit].
        sd: Noise to expect that is stated with a height, by channel [table unit].
        is_sd_used: Whether the sd stated with a height counts.
        channels: Names of the rows of `scatter`.
        grasp: What is known of grasp and sensor.
        likelihood: "normal" or "student_t".
        is_guess: Whether only the priors speak.
        warnings: What heights and posterior say that an identification would tell.
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
    warnings: tuple[ResultWarning, ...] = ()

    @property
    def weights(self) -> Float[np.ndarray, " n"]:
        """Weights that sum to 1."""
        return np.exp(self.log_weights - scipy.special.logsumexp(self.log_weights))

    @property
    def ess(self) -> float:
        """Effective number of draws (Kish)."""
        return float(1.0 / np.sum(self.weights**2))

    @property
    def effective_share(self) -> float:
        """The same over those there were."""
        return self.ess / np.count_nonzero(np.isfinite(self.log_weights))

    @property
    def is_described(self) -> bool:
        """Whether the model describes the heights, as far as anything speaks of it."""
        return all(warning.code != INADEQUATE for warning in self.warnings)

    def lacks(self, angle: str) -> str | None:
        """Why draws give no interval of an angle, by the rules of an identification.

        Returns:
            The reason as a clause; None where they give one.
        """
        if self.ess < FEWEST_DRAWS:
            n = round(self.ess)
            return f"only {counted(n, 'draw')} of it {'is' if n == 1 else 'are'} left"
        codes = {warning.code for warning in self.warnings}
        if NOT_CONVERGED in codes:
            return "its draws are not to be trusted"
        if angle == "alpha_star" and DISAGREEMENT in codes:
            return "the model and a cosine through the heights disagree about it"
        return None

    @property
    def sigma(self) -> Float[np.ndarray, " c"]:
        """Noise to expect of the next height, by channel [table unit]."""
        variance = (self.scatter**2) @ self.weights + self.sd**2
        return np.sqrt(variance)

    @property
    def parameters(self) -> dict[str, Float[np.ndarray, " n"]]:
        """What heights are predicted from."""
        return {name: self.samples[name] for name in PARAMETERS if name in self.samples}

    def noise(self, sd: Float[np.ndarray, " c"] | None) -> Float[np.ndarray, "c n"]:
        """Noise of a height, by channel and draw [table unit].

        Args:
            sd: Standard deviations stated with the height [table unit].
        """
        stated = self.sd if sd is None or not self.is_sd_used else sd
        return np.hypot(self.scatter, stated[:, None])

    def updated(
        self,
        heights: Float[np.ndarray, " c"],
        predicted: Float[np.ndarray, "c n"],
        sd: Float[np.ndarray, " c"] | None,
    ) -> "Belief":
        """The belief after one more push.

        Args:
            heights: Measured heights, by channel [table unit].
            predicted: Noise-free height of the push, by channel and draw [table unit].
            sd: Standard deviations stated with the heights [table unit].
        """
        noise = self.noise(sd)
        r = (heights[:, None] - predicted) / noise
        if self.likelihood == "student_t":
            density = -(STUDENT_DOF + 1) / 2 * np.log1p(r**2 / (STUDENT_DOF - 2))
        else:
            density = -(r**2) / 2
        change = np.sum(density - np.log(noise), axis=0)
        return replace(self, log_weights=self.log_weights + change)


# Of the pushes made so far, the question, and a seed.
BeliefSource = Callable[[PeakTable | None, Question, int], Belief]
