"""From a peak table and a configuration to a `Problem`.

Decides what is free, what is fixed, and in which coordinates; everything that depends
on the shape of the question and not on the numbers is settled here. Excluded: its
densities (`pushfit.fit.problem.problem`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from pushfit.config import GraspConfig
from pushfit.data.grasp import is_calibrated, make_grasp
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import DataError, SettingsError
from pushfit.fit.problem.constraint_terms import with_constraints
from pushfit.fit.problem.data_coordinates import data_names
from pushfit.fit.problem.noise import Noise, choose_noise
from pushfit.fit.problem.priors.distributions import (
    Prior,
    default_prior,
    default_priors,
    priors_from_config,
)
from pushfit.fit.problem.problem import Problem, padded
from pushfit.fit.results.fits_along import FitsAlong
from pushfit.model import Pushes, as_float
from pushfit.parameters import SIGNED

# Groups of pushes that have something in common come in multiples of this: one compiled
# program serves several numbers of them.
GROUPS = 4
# Azimuths closer than this are one direction [rad].
SAME_AZIMUTH = np.radians(0.5)
# Sampled noise: the median is this share of the tallest height, a factor 12 either way
# at one in twenty.
SIGMA_SHARE, SIGMA_SD_LOG = 0.05, 1.5


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """A problem with what the arrays no longer say.

    Args:
        problem: Data, grasp, noise and priors.
        noise: Where the noise came from.
        rows: Row of the table of each unpadded column of the problem.
        is_calibrated: Whether stiffness comes out in N/m rather than sensor units/m.
        has_direction: Whether azimuths differ enough to ask for a direction.
        search: Best fits along θ_c, once they are known.
    """

    problem: Problem
    noise: Noise
    rows: tuple[int, ...]
    is_calibrated: bool
    has_direction: bool
    search: FitsAlong | None = None


def build_problem(table: PeakTable, config: GraspConfig) -> Setup:
    """Problem that a table poses under a configuration.

    Args:
        table: Peak heights; rows whose flags exclude them are left out.

    Raises:
        DataError: If no usable row is left, or the rows can show nothing.
        SettingsError: If the configuration asks for noise or units the table lacks, or
            leaves nothing to infer.
    """
    used = np.flatnonzero(table.is_used)
    if used.size == 0:
        raise DataError(
            f"{table.place}: all {table.n_pushes} pushes are flagged (saturated, "
            "clipped, in a gap or out of contact), so none is left to fit; look at the "
            "flags column",
            code="no_usable_push",
        )
    _check_informative(table, config)
    grasp = make_grasp(config, table.unit)
    calibrated = is_calibrated(config, table.unit)
    noise = choose_noise(table, config)
    has_direction = n_azimuths(table.alpha[used]) > 1
    tallest = max(float(np.max(np.abs(table.heights(c)[used]))) for c in table.channels)
    scale = tallest / (float(grasp.gain) * float(grasp.push_length))
    priors, fixed = priors_from_config(
        config, default_priors(None if calibrated else scale)
    )
    if not has_direction:
        # One azimuth: B is the stiffness along it, and an ellipse has no meaning.
        priors = {n: p for n, p in priors.items() if n not in SIGNED}
        fixed |= dict.fromkeys(SIGNED, 0.0)
    if config.grasp.preload[0] == "estimate":
        force = tallest / float(grasp.gain)
        priors.setdefault("F_0", Prior("lognormal", force, 1.0))
    else:
        priors.pop("F_0", None)
    if config.transition.sharpness == "auto":
        priors.setdefault("p", default_prior("p"))
    else:
        priors.pop("p", None)
    if not priors:
        raise SettingsError(
            "every parameter is fixed, so there is nothing to infer; leave one free in "
            "[parameters], or read off the model with `pushfit simulate`",
            code="nothing_free",
        )
    if noise.kind == "sampled":
        for name in table.channels:
            median = SIGMA_SHARE * float(np.max(np.abs(table.heights(name)[used])))
            priors[f"sigma_{name}"] = Prior("lognormal", median, SIGMA_SD_LOG)
    problem = Problem(
        **_rows(table, noise),
        grasp=grasp,
        priors=priors,
        fixed={name: as_float(value) for name, value in fixed.items()},
        channels=table.channels,
        names=sampling_names(priors, fixed),
        data_names=data_names(priors, fixed, grasp),
        likelihood="student_t" if config.noise.likelihood == "student_t" else "normal",
    )
    return Setup(
        problem=with_constraints(problem),
        noise=noise,
        rows=tuple(int(i) for i in used),
        is_calibrated=calibrated,
        has_direction=has_direction,
    )


def n_azimuths(alpha: Float[np.ndarray, " n"]) -> int:
    """Number of distinct azimuths modulo 180°, the period of the stiffness ellipse."""
    steps = np.round(np.mod(alpha, np.pi) / SAME_AZIMUTH)
    # The seam: 0° and 180° are the same axis.
    return int(np.unique(np.mod(steps, np.round(np.pi / SAME_AZIMUTH))).size)


def sampling_names(
    priors: Mapping[str, Prior], fixed: Mapping[str, float]
) -> tuple[str, ...]:
    """Names of the sampling coordinates: what data meet first, then the rest."""
    free = set(priors)
    names = []
    if {"K_sn", "K_dn"} <= free:
        names.append("ln_A")
    if {"K_st", "C_d"} <= free:
        names.append("ln_B")
        names += ["f1", "f2"] if "e1" in free else []
    else:
        names += ["e1", "e2"] if "e1" in free else []
    if "C_rr" in free:
        names.append("ln_C_rr")
    if {"K_sn", "K_dn"} & free:
        names.append("ln_r")
    if {"K_st", "C_d"} & free:
        names.append("ln_s")
    names += [f"ln_{n}" for n in ("L", "F_0", "p") if n in free]
    names += [f"ln_{n}" for n in priors if n.startswith("sigma_")]
    return tuple(names)


def _rows(table: PeakTable, noise: Noise) -> dict[str, Any]:
    """Fields of a problem that have an entry for every row, padded to their bucket."""
    used = table.is_used

    def stacked(
        values: Mapping[str, Float[np.ndarray, "*s n"]], fill: float
    ) -> Float[np.ndarray, "c *s m"]:
        rows = np.stack([values[name][..., used] for name in table.channels])
        return padded(rows, fill)

    shared = None
    if noise.shared:
        shared = stacked(noise.shared, 0.0)
        n_more = -shared.shape[1] % GROUPS
        shared = as_float(np.pad(shared, ((0, 0), (0, n_more), (0, 0))))
    theta, alpha = table.theta[used], table.alpha[used]
    mask = padded(np.ones((len(table.channels), theta.size)), 0.0) > 0
    return {
        "pushes": Pushes(padded(theta, 0.5), padded(alpha, 0.0)),
        "observed": stacked({c: table.heights(c) for c in table.channels}, 0.0),
        "sd": stacked(noise.sd, 0.0),
        "reference_sigma": stacked(noise.sigma, 1.0),
        "mask": jnp.asarray(mask),
        "shared": shared,
    }


def _check_informative(table: PeakTable, config: GraspConfig) -> None:
    """Refuse pushes at which the model says nothing of the contact.

    Args:
        table: Peak heights, of which at least one is used.

    Raises:
        DataError: If all heights of a channel are 0 (`no_height`), or all pushes go
            along the surface of a contact without a preload (`no_elevation`).
    """
    used = table.is_used
    for channel in table.channels:
        if not np.any(table.heights(channel)[used]):
            raise DataError(
                f"{table.place}: the column {channel} holds only zeros, which show no "
                "stiffness and no critical angle; push further or with a more "
                "sensitive sensor, until the heights rise above their noise, or leave "
                "the column out",
                code="no_height",
            )
    value, _ = config.grasp.preload
    if value == 0 and not np.any(table.theta[used]):
        raise DataError(
            f"{table.place}: all pushes go along the surface (θ = 0°), where a contact "
            "without a preload carries no force: they show neither A, B nor C_rr, and "
            "so no θ_c; push at several elevations, such as 15°, 30°, 45°, 60° and "
            "75°, or state [grasp] preload_n if the finger was pressed on before",
            code="no_elevation",
        )
