"""What a push would tell: expected information gain about an angle.

The draws of a belief are counted in a table of the angle against the reading that a
push would give, blurred by the noise of that reading. Excluded: where pushes may go
(`pushfit.explore.limits`) and where draws come from (`pushfit.explore.belief.belief`).
"""

import functools
import itertools
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
import scipy
from jaxtyping import Float, Float32, Int
from threadpoolctl import ThreadpoolController

from pushfit.explore.decide.intervals import HALF_TURN, Target, column_widths

# Bins of equal weight of the angle, and of the reading along its widest and its second
# direction: noise blurs them. Twice as many move no ranking. The coarse ones are for
# screening hundreds of candidates, and for means over readings.
N_LABELS, N_FEW_LABELS = 16, 8
FULL, COARSE = (64, 12), (32, 6)
# Readings that are counted at once: arrays of more are slow to make.
N_AT_ONCE = 2**17
# Half width of the table: standard deviations of the prediction, and of the noise.
REACH, MARGIN = 3.0, 3.0
# Bins of the angle for its interval after a push.
N_FINE = 128
# Readings so much less likely than the likeliest are left out of what is expected.
NEGLIGIBLE = 1e-3
# Nothing was counted where there is less; tails of the noise that add nothing, and of
# which single precision still holds products and squares.
TINY, NOTHING = np.float32(1e-37), 1e-7


@functools.cache
def _libraries() -> ThreadpoolController:
    # Looking for the libraries takes as long as a survey.
    return ThreadpoolController()


@contextmanager
def one_thread() -> Iterator[None]:
    """Products of matrices on one thread; `@one_thread()` does so for a function.

    What a suggestion multiplies is small: waking other threads for it costs more than
    they do, and where other programs run, ten times as much.
    """
    with _libraries().limit(limits=1, user_api="blas"):
        yield


@dataclass(frozen=True, slots=True, kw_only=True)
class Outlook:
    """What is expected of the interval of an angle after one push.

    Args:
        expected_width: Mean width of its shortest interval; infinite where some
            readings would leave none [deg].
        p_decided: Probability that the interval is then no wider than asked.
    """

    expected_width: float
    p_decided: float


def labels(
    values: Float[np.ndarray, " n"],
    weights: Float[np.ndarray, " n"],
    n_labels: int = N_LABELS,
) -> Int[np.ndarray, " n"]:
    """Bins of equal weight of an angle; where it is undefined, a bin of its own.

    Args:
        values: Draws; NaN where undefined.
        weights: Their weights, which sum to 1.

    Returns:
        Bin of every draw, from 0 to `n_labels`; the last is that of NaN.
    """
    known = np.isfinite(values)
    order = np.argsort(values, kind="stable")  # NaN last
    middle = np.cumsum(weights[order]) - weights[order] / 2
    share = max(float(weights[known].sum()), 1e-300)
    found = np.empty(values.size, dtype=np.int64)
    found[order] = np.clip(n_labels * middle / share, 0, n_labels - 1)
    # Equal values share a bin, or the order of draws would be taken for knowledge.
    _, first, same = np.unique(values[known], return_index=True, return_inverse=True)
    found[known] = found[known][first][same]
    found[~known] = n_labels
    return found


def information_gain(
    heights: Float[np.ndarray, "k c n"],
    values: Float[np.ndarray, " n"],
    weights: Float[np.ndarray, " n"],
    *,
    sigma: Float[np.ndarray, " c"],
    is_coarse: bool = False,
) -> Float[np.ndarray, " k"]:
    """Expected information gain about an angle of each candidate push.

        EIG = Σ J ln J - Σ_y J_y ln J_y - Σ_q J_q ln J_q,   J[q, y]

    J is the joint probability of bin q of the angle and bin y of the noisy reading.
    Draws are finite, so J is only estimated and the sum is biased upwards; its bias of
    first order in the number of draws is taken off. Of several channels the two
    directions in which the readings vary most, in units of their noise, are counted.

    Args:
        heights: Noise-free readings of every candidate, channel and draw.
        values: The angle of every draw; NaN where undefined.
        weights: Weight of every draw; they sum to 1.
        sigma: Noise of a reading by channel [as heights].
        is_coarse: Whether a gain for screening will do.

    Returns:
        Gains, not below 0 [nat].

    References:
        Lindley (1956), doi:10.1214/aoms/1177728069; the bias: Miller (1955), for
        weighted and blurred counts.
    """
    return summed_gain(heights, (values,), weights, sigma=sigma, is_coarse=is_coarse)


@one_thread()
def summed_gain(
    heights: Float[np.ndarray, "k c n"],
    angles: Sequence[Float[np.ndarray, " n"]],
    weights: Float[np.ndarray, " n"],
    *,
    sigma: Float[np.ndarray, " c"],
    is_coarse: bool = False,
) -> Float[np.ndarray, " k"]:
    """Sum of the expected information gains about several angles, of one count [nat].

    Args:
        angles: Each angle of every draw; NaN where undefined.
    """
    own = weights > 0
    if not np.all(own):
        heights, weights = heights.compress(own, axis=2), weights[own]
        angles = [values[own] for values in angles]
    ends, rows = [0], []
    for values in angles:
        bins = labels(values, weights, N_FEW_LABELS if is_coarse else N_LABELS)
        counts = np.unique(bins, return_inverse=True)[1]
        rows.append(ends[-1] + counts)
        ends.append(ends[-1] + int(counts.max()) + 1)
    sizes = COARSE if is_coarse else FULL
    found = [
        _of_block(block, np.stack(rows), weights, sigma=sigma, sizes=sizes, ends=ends)
        for block in np.array_split(heights, -(-heights[:, 0].size // N_AT_ONCE))
    ]
    return np.concatenate(found)


def _of_block(
    heights: Float[np.ndarray, "k c n"],
    found: Int[np.ndarray, "a n"],
    weights: Float[np.ndarray, " n"],
    *,
    sigma: Float[np.ndarray, " c"],
    sizes: tuple[int, int],
    ends: Sequence[int],
) -> Float[np.ndarray, " k"]:
    """Sum of the gains about several angles, whose bins are between the ends."""
    joint = _joint(
        heights, found, weights=weights, sigma=sigma, sizes=sizes, n_labels=ends[-1]
    )
    parts = [joint.of_labels(*pair) for pair in itertools.pairwise(ends)]
    # Each by itself: what one is short of nothing is no loss to the other.
    gains = [np.maximum(_plain(part) - _bias(part), 0.0) for part in parts]
    return np.sum(gains, axis=0)


@one_thread()
def outlook(
    heights: Float[np.ndarray, "c n"],
    target: Target,
    *,
    weights: Float[np.ndarray, " n"],
    sigma: Float[np.ndarray, " c"],
) -> Outlook:
    """What a push is expected to leave of the interval of an angle."""
    own = weights > 0
    heights, values, weights = heights[:, own], target.values[own], weights[own]
    known = np.isfinite(values)
    if not np.any(known):
        return Outlook(expected_width=np.inf, p_decided=0.0)
    if target.is_axis:
        low, step = 0.0, HALF_TURN / N_FINE
        bins = np.mod(values[known], HALF_TURN) / step
    else:
        low = float(values[known].min())
        step = max(float(np.ptp(values[known])) / N_FINE, 1e-9)
        bins = (values[known] - low) / step
    fine = np.full(values.size, N_FINE, dtype=np.int64)
    fine[known] = np.clip(bins, 0, N_FINE - 1)
    table = _joint(
        heights[None],
        fine[None],
        weights=weights,
        sigma=sigma,
        sizes=COARSE,
        n_labels=N_FINE + 1,
    ).table[0]
    columns = np.swapaxes(table, 0, 1).reshape(N_FINE + 1, -1).astype(float)
    mass = columns.sum(axis=0)
    likely = mass > NEGLIGIBLE * mass.max()
    columns, mass = columns[:, likely] / mass[likely], mass[likely] / mass[likely].sum()
    widths = column_widths(
        columns[:N_FINE], target.prob, step=step, is_axis=target.is_axis
    )
    return Outlook(
        expected_width=float(mass @ widths),
        p_decided=float(mass @ (widths <= target.width)),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Joint:
    """Joint probability of reading and label, and the variance of its cells.

    Labels of several angles follow each other. Variances are times the number of draws.
    Single precision will do: as draws are finite, gains are good to some hundredths.
    """

    table: Float32[np.ndarray, "k y q z"]
    variance: Float32[np.ndarray, "k y q z"]
    label_variance: Float[np.ndarray, " q"]
    n_draws: int

    def of_labels(self, first: int, end: int) -> "_Joint":
        """That of one angle."""
        if end - first == self.table.shape[2]:
            return self
        return _Joint(
            table=np.ascontiguousarray(self.table[:, :, first:end]),
            variance=np.ascontiguousarray(self.variance[:, :, first:end]),
            label_variance=self.label_variance[first:end],
            n_draws=self.n_draws,
        )


def _joint(
    heights: Float[np.ndarray, "k c n"],
    found: Int[np.ndarray, "a n"],
    *,
    weights: Float[np.ndarray, " n"],
    sigma: Float[np.ndarray, " c"],
    sizes: tuple[int, int],
    n_labels: int,
) -> _Joint:
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
    is_even = np.allclose(squares, weights, rtol=1e-9, atol=0)
    counted = [
        np.bincount(
            cell, np.broadcast_to(w, (k * len(found), n)).ravel(), minlength=n_cells
        )
        .reshape(shape)
        .astype(np.float32)
        for w in ((weights,) if is_even else (weights, squares))
    ]
    profiles = [first.kernel, *(other.kernel for other in kernels)]
    return _Joint(
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
    counted: Float32[np.ndarray, "k y q z"], kernels: list[np.ndarray]
) -> Float32[np.ndarray, "k y q z"]:
    """Spread every cell over the readings that noise makes of it."""
    k, y, q, z = counted.shape
    first = np.swapaxes(kernels[0], 1, 2) @ counted.reshape(k, y, q * z)
    if len(kernels) > 1:
        first = first.reshape(k, y * q, z) @ kernels[1]
    return first.reshape(counted.shape)


def _plain(joint: _Joint) -> Float[np.ndarray, " k"]:
    """Mutual information of label and reading, as if the table were exact [nat]."""
    table = joint.table
    by_reading = _by_reading(table)
    return (
        _whole(_entropy(table))
        - _whole(_entropy(_by_label(table)))
        - _whole(_entropy(by_reading))
    ) / _whole(by_reading)


def _whole(table: Float[np.ndarray, "k ..."]) -> Float[np.ndarray, " k"]:
    return table.reshape(table.shape[0], -1).sum(axis=1, dtype=float)


# By products of matrices: sums over short axes in the middle take ten times as long.
def _by_label(table: Float[np.ndarray, "k y q z"]) -> Float[np.ndarray, "k q"]:
    return (table @ np.ones(table.shape[3], table.dtype)).sum(axis=1)


def _by_reading(table: Float[np.ndarray, "k y q z"]) -> Float[np.ndarray, "k y z"]:
    return np.ones(table.shape[2], table.dtype) @ table


def _entropy(p: Float[np.ndarray, "*s"]) -> Float[np.ndarray, "*s"]:
    """Terms p ln p of an entropy, 0 at 0."""
    return p * np.log(np.maximum(p, TINY))


def _bias(joint: _Joint) -> Float[np.ndarray, " k"]:
    """Mean of `_plain` above the truth, to first order in the number of draws [nat].

        [Σ V/J - Σ_y V_y/J_y - Σ_q V_q/J_q + V_0] / 2n

    V is n times the variance of a cell: n times the sum of squares counted there.
    """
    table, variance = joint.table, joint.variance
    by_label = _by_label(table)
    one = np.broadcast_to(joint.label_variance, by_label.shape)
    return (
        _whole(_ratio(variance, table))
        - _whole(_ratio(_by_reading(variance), _by_reading(table)))
        - _whole(_ratio(one, by_label))
        + joint.label_variance.sum()
    ) / (2 * joint.n_draws)


def _ratio(
    over: Float[np.ndarray, "*s"], under: Float[np.ndarray, "*s"]
) -> Float[np.ndarray, "*s"]:
    """Quotient, 0 where nothing was counted."""
    return np.where(under > TINY, over / np.maximum(under, TINY), 0.0)
