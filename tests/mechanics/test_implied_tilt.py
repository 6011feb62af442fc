"""The tilt that linear forces imply, against Eqs. (3)-(5), (7) and (9)."""

import equinox as eqx
import numpy as np

from pushfit.mechanics.linear import implied_tilt
from pushfit.model import forces
from tests.problems import CASES, paper_parameters, sweep
from tests.tolerances import EXACT

tilt_of = eqx.filter_jit(implied_tilt)


def torque_and_tilt(name):
    """T = |F_pt| L and γ of every push of a case."""
    case = CASES[name]
    pushes = case.pushes()
    force = forces(case.params, pushes, case.grasp)
    torque = case.params.L * np.hypot(force.tangential_x, force.tangential_y)
    return case, pushes, torque, tilt_of(case.params, pushes, case.grasp)


def test_the_unrolled_torque_bends_the_contact():
    """Eq. (9), above the critical angle of 45°, with and without an ellipse."""
    for name in ("paper", "ellipse"):
        case, pushes, torque, tilt = torque_and_tilt(name)
        # The stiffest azimuth of both ends to roll at 50.2°.
        unrolled = np.asarray(pushes.theta) > np.radians(51)
        bending = case.params.C_d * tilt
        np.testing.assert_allclose(torque[unrolled], bending[unrolled], rtol=EXACT)


def test_the_rolled_torque_is_rolling_friction():
    """Eq. (7), and the tilt is larger than this torque could bend."""
    case, pushes, torque, tilt = torque_and_tilt("paper")
    rolled = np.asarray(pushes.theta) < np.radians(44)
    p = case.params
    friction = p.C_rr * case.A * case.grasp.push_length * np.sin(pushes.theta) * p.L
    np.testing.assert_allclose(torque[rolled], friction[rolled], rtol=EXACT)
    assert (p.C_d * tilt[rolled] > torque[rolled]).all()


def test_the_tilt_of_a_free_roll_is_the_push_over_the_lever():
    """Without friction the support stays at rest: γ = S_p cos θ / L."""
    pushes = sweep([0.0, 30.0, 60.0], [40.0])
    tilt = tilt_of(paper_parameters(C_rr=0.0), pushes, CASES["paper"].grasp)
    np.testing.assert_allclose(tilt, 0.125 * np.cos(pushes.theta), rtol=EXACT)
