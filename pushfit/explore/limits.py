"""What pushes must never do, and where they may go at all.

The position node aborts on force; here a push that might need that is not asked for.
Excluded: the section of `grasp.toml` with them (`pushfit.config.explore`).
"""

from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from pydantic import ValidationError

from pushfit.arguments import checked
from pushfit.config import GraspConfig
from pushfit.config.explore import ExploreSection
from pushfit.config.file import as_toml, problems
from pushfit.config.section import ELEVATIONS, Elevations, Positive
from pushfit.errors import ConfigError
from pushfit.mechanics.directions import is_whole

# Chance, by the present belief, that a push exceeds the force limit or lifts off.
TOLERATED = 0.01
# Rounding of angles [rad], of places [mm] and of counts of steps.
ROUNDING = 1e-9
# Lengths tried, as shares of the push length, while longer ones are not known safe.
SHARES = (1.0, 0.5, 0.25, 0.1, 0.05)
Angle = float | Float[np.ndarray, " k"]


def _next_step(name: str | None) -> str:
    """What to give in place of a limit that means nothing."""
    field = Limits.model_fields.get(name or "")
    if field is None:
        return ""
    default = "" if field.default is None else f" for {as_toml(field.default)}"
    return f"; give another value, or leave it out{default}"


class Limits(ExploreSection):
    """Limits of an exploration: these, and by the same names the keys of `[explore]`.

    Args:
        theta_deg: Lowest and highest elevation of the finger.
        alpha_deg: Lowest and highest azimuth; None takes `[reach]` of the settings.
        force: Largest contact force, the preload included; None for no limit [N, or
            the unit of uncalibrated heights].
        theta_step_deg: Step between elevations.
        alpha_step_deg: Step between azimuths.
        workspace_mm: Box that the fingertip stays in, (low, high) along x, y and z
            from the contact; None for no box [mm].
        rest_s: Least rest before a push and after it [s].
        baseline_sigmas: Change of the reading at rest [standard deviations].
        reference_first: Pushes before the first that repeats one.
        reference_every: Pushes before another one; 0 for never.
        reference_sigmas: Change of a repeated height [standard deviations].
        stall_share: Share of a push that may be missing where it ends.
        stale_s: Longest silence of the sensor [s].
        max_failures: Failed pushes in a row that end the exploration.
        max_pushes: Cap on all motions, failed ones included.

    Raises:
        ConfigError: One of them means nothing.
    """

    theta_deg: Elevations = ELEVATIONS
    alpha_deg: tuple[float, float] | None = None
    force: Positive | None = None

    def __init__(self, **stated: Any) -> None:
        """Check what is stated."""
        try:
            super().__init__(**stated)
        except ValidationError as error:
            first = next(problems(error, stated, "limits", model=Limits))
            raise ConfigError(
                first.message + _next_step(first.column), code="limits"
            ) from error
        first, last = self.alpha_deg or (0.0, 180.0)
        if not first <= last <= first + 360.0:
            raise ConfigError(
                f"limits: alpha {first:g}° to {last:g}° is no range of azimuths; give "
                "low <= high <= low + 360",
                code="limits",
            )

    @classmethod
    @checked
    def of(cls, config: GraspConfig, **stated: Any) -> "Limits":
        """Limits as `[explore]` and `[reach]` of the settings have them.

        Args:
            config: Settings whose sections are taken.
            stated: Those that the file does not tell, by name, or tells otherwise.
        """
        of_file = {"theta_deg": config.reach.theta_deg} | config.explore.model_dump()
        return cls(**of_file | stated)

    def candidates(
        self, *, azimuths: tuple[float, float] | None, reference_alpha: float
    ) -> Float[np.ndarray, "k 2"]:
        """Directions that a finger could push in.

        Args:
            azimuths: Reach in azimuth, to be explored; None keeps to one [rad].
            reference_alpha: That one [rad].

        Returns:
            Rows of elevation and azimuth [rad].
        """
        low, high = self.theta_deg
        n = int((high - low) / self.theta_step_deg + ROUNDING) + 1
        theta = np.radians(low + self.theta_step_deg * np.arange(n))
        alpha = np.array([reference_alpha])
        if azimuths is not None:
            first, last = azimuths
            # 0° and 180° are one axis, and it is pushed along once.
            has_all = is_whole(azimuths)
            last = first + np.pi if has_all else last
            steps = np.degrees(last - first) / self.alpha_step_deg
            steps = max(int(steps + ROUNDING), 1)
            alpha = np.linspace(first, last, steps + 1)
            alpha = alpha[:-1] if has_all else alpha
        pairs = np.stack(np.meshgrid(theta, alpha, indexing="ij"), axis=-1)
        return pairs.reshape(-1, 2)

    def azimuths(self, config: GraspConfig) -> tuple[float, float]:
        """Reach in azimuth [rad]."""
        low, high = np.radians(self.alpha_deg or config.reach.alpha_deg)
        return float(low), float(high)

    def first_azimuth(self, config: GraspConfig) -> float:
        """Azimuth of θ_c before any push: as stated, or across the supports [rad]."""
        stated = config.grasp.reference_alpha_deg
        low, high = self.azimuths(config)
        across = np.pi / 2 if low <= np.pi / 2 <= high else (low + high) / 2
        return float(across if stated is None else np.radians(stated))

    def allow(
        self,
        theta: float,
        alpha: float,
        *,
        length: float,
        azimuths: tuple[float, float],
    ) -> bool:
        """Whether the finger may push in a direction, whatever the forces.

        Args:
            theta: Elevation [rad].
            alpha: Azimuth [rad].
            length: Length of the push [m].
            azimuths: Reach in azimuth [rad].
        """
        one = np.array([[theta, alpha]])
        is_reached = self.reach(one, azimuths=azimuths)
        return bool(np.all(is_reached & self.holds(one, length=length)))

    def reach(
        self, directions: Float[np.ndarray, "k 2"], *, azimuths: tuple[float, float]
    ) -> Bool[np.ndarray, " k"]:
        """Which directions the finger reaches [rad]."""
        theta, alpha = directions.T
        low, high = np.radians(self.theta_deg)
        first, last = azimuths
        past = np.mod(alpha - first + ROUNDING, 2 * np.pi)
        is_within = (low - ROUNDING <= theta) & (theta <= high + ROUNDING)
        return is_within & (past <= last - first + 2 * ROUNDING)

    def holds(
        self, directions: Float[np.ndarray, "k 2"], *, length: float
    ) -> Bool[np.ndarray, " k"]:
        """Which pushes of a length [m] end in the workspace."""
        if self.workspace_mm is None:
            return np.ones(len(directions), dtype=bool)
        theta, alpha = directions.T
        tip = 1e3 * tip_displacement(theta, alpha, length)
        least, most = np.transpose(self.workspace_mm)[..., None]
        return np.all((least - ROUNDING <= tip) & (tip <= most + ROUNDING), axis=0)


def tip_displacement(
    theta: Angle, alpha: Angle, length: float
) -> Float[np.ndarray, "3 ..."]:
    """Where a push takes the fingertip, from the contact.

        OP = S_p (cos θ cos α, cos θ sin α, sin θ)

    Args:
        theta: Elevation [rad].
        alpha: Azimuth [rad].
        length: S_p [m].

    Returns:
        x along the supports, y across them, z into the object [m].
    """
    direction = [np.cos(theta) * np.cos(alpha), np.cos(theta) * np.sin(alpha)]
    return length * np.array([*direction, np.sin(theta)])
