"""Functions that are safe where their textbook form is not."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pushfit.mechanics.numerics import (
    SERIES_LIMIT,
    asinhc,
    expm1c,
    lean_factors,
    log1pc,
    norm2,
    positive_part,
    sine_versine,
    sinhc,
    softclip,
    softmin,
)
from tests.tolerances import DIFFERENCE, FEW_OPERATIONS

# Squares below the smallest float are lost: lengths under this are 0.
UNDERFLOW = 1e-150

STEP = np.finfo(float).eps ** (1 / 3)

# The first example compiles, which no deadline should judge.
relaxed = settings(deadline=None, max_examples=30)

positive = st.floats(1e-6, 1e6).map(jnp.float64)
signed = st.floats(-1e6, 1e6).map(jnp.float64)
sharpness = st.sampled_from([1.0, 2.0, 7.5, 40.0])


@relaxed
@given(a=positive, b=positive, p=sharpness)
def test_soft_minimum_is_the_printed_formula(a, b, p):
    # The printed powers overflow unless the smaller argument is scaled out.
    scale = min(a, b)
    printed = scale * ((a / scale) ** -p + (b / scale) ** -p) ** (-1 / p)
    np.testing.assert_allclose(softmin(a, b, p), printed, rtol=FEW_OPERATIONS)


@relaxed
@given(a=positive, b=positive, p=sharpness)
def test_soft_minimum_is_symmetric_and_between_its_bounds(a, b, p):
    value = float(softmin(a, b, p))
    assert value == float(softmin(b, a, p))
    assert 2 ** (-1 / p) * min(a, b) * (1 - FEW_OPERATIONS) <= value <= min(a, b)


@relaxed
@given(a=positive, b=positive)
def test_soft_minimum_approaches_the_minimum(a, b):
    """Its relative gap is at most ln 2 / p."""
    p = 1e6
    np.testing.assert_allclose(softmin(a, b, p), min(a, b), rtol=np.log(2) / p)
    assert float(softmin(a, b, np.inf)) == min(a, b)


@pytest.mark.parametrize("p", [1.0, 3.5, 20.0])
def test_both_arguments_share_the_gradient_at_the_tie(p):
    """By symmetry and homogeneity of degree 1, each gets half of 2^(-1/p)."""
    gradient = jax.grad(softmin, argnums=(0, 1))(3.0, 3.0, p)
    np.testing.assert_allclose(gradient, [2 ** (-1 / p - 1)] * 2, rtol=FEW_OPERATIONS)


@pytest.mark.parametrize("p", [2.0, 3.5, 20.0, np.inf])
def test_soft_minimum_follows_its_zero_argument(p):
    value, gradient = jax.value_and_grad(softmin, argnums=(0, 1))(0.0, 2.0, p)
    assert float(value) == 0.0
    np.testing.assert_array_equal(gradient, [1.0, 0.0])


@pytest.mark.parametrize("p", [2.0, 3.5, np.inf])
def test_soft_minimum_is_finite_at_two_zeros(p):
    value, gradient = jax.value_and_grad(softmin, argnums=(0, 1))(0.0, 0.0, p)
    assert float(value) == 0.0
    assert np.isfinite(gradient).all()


@pytest.mark.parametrize(
    ("ratio", "p"),
    [
        (0.3, 0.5),
        (0.3, 1.0),
        (0.3, 4.0),
        (0.9, 4.0),
        (0.9, 40.0),
        (1.0, 4.0),
        (1.0, 1e3),
    ],
)
def test_slope_in_the_sharpness_is_that_of_the_printed_formula(ratio, p):
    """In ln p, as it is fitted; differences of the formula in extended precision."""

    def printed(ln_p):
        power, one = np.exp(ln_p), np.longdouble(1)
        return (np.longdouble(ratio) ** -power + one) ** (-1 / power)

    ln_p, step = np.log(np.longdouble(p)), np.longdouble(STEP)
    expected = (printed(ln_p + step) - printed(ln_p - step)) / (2 * step)
    found = jax.grad(lambda u: softmin(jnp.float64(ratio), jnp.float64(1), jnp.exp(u)))
    np.testing.assert_allclose(found(float(ln_p)), float(expected), rtol=DIFFERENCE)


@pytest.mark.parametrize("p", [0.5, 1.0, 8.0, 1e3, 1e9])
@pytest.mark.parametrize(("a", "b"), [(0.0, 2.0), (2.0, 0.0), (0.0, 0.0), (1.0, 2.0)])
def test_an_unknown_sharpness_has_finite_slopes_and_the_hard_limit(a, b, p):
    """A traced p never is the plain minimum, but comes as near as ln 2 / p."""
    at = (jnp.float64(a), jnp.float64(b), jnp.float64(p))
    value, slopes = jax.jit(jax.value_and_grad(softmin, argnums=(0, 1, 2)))(*at)
    assert np.isfinite(slopes).all()
    assert min(a, b) * 2 ** (-1 / p) <= float(value) * (1 + FEW_OPERATIONS)
    assert float(value) <= min(a, b)
    if p == 1e9 or min(a, b) == 0:
        np.testing.assert_allclose(value, min(a, b), rtol=FEW_OPERATIONS)
        np.testing.assert_allclose(slopes[2], 0.0, atol=FEW_OPERATIONS)


@pytest.mark.parametrize("p", [2.0, 7.5, np.inf])
def test_a_number_far_below_its_limit_passes_with_slope_one(p):
    for value in (-1e-9, 0.0, 1e-9):
        clipped, slope = jax.value_and_grad(softclip)(value, jnp.float64(1), p)
        assert float(clipped) == value
        np.testing.assert_allclose(slope, 1.0, rtol=FEW_OPERATIONS)


@relaxed
@given(value=positive, limit=positive, p=sharpness)
def test_clipping_is_odd(value, limit, p):
    assert float(softclip(-value, limit, p)) == -float(softclip(value, limit, p))


@relaxed
@given(x=signed, y=signed)
def test_length_is_the_library_one(x, y):
    np.testing.assert_allclose(
        norm2(x, y), np.hypot(x, y), rtol=FEW_OPERATIONS, atol=UNDERFLOW
    )


def test_length_has_zero_gradient_at_the_origin():
    value, gradient = jax.value_and_grad(norm2, argnums=(0, 1))(0.0, 0.0)
    assert float(value) == 0.0
    np.testing.assert_array_equal(gradient, [0.0, 0.0])


QUOTIENTS = [
    (sinhc, np.sinh),
    (asinhc, np.arcsinh),
    (expm1c, np.expm1),
    (log1pc, np.log1p),
]
# Where the series ends: in x² of odd functions, in x of the others.
EDGES = {f: np.sqrt(SERIES_LIMIT) for f in (sinhc, asinhc)}
EDGES |= {f: SERIES_LIMIT for f in (expm1c, log1pc)}
# Second and third coefficient of the series of the numerators: slope of the quotient at
# the origin, and half its curvature.
COEFFICIENTS = {
    sinhc: (0, 1 / 6),
    asinhc: (0, -1 / 6),
    expm1c: (1 / 2, 1 / 6),
    log1pc: (-1 / 2, 1 / 3),
}


@pytest.mark.parametrize(("function", "numerator"), QUOTIENTS)
def test_quotients_match_extended_precision_on_both_branches(function, numerator):
    edge = EDGES[function]
    x = np.array([1e-8, 1e-3, 0.5 * edge, 0.999 * edge, 1.001 * edge, 0.3, 2.0, 20.0])
    x = np.concatenate([x, -x])
    # There is no log of what is not positive.
    x = x[x > -1] if function is log1pc else x
    wide = x.astype(np.longdouble)
    expected = (numerator(wide) / wide).astype(float)
    np.testing.assert_allclose(function(jnp.asarray(x)), expected, rtol=FEW_OPERATIONS)


@pytest.mark.parametrize(("function", "numerator"), QUOTIENTS)
def test_slopes_of_quotients_match_differences_on_both_branches(function, numerator):
    x = np.array([0.5, 0.9, 1.1, 30.0]) * EDGES[function]
    step = np.longdouble(STEP)

    def quotient(z):
        return numerator(z) / z

    wide = x.astype(np.longdouble)
    slope = (quotient(wide + step) - quotient(wide - step)) / (2 * step)
    gradient = jax.vmap(jax.grad(function))(jnp.asarray(x))
    np.testing.assert_allclose(gradient, slope.astype(float), rtol=DIFFERENCE)


@pytest.mark.parametrize("function", COEFFICIENTS)
def test_quotients_have_the_coefficients_of_their_series_at_the_origin(function):
    value, slope = jax.value_and_grad(function)(0.0)
    first, second = COEFFICIENTS[function]
    assert (float(value), float(slope)) == (1.0, first)
    curvature = jax.hessian(function)(0.0)
    np.testing.assert_allclose(curvature, 2 * second, rtol=FEW_OPERATIONS)


def test_sine_and_versine_are_the_library_ones_up_to_a_radian_and_a_half():
    x = np.r_[0.0, np.geomspace(1e-8, 1.5, 200)]
    sine, versine = sine_versine(jnp.asarray(x))
    np.testing.assert_allclose(sine, np.sin(x), rtol=FEW_OPERATIONS)
    # 1 - cos x itself would cancel.
    np.testing.assert_allclose(versine, 2 * np.sin(x / 2) ** 2, rtol=FEW_OPERATIONS)


def test_slopes_of_sine_and_versine_are_cosine_and_sine():
    x = np.linspace(-1.5, 1.5, 31)
    of_sine, of_versine = jax.vmap(jax.jacfwd(sine_versine))(jnp.asarray(x))
    np.testing.assert_allclose(of_sine, np.cos(x), rtol=0, atol=FEW_OPERATIONS)
    np.testing.assert_allclose(of_versine, np.sin(x), rtol=0, atol=FEW_OPERATIONS)


def test_the_factors_of_a_lean_are_the_printed_quotients():
    x = np.linspace(0.3, 1.5, 40)
    sinc, sink, turn = lean_factors(jnp.asarray(x * x))
    np.testing.assert_allclose(sinc, np.sin(x) / x, rtol=FEW_OPERATIONS)
    np.testing.assert_allclose(sink, (1 - np.cos(x)) / x**2, rtol=10 * FEW_OPERATIONS)
    printed = (np.cos(x) - np.sin(x) / x) / x**2
    # At the lower end the quotient cancels to x²/3 of its terms, a thirtieth, and each
    # of three operations leaves as much of them.
    cancelled = 3 / np.min(x) ** 2
    np.testing.assert_allclose(turn, printed, rtol=3 * cancelled * FEW_OPERATIONS)
    at_zero = lean_factors(jnp.zeros(()))
    np.testing.assert_allclose(at_zero, (1, 1 / 2, -1 / 3), rtol=FEW_OPERATIONS)


def test_positive_part_is_the_larger_of_a_number_and_zero():
    assert np.isnan(positive_part(jnp.asarray(np.nan)))
    x = np.array([-2.0, 0.0, 3.0])
    np.testing.assert_array_equal(positive_part(jnp.asarray(x)), np.maximum(x, 0))
    slope = jax.vmap(jax.grad(positive_part))(jnp.asarray(x))
    np.testing.assert_array_equal(slope, [0.0, 0.0, 1.0])
