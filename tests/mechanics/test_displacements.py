"""The parts of a push against Eqs. (1)-(5), (7) and (9), which no force shows."""

import equinox as eqx
import numpy as np
import pytest

from pushfit.mechanics import displacements as module
from pushfit.model import forces
from tests.oracle import paper
from tests.problems import CASES, paper_parameters, sweep
from tests.tolerances import EXACT

every_case = pytest.mark.parametrize("name", CASES)
displacements = eqx.filter_jit(module.displacements)


def split(name):
    case = CASES[name]
    pushes = case.pushes()
    return case, pushes, displacements(case.params, pushes, case.grasp)


@every_case
def test_the_parts_add_up_to_the_push(name):
    """Eqs. (2), (3), with S_dt = 0."""
    case, pushes, parts = split(name)
    S_p = case.grasp.push_length
    azimuth = np.array([np.cos(pushes.alpha), np.sin(pushes.alpha)])
    S_pt = azimuth * np.array(S_p * np.cos(pushes.theta))
    normal = parts.S_sn + parts.S_dn
    np.testing.assert_allclose(normal, S_p * np.sin(pushes.theta), rtol=EXACT)
    np.testing.assert_allclose(
        parts.S_st + parts.S_rt, S_pt, rtol=EXACT, atol=EXACT * float(S_p)
    )


@every_case
def test_every_spring_carries_the_force_of_the_push(name):
    """Eqs. (1), (4), (5): K_sn S_sn = K_dn S_dn = F_pn, K S_st = F_pt, T = F_pt L."""
    case, pushes, parts = split(name)
    p = paper.numbers(case.params)
    force = forces(case.params, pushes, case.grasp)
    pairs = zip(pushes.theta, pushes.alpha, strict=True)
    printed = [paper.force(case.params, case.grasp, pair) for pair in pairs]
    F_pn = np.array([normal for normal, _ in printed]) - float(case.grasp.preload)
    F_pt = np.array([tangential for _, tangential in printed]).T
    np.testing.assert_allclose(p.K_sn * parts.S_sn, F_pn, rtol=EXACT, atol=EXACT)
    np.testing.assert_allclose(p.K_dn * parts.S_dn, F_pn, rtol=EXACT, atol=EXACT)
    carried = paper.support_tensor(p) @ np.asarray(parts.S_st)
    np.testing.assert_allclose(carried, F_pt, rtol=EXACT, atol=EXACT)
    size = np.hypot(force.tangential_x, force.tangential_y)
    np.testing.assert_allclose(parts.torque, size * p.L, rtol=EXACT)


def test_the_unrolled_torque_bends_the_contact():
    """Eq. (9), above the critical angle of 45°, with and without an ellipse."""
    for name in ("paper", "ellipse"):
        case, pushes, parts = split(name)
        # The stiffest azimuth of both ends to roll at 50.2°.
        unrolled = np.asarray(pushes.theta) > np.radians(51)
        bending = case.params.C_d * parts.tilt
        np.testing.assert_allclose(
            parts.torque[unrolled], bending[unrolled], rtol=EXACT
        )


def test_the_rolled_torque_is_rolling_friction():
    """Eq. (7), and the tilt is larger than this torque could bend."""
    case, pushes, parts = split("paper")
    rolled = np.asarray(pushes.theta) < np.radians(44)
    p = case.params
    friction = p.C_rr * case.A * case.grasp.push_length * np.sin(pushes.theta) * p.L
    np.testing.assert_allclose(parts.torque[rolled], friction[rolled], rtol=EXACT)
    assert (p.C_d * parts.tilt[rolled] > parts.torque[rolled]).all()


def test_the_tilt_of_a_free_roll_is_the_push_over_the_lever():
    """Without friction the support stays at rest: γ = S_p cos θ / L."""
    pushes = sweep([0.0, 30.0, 60.0], [40.0])
    params = paper_parameters(C_rr=0.0)
    tilt = displacements(params, pushes, CASES["paper"].grasp).tilt
    np.testing.assert_allclose(tilt, 0.125 * np.cos(pushes.theta), rtol=EXACT)
