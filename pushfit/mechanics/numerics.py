"""Functions whose textbook form breaks at one point, each safe there once and for all.

Every function here returns finite values and finite first derivatives wherever the
physics is defined; `pushfit.model` uses them instead of repairing each formula.
Excluded: anything that knows what a push is.
"""

import math

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from pushfit.parameters import TINY

Sharpness = float | Float[Array, ""]
SineVersine = tuple[Float[Array, "*s"], Float[Array, "*s"]]
# Below this argument four terms of a series in it are exact to 1e-18, while the closed
# form divides 0 by 0 at the origin.
SERIES_LIMIT = 1e-3

# Taylor coefficients of sin(x)/x and of (1 - cos x)/x² in x²: for |x| <= 1.5 the term
# after the last is below 1e-17.
SINE = tuple((-1) ** k / math.factorial(2 * k + 1) for k in range(11))
VERSINE = tuple((-1) ** k / math.factorial(2 * k + 2) for k in range(11))
# Taylor coefficients of expm1(x)/x and of log1p(x)/x: below SERIES_LIMIT the term after
# the last is below 1e-21, and that of the slope below 1e-18.
EXPM1C = tuple(1 / math.factorial(k + 1) for k in range(7))
LOG1PC = tuple((-1) ** k / (k + 1) for k in range(7))


def norm2(x: Float[Array, "*s"], y: Float[Array, "*s"]) -> Float[Array, "*s"]:
    """Euclidean length of (x, y), with subgradient 0 instead of NaN at the origin."""
    square = x * x + y * y
    is_zero = square == 0
    return jnp.where(is_zero, 0.0, jnp.sqrt(jnp.where(is_zero, 1.0, square)))


def positive_part(x: Float[Array, "*s"]) -> Float[Array, "*s"]:
    """The larger of x and 0; at 0 its slope is that of 0.

    The derivative of `jnp.maximum` shares ties by two divisions for each number.
    """
    return jnp.where(x <= 0, 0.0, x)


def is_hard(sharpness: Sharpness) -> bool:
    """Whether a transition is the plain minimum; one that is traced never is."""
    return isinstance(sharpness, float | int) and sharpness == math.inf


def softmin(
    a: Float[Array, "*s"], b: Float[Array, "*s"], sharpness: Sharpness
) -> Float[Array, "*s"]:
    """Smooth minimum of two non-negative numbers.

        softmin_p(a, b) = (a^-p + b^-p)^(-1/p)

    Args:
        a: First argument, not negative.
        b: Second argument, not negative.
        sharpness: p, at least 1; infinity gives the plain minimum [-].

    Returns:
        A value in [2^(-1/p) min, min]; at the tie both arguments share the gradient.

    Examples:
        >>> print(f"{softmin(jnp.array(3.0), jnp.array(4.0), 2.0):.4f}")
        2.4000
    """
    smaller, larger = jnp.minimum(a, b), jnp.maximum(a, b)
    if is_hard(sharpness):
        return smaller
    # The printed form overflows for a -> 0; this one only sees a ratio in [0, 1].
    is_zero = larger == 0
    ratio = smaller / jnp.where(is_zero, 1.0, larger)
    # Powers by way of logs: many times faster where they are not known beforehand.
    power = jnp.exp(sharpness * jnp.log(jnp.maximum(ratio, TINY)))
    return smaller * jnp.exp(-jnp.log(1 + power) / sharpness)


def softclip(
    value: Float[Array, "*s"], limit: Float[Array, "*s"], sharpness: Sharpness
) -> Float[Array, "*s"]:
    """Number held within ±limit: the soft minimum of both magnitudes, sign kept.

        sign(value) softmin_p(|value|, limit)

    Args:
        value: Number of either sign.
        limit: Largest magnitude, not negative.
        sharpness: p of `softmin` [-].

    Returns:
        A value of the sign of ``value``; equal to it far below the limit.
    """
    # jnp.sign is 0 at 0 and would cut the gradient there, which is 1.
    sign = jnp.where(value < 0, -1.0, 1.0)
    return sign * softmin(sign * value, limit, sharpness)


def sinhc(x: Float[Array, "*s"]) -> Float[Array, "*s"]:
    """Sinh(x) / x, equal to 1 at 0."""
    square = x * x
    is_small = square < SERIES_LIMIT
    safe = jnp.where(is_small, 1.0, x)
    series = 1 + square / 6 * (1 + square / 20 * (1 + square / 42 * (1 + square / 72)))
    return jnp.where(is_small, series, jnp.sinh(safe) / safe)


def asinhc(x: Float[Array, "*s"]) -> Float[Array, "*s"]:
    """Asinh(x) / x, equal to 1 at 0."""
    square = x * x
    is_small = square < SERIES_LIMIT
    safe = jnp.where(is_small, 1.0, x)
    terms = 3 / 40 - square * (15 / 336 - square * (105 / 3456 - square * 945 / 42240))
    series = 1 - square * (1 / 6 - square * terms)
    return jnp.where(is_small, series, jnp.arcsinh(safe) / safe)


def expm1c(x: Float[Array, "*s"]) -> Float[Array, "*s"]:
    """(exp(x) - 1) / x, equal to 1 at 0."""
    is_small = jnp.abs(x) < SERIES_LIMIT
    safe = jnp.where(is_small, 1.0, x)
    return jnp.where(is_small, _horner(EXPM1C, x), jnp.expm1(safe) / safe)


def log1pc(x: Float[Array, "*s"]) -> Float[Array, "*s"]:
    """Ln(1 + x) / x, equal to 1 at 0."""
    is_small = jnp.abs(x) < SERIES_LIMIT
    safe = jnp.where(is_small, 1.0, x)
    return jnp.where(is_small, _horner(LOG1PC, x), jnp.log1p(safe) / safe)


@jax.custom_jvp
def sine_versine(x: Float[Array, "*s"]) -> SineVersine:
    """Sin x and 1 - cos x for |x| <= 1.5, both exact for small x.

    Products and a root alone, which run many at a time; each is the slope of the other,
    so that derivatives cost nothing.
    """
    half = x / 2 * _horner(SINE[:9], x * x / 4)
    return 2 * half * jnp.sqrt(1 - half * half), 2 * half * half


@sine_versine.defjvp
def _sine_versine_jvp(
    primals: tuple[Float[Array, "*s"]], tangents: tuple[Float[Array, "*s"]]
) -> tuple[SineVersine, SineVersine]:
    (x,), (rate,) = primals, tangents
    sine, versine = sine_versine(x)
    return (sine, versine), ((1 - versine) * rate, sine * rate)


def lean_factors(
    square: Float[Array, "*s"],
) -> tuple[Float[Array, "*s"], Float[Array, "*s"], Float[Array, "*s"]]:
    """Functions of x² that turn a rotation vector of length x into a displacement.

    Args:
        square: x², at most 1.5².

    Returns:
        Sin(x)/x, (1 - cos x)/x² and (cos x - sin(x)/x)/x²: products alone, smooth
        where the vector vanishes.
    """
    fall = _horner(tuple(-c for c in SINE[1:]), square)
    sink = _horner(VERSINE, square)
    return 1 - square * fall, sink, fall - sink


def _horner(
    coefficients: tuple[float, ...], x: Float[Array, "*s"]
) -> Float[Array, "*s"]:
    """Polynomial with the coefficients of rising powers."""
    value = jnp.full_like(x, coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        value = value * x + coefficient
    return value
