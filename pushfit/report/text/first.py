"""What is known of θ_c before the posterior is: a line for who waits."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from pushfit.fit.fitted import Fitted
from pushfit.fit.results import FitResult, LikelihoodProfile
from pushfit.report.strings import format_angle, format_range, join_or

# Optima this much worse are no answer [Δχ²]; those this near are the same one [deg].
ALIKE, APART = 2.7, 2.0


def fit_line(fit: FitResult, reference_alpha_deg: float, mechanics: str) -> str:
    """θ_c of the best fit, and of others that fit nearly as well.

    Args:
        fit: Least squares.
        reference_alpha_deg: Azimuth of θ_c [deg].
        mechanics: By which it is.
    """
    best, *others = fit.modes
    if best.theta_c_deg is None:
        return f"best fit by {mechanics} mechanics: no θ_c, the contact never rolls"
    near = [
        format_angle(mode.theta_c_deg, spread=1.0)
        for mode in others
        if mode.theta_c_deg is not None
        and mode.chi_square < best.chi_square + ALIKE
        and abs(mode.theta_c_deg - best.theta_c_deg) > APART
    ]
    angle = format_angle(best.theta_c_deg, spread=1.0)
    also = f"; {join_or(near)} fits nearly as well" if near else ""
    place = f"θ_c = {angle} at α = {reference_alpha_deg:g}°"
    return f"best fit by {mechanics} mechanics: {place}{also}"


def set_line(profile: LikelihoodProfile, mechanics: str) -> str:
    """θ_c as the likelihood confines it.

    Args:
        profile: Profile likelihood of θ_c.
        mechanics: By which it is.
    """
    pieces = join_or([format_range(*piece, "deg") for piece in profile.pieces])
    level = f"({100 * profile.prob:g} %, {mechanics})"
    return f"likelihood set of θ_c {level}: {pieces or 'empty'}"


@dataclass(frozen=True, slots=True, kw_only=True)
class First:
    """Says of θ_c what is known already, for `identify_table`.

    Args:
        tell: Shows one line.
    """

    tell: Callable[[str], None]

    def __call__(
        self, fitted: Fitted, profiles: Mapping[str, LikelihoodProfile]
    ) -> None:
        """Say the fit, and once there are profiles, the set."""
        mechanics = fitted.setup.problem.grasp.mechanics
        if "theta_c" in profiles:
            self.tell(set_line(profiles["theta_c"], mechanics))
        elif not profiles and fitted.fit.modes:
            alpha = float(np.degrees(fitted.reference_alpha))
            self.tell(fit_line(fitted.fit, alpha, mechanics))
