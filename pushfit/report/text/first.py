"""What is known of θ_c before the posterior is: a line for who waits.

Excluded: the report of the result (`pushfit.report.text.result`).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pushfit.fit.identify.fitted import Fitted, Listener
from pushfit.fit.problem.setup import Setup
from pushfit.fit.results import FitResult, LikelihoodProfile
from pushfit.fit.results.search import Search
from pushfit.report.strings import format_angle, format_range, join_or

# Optima this much worse are no answer [Δχ²]; those this near are the same one [deg].
ALIKE, APART = 2.7, 2.0


def look_line(search: Search, mechanics: str) -> str | None:
    """θ_c near the best fit, before anything is polished; None where it has none."""
    best = int(np.argmin(search.curve.chi_square))
    if search.quantity != "theta_c" or not np.isfinite(search.curve.chi_square[best]):
        return None
    angle = float(np.degrees(search.curve.values[best]))
    alpha = np.degrees(search.reference_alpha)
    place = f"θ_c near {angle:.0f}° at α = {alpha:g}°"
    return f"first look by {mechanics} mechanics: {place}"


def fit_line(fit: FitResult, reference_alpha_deg: float, mechanics: str) -> str:
    """θ_c [deg] of the best fit, and of others that fit nearly as well."""
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
    """θ_c as the likelihood confines it."""
    pieces = join_or([format_range(*piece, "deg") for piece in profile.pieces])
    level = f"({100 * profile.prob:g} %, {mechanics})"
    return f"likelihood set of θ_c {level}: {pieces or 'empty'}"


@dataclass(frozen=True, slots=True, kw_only=True)
class First(Listener):
    """Says of θ_c what is known already, for `identify_table`."""

    tell: Callable[[str], None]

    def searched(self, setup: Setup) -> None:
        """Say where the likelihood is highest."""
        if setup.search is None:
            return
        line = look_line(setup.search, setup.problem.grasp.mechanics)
        if line is not None:
            self.tell(line)

    def fitted(self, fitted: Fitted) -> None:
        """Say the best fit."""
        if fitted.fit.modes:
            alpha = float(np.degrees(fitted.reference_alpha))
            self.tell(fit_line(fitted.fit, alpha, _mechanics(fitted)))

    def confined(self, fitted: Fitted, theta_c: LikelihoodProfile | None) -> None:
        """Say the set."""
        if theta_c is not None:
            self.tell(set_line(theta_c, _mechanics(fitted)))


def _mechanics(fitted: Fitted) -> str:
    return fitted.setup.problem.grasp.mechanics
