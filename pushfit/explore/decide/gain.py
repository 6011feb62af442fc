"""What a push would tell: expected information gain about an angle.

The draws of a belief are counted in a table of the angle against the reading that a
push would give, blurred by the noise of that reading. Excluded: where pushes may go
(`pushfit.explore.limits`) and where draws come from (`pushfit.explore.belief.belief`).
"""

from dataclasses import dataclass

import numpy as np
import scipy
from jaxtyping import Float, Int

from pushfit.explore.decide.intervals import HALF_TURN, Target, column_widths

# Bins of equal weight of the angle, and of the reading along its widest and its second
# direction: noise blurs them. Twice as many move no ranking. The coarse ones are for
# screening hundreds of candidates, and for means over readings.
N_LABELS, N_FEW_LABELS = 16, 8
FULL, COARSE = (64, 12), (32, 6)
# Half width of the table: standard deviations of the prediction, and of the noise.
REACH, MARGIN = 3.0, 3.0
# Bins of the angle for its interval after a push.
N_FINE = 128
# Readings so much less likely than the likeliest are left out of what is expected.
NEGLIGIBLE = 1e-3


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
        n_labels: Number of bins.

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
    sigma: Float[np.ndarray, " c"],
    *,
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
    own = weights > 0
    if not np.all(own):
        heights, values, weights = heights[:, :, own], values[own], weights[own]
    found = labels(values, weights, N_FEW_LABELS if is_coarse else N_LABELS)
    counts = np.unique(found, return_inverse=True)[1]
    sizes = COARSE if is_coarse else FULL
    joint = _joint(
        heights, counts, weights, sigma, sizes=sizes, n_labels=int(counts.max()) + 1
    )
    return np.maximum(_plain(joint.table) - _bias(joint), 0.0)


def outlook(
    heights: Float[np.ndarray, "c n"],
    target: Target,
    weights: Float[np.ndarray, " n"],
    sigma: Float[np.ndarray, " c"],
) -> Outlook:
    """What a push is expected to leave of the interval of an angle.

    Args:
        heights: Noise-free readings by channel and draw.
        target: The angle, and what would decide it.
        weights: Weight of every draw; they sum to 1.
        sigma: Noise of a reading by channel [as heights].

    Returns:
        Expected width, and the probability to decide.
    """
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
        heights[None], fine, weights, sigma, sizes=COARSE, n_labels=N_FINE + 1
    ).table[0]
    columns = table.reshape(N_FINE + 1, -1)
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
    """Joint probability of label and reading, and the variance of its cells."""

    table: Float[np.ndarray, "k q y z"]
    variance: Float[np.ndarray, "k q y z"]
    label_variance: Float[np.ndarray, " q"]


def _joint(
    heights: Float[np.ndarray, "k c n"],
    found: Int[np.ndarray, " n"],
    weights: Float[np.ndarray, " n"],
    sigma: Float[np.ndarray, " c"],
    *,
    sizes: tuple[int, int],
    n_labels: int,
) -> _Joint:
    """Count draws by label and reading, and blur the reading by its noise."""
    scaled = _principal(heights / sigma[:, None], weights)
    sizes = sizes if scaled.shape[1] > 1 else (sizes[0], 1)
    k = heights.shape[0]
    cell = found[None] + n_labels * np.arange(k)[:, None]
    kernels = []
    for axis, size in enumerate(sizes):
        if axis >= scaled.shape[1]:
            continue
        index, kernel = _binned(scaled[:, axis], weights, size)
        cell = cell * size + index
        kernels.append(kernel)
    shape = (k, n_labels, *sizes)
    n_cells = int(np.prod(shape))
    counted = [
        np.bincount(
            cell.ravel(), np.broadcast_to(w, cell.shape).ravel(), minlength=n_cells
        ).reshape(shape)
        for w in (weights, weights**2)
    ]
    return _Joint(
        table=_blurred(counted[0], kernels),
        variance=_blurred(counted[1], [kernel**2 for kernel in kernels]),
        label_variance=np.bincount(found, weights**2, minlength=n_labels),
    )


def _principal(
    scaled: Float[np.ndarray, "k c n"], weights: Float[np.ndarray, " n"]
) -> Float[np.ndarray, "k d n"]:
    """The one or two orthogonal directions in which readings vary most.

    A rotation leaves noise of unit variance what it is.
    """
    centred = scaled - (scaled @ weights)[..., None]
    if scaled.shape[1] == 1:
        return centred
    scatter = np.einsum("kcn,kdn,n->kcd", centred, centred, weights, optimize=True)
    _, axes = np.linalg.eigh(scatter)
    return np.swapaxes(axes[..., :-3:-1], 1, 2) @ centred


def _binned(
    scaled: Float[np.ndarray, "k n"], weights: Float[np.ndarray, " n"], size: int
) -> tuple[Int[np.ndarray, "k n"], Float[np.ndarray, "k s s"]]:
    """Bin of every draw, and the probability of each bin given each."""
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
    lag = np.arange(size)[None, :] - np.arange(size)[:, None] + size - 1
    kernel = profile[:, lag]
    return index, kernel / kernel.sum(axis=2, keepdims=True)


def _blurred(
    counted: Float[np.ndarray, "k q y z"], kernels: list[np.ndarray]
) -> Float[np.ndarray, "k q y z"]:
    """Spread every cell over the readings that noise makes of it."""
    k, q, y, z = counted.shape
    first = np.swapaxes(kernels[0], 1, 2)[:, None] @ counted
    if len(kernels) == 1:
        return first
    return (first.reshape(k, q * y, z) @ kernels[1]).reshape(counted.shape)


def _plain(joint: Float[np.ndarray, "k q y z"]) -> Float[np.ndarray, " k"]:
    """Mutual information of label and reading, as if the table were exact [nat]."""
    whole = joint.sum(axis=(1, 2, 3))
    by_label = joint.sum(axis=(2, 3))
    by_reading = joint.sum(axis=1)
    return (
        scipy.special.xlogy(joint, joint).sum(axis=(1, 2, 3))
        - scipy.special.xlogy(by_label, by_label).sum(axis=1)
        - scipy.special.xlogy(by_reading, by_reading).sum(axis=(1, 2))
    ) / whole


def _bias(joint: _Joint) -> Float[np.ndarray, " k"]:
    """Mean of `_plain` above the truth, to first order in the number of draws [nat].

        ½ [Σ V/J - Σ_y V_y/J_y - Σ_q V_q/J_q + V_0]

    V is the variance of a cell: the sum of the squares of what was counted there.
    """
    cells = _ratio(joint.variance, joint.table).sum(axis=(1, 2, 3))
    readings = _ratio(joint.variance.sum(axis=1), joint.table.sum(axis=1))
    by_label = joint.table.sum(axis=(2, 3))
    one = np.broadcast_to(joint.label_variance, by_label.shape)
    return (
        cells
        - readings.sum(axis=(1, 2))
        - _ratio(one, by_label).sum(axis=1)
        + joint.label_variance.sum()
    ) / 2


def _ratio(
    over: Float[np.ndarray, "*s"], under: Float[np.ndarray, "*s"]
) -> Float[np.ndarray, "*s"]:
    """Quotient, 0 where nothing was counted."""
    return np.divide(over, under, out=np.zeros_like(over), where=under > 1e-300)
