"""The top of a rounded or pointed hump, by averaging over a family of shapes.

    y(t) = a - s (√((t - t_0)² + r²) - r) + q (t - t_0)

A hyperbola is a parabola for large r and two straight flanks for r = 0, so one family
covers a sine and a triangle, and q makes it lopsided. a, s and q are linear; t_0 and r
run over a grid, and every cell counts by its likelihood. That gives the height without
the bias of taking a largest value, and a standard deviation that includes not knowing
the shape. All windows have the same grid, so one matrix serves every push. What
constants do was seen in the recordings of `benchmarks.recordings.real_recordings`.
Excluded: which pushes have one (`pushfit.data.peaks.apex_or_plateau`).
"""

import functools
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from pushfit.parameters import TINY

# Parts of a window, for five numbers: 11 degrees of freedom are left to judge a fit by.
N_BINS = 16
# Moments of each, over which a shape is averaged as samples are.
_FINE = 8

# Apex positions and roundings on the window [-1, 1]: from a tip, below the width of a
# part, to what is a parabola all over the window.
_T0 = np.linspace(-0.6, 0.6, 49)
_R = np.array([0.003, 0.06, 0.2, 0.6, 3.0])
# What is thought of the roundings before one hump is seen. Noise rounds a tip but does
# not sharpen a curve: with equal shares tips come out low by 0.2-0.3 sigma.
_SHARES = np.array([0.6, 0.03, 0.07, 0.12, 0.18])
# Mean squared residual that noise alone exceeds once in 20 (chi-square, 11 degrees).
_BEYOND_CHANCE = 1.8
# A flank must fall: beyond this share of s, q leaves no top inside. At half, lopsided
# tops of `short_dropouts` move by up to 2 sd.
_STEEPEST = 0.98
# Beside the top, as a share of half the window: what misses the shapes there may be the
# top itself. Without it heights of a barometer at 16 Hz lay 5 to 6 sd below the largest
# sample, and those of humps with several summits 4 to 5.
_NEAR = 0.3
# Straight lines between samples round a tip by up to so many of their lengths. At half
# triangles of 16 samples were low by up to 4.8 sd; at twice an sd of `p2_Pa` grows
# 2.5-fold.
_ROUNDED = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Apex:
    """Tops of humps.

    Args:
        height: Level of the top [unit].
        sd: Standard deviation of the level, NaN where no shape has its top inside.
        position: Where the top is, on the window [-1, 1].
        misfit: Mean squared residual of the best shape over the squared noise; about 1
            where the family describes the data.
    """

    height: Float[np.ndarray, " n"]
    sd: Float[np.ndarray, " n"]
    position: Float[np.ndarray, " n"]
    misfit: Float[np.ndarray, " n"]


@dataclass(frozen=True, slots=True)
class _Bank:
    """Least squares of every cell, prepared once; cells of one r are a block."""

    t0: Float[np.ndarray, " g"]
    r: Float[np.ndarray, " g"]
    q: Float[np.ndarray, "g 3 bins"]
    inverse: Float[np.ndarray, "g 3 3"]
    volume: Float[np.ndarray, " g"]


@functools.cache
def _bank() -> _Bank:
    """Orthonormal bases and inverse triangles of all cells."""
    r, t0 = (a.ravel() for a in np.meshgrid(_R, _T0, indexing="ij"))
    falling, lopsided = hyperbolas(t0, r, N_BINS)
    q, triangle = bases(falling, lopsided)
    # Scaled to the fall over the window, so that equal s means an equal fall.
    fall = -falling[:, [0, -1]].mean(axis=1)
    volume = fall / np.abs(np.linalg.det(triangle))
    return _Bank(t0, r, q, np.linalg.inv(triangle), volume)


def moments(n_bins: int) -> Float[np.ndarray, " f"]:
    """Moments of the window [-1, 1], several for each of its bins."""
    n = _FINE * n_bins
    return (2 * np.arange(n) + 1) / n - 1


def hyperbolas(
    top: Float[np.ndarray, " g"], rounding: Float[np.ndarray, " g"], n_bins: int
) -> tuple[Float[np.ndarray, "g f"], Float[np.ndarray, "g f"]]:
    """Columns of s and of q at the moments of so many bins."""
    off = moments(n_bins) - top[:, None]
    return rounding[:, None] - np.sqrt(off**2 + rounding[:, None] ** 2), off


def bases(
    *columns: Float[np.ndarray, "g f"],
) -> tuple[Float[np.ndarray, "g 3 bins"], Float[np.ndarray, "g 3 3"]]:
    """Orthonormal bases of a constant and two columns, and their triangles.

    Samples of a bin are averaged, so is the shape: a tip is lower than its middle.
    """
    fine = np.stack([np.ones_like(columns[0]), *columns], axis=-1)
    q, triangle = np.linalg.qr(fine.reshape(len(fine), -1, _FINE, 3).mean(axis=2))
    return np.ascontiguousarray(q.transpose(0, 2, 1)), triangle


def fit_apex(
    bins: Float[np.ndarray, "n bins"],
    noise: Float[np.ndarray, " n"],
    chord: Float[np.ndarray, " n"] | float = 0.0,
) -> Apex:
    """Estimate the top of each hump by itself.

        height = Σ_g w_g h_g,   w_g ∝ π(r_g) |fall_g / det R_g| exp(-SSE_g / 2σ²)

    One hump cannot tell a tip from a small rounding; that is part of its sd. The shares
    π(r) of the roundings are fixed: others of the session could tell, but then a height
    would depend on them.

    Args:
        bins: Means of the samples in `N_BINS` equal parts of each window.
        noise: Standard deviation σ of a bin.
        chord: Half of the length, on the window [-1, 1], of straight lines between
            samples, which hide √(chord² + r²) - r of each s, r less what they round.
    """
    bank = _bank()
    centre = bins.mean(axis=1, keepdims=True)
    y = bins - centre
    # Cell by cell: one product of all wakes threads that cost more than it does.
    coefficients = bank.q @ y.T
    sse = (y**2).sum(axis=1)[:, None] - (coefficients**2).sum(axis=1).T
    a, s, q = (bank.inverse @ coefficients).transpose(1, 2, 0)
    has_top = np.abs(q) < _STEEPEST * s
    root = np.sqrt(np.where(has_top, s**2 - q**2, 1.0))
    position = bank.t0 + bank.r * q / root
    has_top &= np.abs(position) <= 1
    tops = np.where(has_top, a + bank.r * (s - root), 0.0)
    slopes = np.stack([np.ones_like(s), bank.r * (1 - s / root), bank.r * q / root])
    leverage = ((slopes.T @ bank.inverse) ** 2).sum(axis=2).T
    best = np.where(has_top, sse, np.inf).min(axis=1)
    found = np.isfinite(best)
    floor = np.where(found, best, 0.0)
    variance = np.maximum(noise, TINY) ** 2
    misfit = floor / (N_BINS - 5) / variance
    # What no shape of the family describes counts as noise.
    variance = variance * np.maximum(1.0, misfit / _BEYOND_CHANCE)
    exponent = np.minimum(-(sse - floor[:, None]) / (2 * variance[:, None]), 0.0)
    likelihood = np.where(has_top, np.exp(exponent) * bank.volume, 0.0)
    weights = _weigh(likelihood)
    height = (weights * tops).sum(axis=1)
    spread = (tops - height[:, None]) ** 2 + variance[:, None] * leverage
    at = (weights * np.where(has_top, position, 0.0)).sum(axis=1)
    shown = np.einsum("ng,gkn,gkb->nb", weights, coefficients, bank.q, optimize=True)
    middles = (2 * np.arange(N_BINS) + 1) / N_BINS - 1
    is_near = np.abs(middles - at[:, None]) <= _NEAR
    missed = np.max(np.abs(y - shown), axis=1, where=is_near, initial=0.0)
    missed *= np.clip(misfit / _BEYOND_CHANCE - 1, 0.0, 1.0)
    half = np.broadcast_to(chord, len(bins))[:, None]
    own = np.maximum(bank.r - 2 * _ROUNDED * half, 0.0)
    hidden = (weights * s * (np.hypot(half, own) - own)).sum(axis=1)
    sd = np.sqrt((weights * spread).sum(axis=1) + missed**2 + hidden**2)
    return Apex(
        height=np.where(found, height + centre[:, 0], np.nan),
        sd=np.where(found, sd, np.nan),
        position=at,
        misfit=np.where(found, misfit, np.inf),
    )


def _weigh(likelihood: Float[np.ndarray, "n g"]) -> Float[np.ndarray, "n g"]:
    """Weights of the cells, with the shares that the roundings have beforehand."""
    by_r = likelihood.reshape(len(likelihood), len(_R), len(_T0))
    weights = (by_r * _SHARES[:, None]).reshape(len(likelihood), -1)
    return weights / np.maximum(weights.sum(axis=1, keepdims=True), TINY)
