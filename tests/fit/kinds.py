"""Problems of every kind that the model can say: a new kind is one entry."""

from dataclasses import dataclass

import numpy as np

from pushfit.data.simulate import simulate_table
from pushfit.data.tables.peak_table import PeakTable
from pushfit.fit.problem.setup import Setup
from pushfit.model import Grasp
from tests.fit.tables import setup_of
from tests.problems import PUSH, ellipse, paper_parameters

# θ of the paper's protocol, at α = 90°, and α of its second sweep, at θ = 15°.
THETA_DEG = np.arange(-60.0, 61.0, 15.0)
ALPHA_DEG = np.arange(0.0, 151.0, 15.0)
ABOVE_DEG = np.arange(5.0, 90.0, 10.0)
NOISE = 0.05


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """A grasp, what is pushed, and what is said of it.

    Args:
        text: More of grasp.toml.
        preload: F_0 [N].
        mechanics: Mechanics that the heights follow.
        support_span: Distance between two supports [m].
        channels: Channels of the table.
        sweeps: "theta", "alpha", or both.
        sd_spread: Of ln sd from height to height, where each states its own.
    """

    text: str = ""
    preload: float = 2.0
    mechanics: str = "linear"
    support_span: float | None = None
    channels: tuple[str, ...] = ("height",)
    sweeps: tuple[str, ...] = ("theta", "alpha")
    sd_spread: float = 0.0

    def table(self, seed: int, repeats: int = 3) -> PeakTable:
        """Heights with noise of `NOISE` newtons."""
        elevations = THETA_DEG if self.preload else ABOVE_DEG
        theta, alpha = np.zeros(0), np.zeros(0)
        if "theta" in self.sweeps:
            theta, alpha = elevations, np.full(elevations.size, 90.0)
        if "alpha" in self.sweeps:
            theta = np.append(theta, np.full(ALPHA_DEG.size, 15.0))
            alpha = np.append(alpha, ALPHA_DEG)
        rng = np.random.default_rng(seed)
        table = simulate_table(
            paper_parameters(**ellipse(2.0, 160.0)),
            Grasp(
                push_length=PUSH,
                preload=self.preload,
                mechanics=self.mechanics,
                support_span=self.support_span,
            ),
            theta=np.radians(theta),
            alpha=np.radians(alpha),
            repeats=repeats,
            noise=NOISE,
            rng=rng,
            channels=self.channels,
        )
        if not self.sd_spread:
            return table
        sd = NOISE / 2 * rng.lognormal(sigma=self.sd_spread, size=table.n_pushes)
        return PeakTable.from_arrays(
            theta=table.theta,
            alpha=table.alpha,
            heights={name: table.heights(name) for name in table.channels},
            unit=table.unit,
            sd=dict.fromkeys(table.channels, sd),
        )

    def setup(self, seed: int) -> Setup:
        """The problem that such a table poses."""
        return setup_of(self.table(seed), self.text)


GRASP = "[grasp]\npreload_n = 2.0\n"
OPEN = '[transition]\nsharpness = "auto"\n'
MEASURED = "[parameters.L]\nnormal = { mean = 0.04, sd = 0.001 }\n"
KINDS = {
    "plain": Kind(preload=0.0, sweeps=("theta",)),
    "ellipse": Kind(preload=0.0),
    "paper": Kind(text=GRASP),
    "azimuths": Kind(text=GRASP, sweeps=("alpha",)),
    "estimated_preload": Kind(text='[grasp]\npreload_n = "estimate"\n'),
    "components": Kind(text=GRASP, channels=("height_normal", "height_tangential")),
    "all_channels": Kind(
        text=GRASP, channels=("height", "height_normal", "height_tangential")
    ),
    "student": Kind(text=GRASP + '[noise]\nlikelihood = "student_t"\n'),
    "sampled": Kind(text=GRASP + '[noise]\nsigma = "sampled"\n'),
    "student_sampled": Kind(
        text=GRASP + '[noise]\nsigma = "sampled"\nlikelihood = "student_t"\n'
    ),
    "uneven": Kind(text=GRASP + '[noise]\nsigma = "sampled"\n', sd_spread=0.5),
    "soft": Kind(text=GRASP + "[transition]\nsharpness = 4\n"),
    "open_transition": Kind(text=GRASP + OPEN),
    "two_supports": Kind(text=GRASP + "support_span_mm = 40\n", support_span=0.04),
    "uniform": Kind(
        text=GRASP
        + "[parameters.K_sn]\nuniform = { low = 500, high = 2000 }\n"
        + "[parameters.C_rr]\nuniform = { low = 0.05, high = 0.6 }\n"
    ),
    "narrow": Kind(
        text=GRASP
        + MEASURED
        + "[parameters.K_st]\nlognormal = { median = 300, sd_log = 0.03 }\n"
    ),
    "fixed": Kind(text=GRASP + "[parameters.K_st]\nfixed = 300\n"),
    "friction_fixed": Kind(text=GRASP + "[parameters.C_rr]\nfixed = 0.25\n"),
    "tilting": Kind(
        text=GRASP + 'mechanics = "tilting"\n' + MEASURED, mechanics="tilting"
    ),
    "open_transition_tilting": Kind(
        text=GRASP + 'mechanics = "tilting"\n' + MEASURED + OPEN,
        mechanics="tilting",
        sweeps=("theta",),
    ),
}
