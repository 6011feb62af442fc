"""A rigid object between fingertips at rest, by SciPy alone.

`Slab` is written from positions, contact points and balances of forces and moments; it
knows nothing of the derivation in `pushfit.mechanics.tilting.one_support`. It is of
thickness L; round fingertips move without turning and do not slip on it.
`planar_forces` solves the scalar equilibrium of tips without a radius.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy import optimize
from scipy.spatial.transform import Rotation

RESIDUAL = 1e-11  # of forces in newtons and lengths in millimetres
N_STEPS = 20  # in which a push grows, so that the first equilibrium is the one found


@dataclass(frozen=True, kw_only=True)
class Slab:
    """Springs and geometry of one grasp.

    Args:
        A: Normal spring of the support [N/m].
        K: Tangential spring of the support [N/m].
        C_d: Torsional spring of the contact [N·m/rad].
        C_rr: Rolling friction [-].
        L: Thickness [m].
        F_0: Force before the push [N].
        radius: Of both fingertips [m].
    """

    A: float = 400.0
    K: float = 300.0
    C_d: float = 0.24
    C_rr: float = 0.25
    L: float = 0.04
    F_0: float = 0.0
    radius: float = 0.0

    def pushed(self, theta: float, push: float) -> tuple[float, float, float]:
        """F_n and F_t [N] and the tilt [rad] of a push in the plane of the tilt."""
        state = np.array([0.0, 0.0, 0.0, 0.0, self.F_0])
        for part in np.linspace(0, 1, N_STEPS + 1)[1:]:
            found = optimize.root(
                self._unbalanced, state, (theta, part * push), tol=1e-14
            )
            state = found.x
        assert np.max(np.abs(found.fun)) < RESIDUAL, found.message
        return state[4], state[3], state[2]

    def critical_angle(self, push: float) -> float:
        """Elevation at which the deformed contact bears just what friction does."""
        free = Slab(**{**vars(self), "C_rr": 1e6})

        def excess(theta):
            normal, tangential, tilt = free.pushed(theta, push)
            across = normal * math.cos(tilt) - tangential * math.sin(tilt)
            return free.C_d * tilt - self.C_rr * self.L * across

        return optimize.brentq(excess, 0.15, 1.5, xtol=1e-10)

    def _unbalanced(self, state, theta, push):
        """What is out of place [mm] and what is not borne [N], of five unknowns.

        Deflection of the support aside and down [mm], tilt, and the force on the
        object by the pushing tip, aside and down.
        """
        aside, down, tilt, along, into = state
        normal = np.array([math.sin(tilt), math.cos(tilt)])
        face = np.array([math.cos(tilt), -math.sin(tilt)])
        # The support touches where its own surface faces the slab; it has rolled there.
        support = np.array([aside * 1e-3, -down * 1e-3 - self.radius])
        below = support + self.radius * normal
        origin = below - self.radius * tilt * face
        above = origin + self.L * normal - self.radius * tilt * face
        tip = np.array([0.0, self.L + self.radius])
        tip += push * np.array([math.cos(theta), -math.sin(theta)])
        gap = above + self.radius * normal - tip
        force = np.array([along, -into])
        held = np.array([-self.K * aside * 1e-3, self.F_0 + self.A * down * 1e-3])
        across = -force @ normal
        torque = min(self.C_d * tilt, self.C_rr * self.L * across)
        arm = above - below
        # Clockwise moments about the support contact.
        moment = arm[1] * force[0] - arm[0] * force[1] - torque
        return [*(1e3 * gap), *(force + held), moment / self.L]

    def leaned(self, K, theta, push, alpha):
        """F_n and the two parts of F_t of an object that does not roll.

        The energy of the springs is least; any direction of the lean is tried.

        Args:
            K: Tangential stiffness of the support [N/m].
            theta: Elevation [rad].
            push: Push length [m].
            alpha: Azimuth [rad].
        """
        goal = push * np.array(
            [
                math.cos(theta) * math.cos(alpha),
                math.cos(theta) * math.sin(alpha),
                -math.sin(theta),
            ]
        )

        def deflection(lean):
            size = math.hypot(*lean)
            toward = np.array([*lean, 0.0]) / (size or 1.0)
            turn = Rotation.from_rotvec(size * np.cross([0, 0, 1], toward))
            normal = turn.apply([0, 0, 1])
            rolled = self.radius * size * turn.apply(toward)
            # Tip above slab above support, from centre to centre.
            centres = (self.L + 2 * self.radius) * normal - 2 * rolled
            start = np.array([0.0, 0.0, self.L + 2 * self.radius])
            return goal - (centres - start)

        def energy(lean):
            x, y, z = deflection(lean)
            side = np.array([x, y])
            springs = side @ K @ side + self.A * z**2 + self.C_d * (lean @ lean)
            return 1e3 * (springs / 2 - self.F_0 * z)

        best = optimize.minimize(
            energy,
            np.array([1e-3, 1e-3]),
            method="Nelder-Mead",
            options={"xatol": 1e-10, "fatol": 1e-15, "maxiter": 4000},
        )
        x, y, z = deflection(best.x)
        return np.array([self.F_0 - self.A * z, *(K @ np.array([x, y]))])


def planar_forces(p, grasp, theta):
    """F_n and F_t of one push, by brentq on each argument of the minimum."""
    F_0, S_p = float(grasp.preload), float(grasp.push_length)
    series = p.K_sn * p.K_dn / (p.K_sn + p.K_dn)

    def parts(tilt):
        sinking = p.L * (1 - math.cos(tilt))
        normal = max(F_0 + series * (S_p * math.sin(theta) - sinking), 0.0)
        reach = S_p * math.cos(theta) - p.L * math.sin(tilt)
        return normal, p.K_st * reach

    def balance(tilt, torque):
        normal, tangential = parts(tilt)
        across = normal * math.cos(tilt) - tangential * math.sin(tilt)
        moment = tangential * math.cos(tilt) + normal * math.sin(tilt)
        return moment * p.L - torque(tilt, across)

    def solved(torque):
        # Of several equilibria a push that grows from nothing reaches the first.
        grid = np.linspace(0, 1.4, 600)
        first = next(i for i, tilt in enumerate(grid) if balance(tilt, torque) < 0)
        ends = grid[first - 1], grid[first]
        return parts(optimize.brentq(balance, *ends, (torque,), xtol=1e-15, rtol=1e-14))

    def elastic(tilt, across):
        return p.C_d * tilt

    def rolling(tilt, across):
        return p.C_rr * p.L * across

    if math.isinf(grasp.sharpness):
        return solved(lambda *state: min(elastic(*state), rolling(*state)))
    unrolled = solved(elastic)[1]
    # A limit beyond what the support alone could pull is met without any tilt.
    beyond = p.C_rr * (F_0 + series * S_p * math.sin(theta))
    is_reached = beyond < p.K_st * S_p * math.cos(theta)
    rolled = solved(rolling)[1] if is_reached else beyond
    power = grasp.sharpness
    force = min(unrolled, rolled)
    if force > 0:
        force = (unrolled**-power + rolled**-power) ** (-1 / power)
    sine = (S_p * math.cos(theta) - force / p.K_st) / p.L
    return parts(math.asin(sine))[0], force
