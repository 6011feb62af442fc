"""Draws of a belief, counted by an angle against the reading that a push would give.

Readings are blurred by their noise. Excluded: what follows from the table
(`pushfit.explore.decide.gain`).
"""

from dataclasses import dataclass

import numpy as np
import scipy
from jaxtyping import Float, Float32, Int

# Half width of the table: standard deviations of the prediction, and of the noise.
REACH, MARGIN = 3.0, 3.0
# Tails of the noise that add nothing, and of which single precision still holds
# products and squares.
NOTHING = 1e-7
# Relative difference up to which draws have one weight: more than weights round by,
# and less than the single precision of a table, 6e-8. Not tuned.
SAME_WEIGHT = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """Joint probability of reading and label, and the variance of its cells.

    Labels of several angles follow each other. Variances are times the number of draws.
    Single precision will do: as draws are finite, gains are good to some hundredths.
    """

    table: Float32[np.ndarray, "k y q z"]
    variance: Float32[np.ndarray, "k y q z"]
    label_variance: Float[np.ndarray, " q"]
    n_draws: int

    def of_labels(self, first: int, end: int) -> "Joint":
        """The part whose labels, from first to before end, are of one angle."""
        if end - first == self.table.shape[2]:
            return self
        return Joint(
            table=np.ascontiguousarray(self.table[:, :, first:end]),
            variance=np.ascontiguousarray(self.variance[:, :, first:end]),
            label_variance=self.label_variance[first:end],
            n_draws=self.n_draws,
        )


def joint_table(
    heights: Float[np.ndarray, "k c n"],
    found: Int[np.ndarray, "a n"],
    *,
    weights: Float[np.ndarray, " n"],
    sigma: Float[np.ndarray, " c"],
    sizes: tuple[int, int],
    n_labels: int,
) -> Joint:
    """Count draws by label and reading, and blur the reading by its noise."""
    scaled = _principal(heights / sigma[:, None], weights)
    k, n_axes, n = scaled.shape
    sizes = sizes if n_axes > 1 else (sizes[0], 1)
    first, *kernels = (
        _binned(scaled[:, axis], weights, sizes[axis]) for axis in range(n_axes)
    )
    # Readings outermost and innermost: both are then blurred by products of matrices.
    cell = (first.index + sizes[0] * np.arange(k)[:, None]) * (n_labels * sizes[1])
    if kernels:
        cell += kernels[0].index
    shape = (k, sizes[0], n_labels, sizes[1])
    cell = (cell[:, None] + found * sizes[1]).ravel()
    n_cells, squares = int(np.prod(shape)), n * weights**2
    # Draws of one weight, as those for screening are, are their own squares.
    is_even = np.allclose(squares, weights, rtol=SAME_WEIGHT, atol=0)
    counted = [
        np.bincount(
            cell, np.broadcast_to(w, (k * len(found), n)).ravel(), minlength=n_cells
        )
        .reshape(shape)
        .astype(np.float32)
        for w in ((weights,) if is_even else (weights, squares))
    ]
    profiles = [first.kernel, *(other.kernel for other in kernels)]
    return Joint(
        table=_blurred(counted[0], profiles),
        variance=_blurred(counted[-1], [kernel**2 for kernel in profiles]),
        label_variance=np.bincount(
            found.ravel(), np.tile(squares, len(found)), minlength=n_labels
        ),
        n_draws=n,
    )


def _principal(
    scaled: Float[np.ndarray, "k c n"], weights: Float[np.ndarray, " n"]
) -> Float32[np.ndarray, "k d n"]:
    """The one or two orthogonal directions in which readings vary most.

    A rotation leaves noise of unit variance what it is.
    """
    centred = (scaled - (scaled @ weights)[..., None]).astype(np.float32)
    weights = weights.astype(np.float32)
    if scaled.shape[1] == 1:
        return centred
    scatter = np.einsum("kcn,kdn,n->kcd", centred, centred, weights, optimize=True)
    _, axes = np.linalg.eigh(scatter)
    return np.swapaxes(axes[..., :-3:-1], 1, 2) @ centred


@dataclass(frozen=True, slots=True, kw_only=True)
class _Binned:
    """Bin of every draw, and the probability of each bin given each."""

    index: Int[np.ndarray, "k n"]
    kernel: Float32[np.ndarray, "k s s"]


def _binned(
    scaled: Float32[np.ndarray, "k n"], weights: Float[np.ndarray, " n"], size: int
) -> _Binned:
    weights = weights.astype(np.float32)
    mean = scaled @ weights
    spread = np.sqrt(np.maximum((scaled**2) @ weights - mean**2, 0.0))
    low = np.maximum(scaled.min(axis=1), mean - REACH * spread) - MARGIN
    high = np.minimum(scaled.max(axis=1), mean + REACH * spread) + MARGIN
    step = (high - low) / size
    index = ((scaled - low[:, None]) / step[:, None]).astype(np.int64)
    np.clip(index, 0, size - 1, out=index)
    offset = np.arange(-size + 1, size)
    profile = scipy.special.ndtr((offset + 0.5) * step[:, None]) - scipy.special.ndtr(
        (offset - 0.5) * step[:, None]
    )
    profile[profile < NOTHING] = 0.0
    lag = np.arange(size)[None, :] - np.arange(size)[:, None] + size - 1
    kernel = profile.astype(np.float32)[:, lag]
    return _Binned(index=index, kernel=kernel / kernel.sum(axis=2, keepdims=True))


def _blurred(
    counted: Float32[np.ndarray, "k y q z"], kernels: list[Float32[np.ndarray, "k _ _"]]
) -> Float32[np.ndarray, "k y q z"]:
    """Spread every cell over the readings that noise makes of it."""
    k, y, q, z = counted.shape
    first = np.swapaxes(kernels[0], 1, 2) @ counted.reshape(k, y, q * z)
    if len(kernels) > 1:
        first = first.reshape(k, y * q, z) @ kernels[1]
    return first.reshape(counted.shape)


# By products of matrices: sums over short axes in the middle take ten times as long.
def by_label(table: Float[np.ndarray, "k y q z"]) -> Float[np.ndarray, "k q"]:
    """Probability of each label: the sum over readings."""
    return (table @ np.ones(table.shape[3], table.dtype)).sum(axis=1)


def by_reading(table: Float[np.ndarray, "k y q z"]) -> Float[np.ndarray, "k y z"]:
    """Probability of each reading: the sum over labels."""
    return np.ones(table.shape[2], table.dtype) @ table
