"""What is known of θ_c before the posterior is: a line for who waits.

Excluded: the report of the result (`pushfit.report.text.result`).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from pushfit.fit.identify.fitted import Fitted, Listener
from pushfit.fit.problem.setup import Setup
from pushfit.fit.results import LikelihoodProfile
from pushfit.report.strings import format_angle, format_range, join_or

# Optima this much worse are no answer [Δχ²]; those this near are the same one [deg].
ALIKE, APART = 2.7, 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FirstLook(Listener):
    """Says of θ_c what is known already, for `identify_table`."""

    tell: Callable[[str], None]

    def searched(self, setup: Setup) -> None:
        """Say where the likelihood is highest, before anything is polished."""
        search = setup.search
        if search is None or search.quantity != "theta_c":
            return
        best = int(np.argmin(search.curve.chi_square))
        if np.isfinite(search.curve.chi_square[best]):
            angle = np.degrees(search.curve.values[best])
            by = f"first look by {_mechanics(setup)} mechanics"
            self.tell(f"{by}: θ_c near {angle:.0f}°{_at(search.reference_alpha)}")

    def fitted(self, fitted: Fitted) -> None:
        """Say θ_c of the best fit, and of others that fit nearly as well."""
        best, *others = fitted.fit.modes
        by = f"best fit by {_mechanics(fitted.setup)} mechanics"
        if best.theta_c_deg is None:
            self.tell(f"{by}: no θ_c, the contact never rolls")
            return
        near = [
            format_angle(mode.theta_c_deg, spread=1.0)
            for mode in others
            if mode.theta_c_deg is not None
            and mode.chi_square < best.chi_square + ALIKE
            and abs(mode.theta_c_deg - best.theta_c_deg) > APART
        ]
        angle = format_angle(best.theta_c_deg, spread=1.0)
        also = f"; {join_or(near)} fits nearly as well" if near else ""
        self.tell(f"{by}: θ_c = {angle}{_at(fitted.reference_alpha)}{also}")

    def confined(self, fitted: Fitted, theta_c: LikelihoodProfile | None) -> None:
        """Say θ_c as the likelihood confines it."""
        if theta_c is not None:
            pieces = join_or([format_range(*piece, "deg") for piece in theta_c.pieces])
            level = f"({100 * theta_c.prob:g} %, {_mechanics(fitted.setup)})"
            is_none = fitted.fit.modes[0].theta_c_deg is None
            where = ", where the contact rolls" if is_none else ""
            self.tell(f"likelihood set of θ_c {level}{where}: {pieces or 'empty'}")


def _at(alpha: float) -> str:
    return f" at α = {np.degrees(alpha):g}°"


def _mechanics(setup: Setup) -> str:
    return setup.problem.grasp.mechanics
