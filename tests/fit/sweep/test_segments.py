"""Densities that are exponential between nodes, against sums over fine grids."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from pushfit.fit.sweep.segments import (
    DEPTH,
    TAIL_POWER,
    TAIL_SHARE,
    draw_segment,
    make_segments,
    with_tails,
)
from tests.tolerances import EXACT

NODES = np.array([-1.0, -0.2, 0.0, 1.5, 1.6])
# Rising, falling, level within rounding, and level.
LOG_DENSITY = np.array([-3.0, 2.0, 2.0 - 1e-13, -40.0, -40.0])
# Cells of the sum over each segment: its error falls with their square, and is about
# (42 / N)² / 24 on the steepest one.
N, BY_SUM = 200_000, 1e-8
# Shares are of a total that is summed up to a segment and divided again: 1e3 roundings.
BY_SHARE = 1e-12
# Nodes along which both parts of a mixture are nearly straight, and by how much the log
# of their sum is below its chords.
N_FINE, CHORD = 2001, 1e-3


def density_between(log_density):
    """Midpoints of fine cells, their widths, and the density there."""
    edges = np.concatenate(
        [np.linspace(*ends, N, endpoint=False) for ends in itertools.pairwise(NODES)]
        + [NODES[-1:]]
    )
    middle, width = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    return middle, width, np.exp(np.interp(middle, NODES, log_density))


def drawn_at(segments, shares):
    """Places, and log densities there, of shares of the integral."""
    found = jax.vmap(lambda share: draw_segment(segments, share))(jnp.asarray(shares))
    low = NODES[found.segment]
    return low + found.share * np.diff(NODES)[found.segment], found.log_density


def test_the_integral_is_that_of_a_fine_sum():
    _, width, density = density_between(LOG_DENSITY)
    segments = make_segments(jnp.asarray(NODES), jnp.asarray(LOG_DENSITY))
    expected = np.log(np.sum(width * density))
    np.testing.assert_allclose(segments.log_integral, expected, rtol=0, atol=BY_SUM)
    assert segments.cumulative[0] == 0.0
    np.testing.assert_allclose(segments.cumulative[-1], 1.0, rtol=EXACT)


@pytest.mark.parametrize("shift", [0.0, 800.0, -800.0])
def test_a_common_factor_changes_the_integral_alone(shift):
    """Even where exp of the log density itself is 0 or infinite."""
    plain = make_segments(jnp.asarray(NODES), jnp.asarray(LOG_DENSITY))
    moved = make_segments(jnp.asarray(NODES), jnp.asarray(LOG_DENSITY + shift))
    np.testing.assert_allclose(
        moved.log_integral, plain.log_integral + shift, rtol=EXACT
    )
    # ln to so many digits as the shift leaves.
    left = EXACT * max(1.0, abs(shift))
    np.testing.assert_allclose(moved.cumulative, plain.cumulative, rtol=0, atol=left)


def test_draws_lie_where_the_cumulative_sum_has_their_share():
    middle, width, density = density_between(LOG_DENSITY)
    cumulative = np.cumsum(width * density) / np.sum(width * density)
    shares = np.linspace(0.001, 0.999, 401)
    segments = make_segments(jnp.asarray(NODES), jnp.asarray(LOG_DENSITY))
    places, log_density = drawn_at(segments, shares)
    # Of a cell's width, half of which the midpoint is from its end.
    np.testing.assert_allclose(
        places, np.interp(shares, cumulative, middle), rtol=0, atol=np.max(width)
    )
    expected = np.interp(places, NODES, LOG_DENSITY) - segments.log_integral
    np.testing.assert_allclose(log_density, expected, rtol=0, atol=BY_SHARE)


def test_a_flat_density_is_drawn_from_evenly():
    shares = np.linspace(0.01, 0.99, 99)
    segments = make_segments(jnp.asarray(NODES), jnp.zeros(NODES.size))
    places, log_density = drawn_at(segments, shares)
    span = NODES[-1] - NODES[0]
    np.testing.assert_allclose(places, NODES[0] + shares * span, rtol=0, atol=BY_SHARE)
    np.testing.assert_allclose(log_density, -np.log(span), rtol=EXACT)


def test_what_is_impossible_at_a_node_is_held_far_below():
    """No draw, and no NaN, comes from between two nodes of no density."""
    log_density = np.array([-np.inf, -np.inf, 0.0, 0.0, 0.0])
    segments = make_segments(jnp.asarray(NODES), jnp.asarray(log_density))
    assert np.min(segments.log_density) == -DEPTH
    places, _ = drawn_at(segments, np.linspace(1e-6, 1 - 1e-6, 101))
    # From -DEPTH the density rises to its peak within the last 600th of a segment.
    assert np.all(places > NODES[1] + 0.8 * (NODES[2] - NODES[1]))
    slope = jax.grad(lambda y: make_segments(jnp.asarray(NODES), y).log_integral)
    assert np.all(np.isfinite(slope(jnp.asarray(log_density))))


def test_tails_are_proposed_by_their_share_at_least():
    """A mixture is nowhere below a part's share, and little more in the tail."""
    fine = np.linspace(NODES[0], NODES[-1], N_FINE)
    log_density = np.interp(fine, NODES, LOG_DENSITY)
    mixed = with_tails(jnp.asarray(fine), jnp.asarray(log_density))
    proposed = np.asarray(mixed.log_density - jnp.log(mixed.total[-1]))
    for power, share in ((1.0, 1 - TAIL_SHARE), (TAIL_POWER, TAIL_SHARE)):
        part = power * log_density
        part -= np.log(np.trapezoid(np.exp(part), fine)) - np.log(share)
        assert np.all(proposed >= part - CHORD)
    assert proposed[-1] < part[-1] + CHORD
