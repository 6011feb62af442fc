"""Coordinates: their inverse, their volume, and what stays fixed along them."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pushfit.mechanics import coordinates as module
from pushfit.mechanics.coordinates import Coordinates
from pushfit.model import Parameters
from pushfit.model import forward as eager_forward
from tests.oracle import paper
from tests.problems import CASES, PLAIN, TILTED_ELLIPSE, paper_parameters, sweep
from tests.tolerances import EXACT

# A determinant of eight columns, each entry of a derivative being a few roundings.
DETERMINANT = 1e-10

relaxed = settings(max_examples=40)
coordinates = eqx.filter_jit(module.coordinates)
parameters = eqx.filter_jit(module.parameters)
log_volume = eqx.filter_jit(module.log_volume)
forward = eqx.filter_jit(eager_forward)

logs = st.floats(-7, 7)
# Axes of the ellipse up to a ratio of e^5 = 150 apart, either way.
shapes = st.floats(-3.5, 3.5)
anywhere = st.builds(
    lambda six, e: np.array([*six, *e]),
    st.lists(logs, min_size=6, max_size=6),
    st.lists(shapes, min_size=2, max_size=2),
)


def values(container: eqx.Module) -> np.ndarray:
    return np.array(jax.tree.leaves(container))


@relaxed
@given(point=anywhere)
def test_parameters_survive_the_round_trip(point):
    params = Parameters(*np.exp(point[:6]), *point[6:])
    back = parameters(coordinates(params))
    # Rounding of a log near 10 is 10 eps, and the exponential makes it relative.
    np.testing.assert_allclose(values(back), values(params), rtol=EXACT, atol=EXACT)


@relaxed
@given(point=anywhere)
def test_coordinates_survive_the_round_trip(point):
    ln_A, ln_B, ln_C_rr, ln_r, ln_s, ln_L, f1, f2 = point
    coords = Coordinates(ln_A, ln_B, ln_C_rr, f1, f2, ln_r, ln_s, ln_L)
    back = coordinates(parameters(coords))
    # f loses what an s of e^7 gains: e = f + O(s f) is divided by 1 + s again.
    np.testing.assert_allclose(values(back), values(coords), rtol=EXACT, atol=EXACT)


@pytest.mark.parametrize("name", CASES)
def test_the_first_coordinates_are_the_series_springs(name):
    case = CASES[name]
    coords = coordinates(case.params)
    axes = np.linalg.eigvalsh(paper.series_tensor(paper.numbers(case.params)))
    anisotropy = math.hypot(float(coords.f1), float(coords.f2))
    np.testing.assert_allclose(np.exp(coords.ln_A), case.A, rtol=EXACT)
    np.testing.assert_allclose(np.exp(coords.ln_B), case.B, rtol=EXACT)
    np.testing.assert_allclose(
        anisotropy, math.log(axes[1] / axes[0]), rtol=0, atol=EXACT
    )


def test_isotropic_stiffnesses_are_the_printed_inverse():
    """K_sn = A (1 + r), K_dn = A (1 + 1/r), K_st = B (1 + s), C_d = K_st L²/s."""
    coords = Coordinates(*np.log([400, 100, 0.25]), 0, 0, *np.log([2, 2, 0.04]))
    expected = [1200, 600, 300, 0.25, 0.24, 0.04, 0, 0]
    np.testing.assert_allclose(values(parameters(coords)), expected, rtol=EXACT)


@relaxed
@given(fibre=st.lists(st.floats(-3, 3), min_size=3, max_size=3))
def test_heights_stay_where_they_are_along_the_fibre(fibre):
    """Only the first five coordinates meet linear forces, Eqs. (6)-(10)."""
    start = coordinates(paper_parameters(**TILTED_ELLIPSE))
    moved = eqx.tree_at(
        lambda c: (c.ln_r, c.ln_s, c.ln_L), start, tuple(map(jnp.asarray, fibre))
    )
    pushes = sweep([10.0, 40.0, 75.0], [0.0, 50.0, 100.0])
    heights = [forward(parameters(c), pushes, PLAIN).height for c in (start, moved)]
    np.testing.assert_allclose(heights[0], heights[1], rtol=EXACT)


def log_parameters(point: jax.Array) -> jax.Array:
    """Six logs, e1 and e2 at coordinates in the order of their fields."""
    leaves = jnp.stack(jax.tree.leaves(module.parameters(Coordinates(*point))))
    return jnp.concatenate([jnp.log(leaves[:6]), leaves[6:]])


jacobian = jax.jit(jax.jacfwd(log_parameters))


@pytest.mark.parametrize("s", [1e-3, 0.3, 2.0, 1e3])
@pytest.mark.parametrize("f", [(0.0, 0.0), (1e-5, 0.0), (0.02, -0.03), (1.5, -2.0)])
def test_the_volume_is_the_determinant_of_the_map(s, f):
    point = jnp.array([6.0, 4.6, -1.4, *f, 0.7, math.log(s), -3.2])
    _, log_det = np.linalg.slogdet(jacobian(point))
    volume = log_volume(Coordinates(*point))
    np.testing.assert_allclose(volume, log_det, rtol=0, atol=DETERMINANT)


def test_the_six_logs_alone_keep_their_volume():
    """Without an ellipse a prior on the logs needs no Jacobian."""
    point = jnp.array([6.0, 4.6, -1.4, 0.0, 0.0, 0.7, 0.5, -3.2])
    six = np.array([0, 1, 2, 5, 6, 7])
    block = np.asarray(jacobian(point))[:6][:, six]
    np.testing.assert_allclose(abs(np.linalg.det(block)), 1, rtol=EXACT)


@pytest.mark.parametrize("s", [0.01, 2.0, 50.0])
def test_a_nearly_round_ellipse_stretches_both_shape_numbers_alike(s):
    """e = (1 + s) f near the circle: volume (1 + s)², also in its slope."""
    coords = Coordinates(0, 0, 0, 0, 0, 0, math.log(s), 0)
    volume, slope = jax.value_and_grad(module.log_volume)(coords)
    np.testing.assert_allclose(volume, 2 * math.log1p(s), rtol=EXACT)
    np.testing.assert_allclose(slope.ln_s, 2 * s / (1 + s), rtol=EXACT)
    assert (float(slope.f1), float(slope.f2)) == (0.0, 0.0)
