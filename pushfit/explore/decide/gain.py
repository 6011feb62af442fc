"""What a push would tell: expected information gain about an angle.

Excluded: the table of angle and reading that it is read off
(`pushfit.explore.decide.joint_table`), where pushes may go (`pushfit.explore.limits`)
and where draws come from (`pushfit.explore.belief.belief`).
"""

import functools
import itertools
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int
from threadpoolctl import ThreadpoolController

from pushfit.explore.decide.intervals import AskedAngle, column_widths
from pushfit.explore.decide.joint_table import Joint, by_label, by_reading, joint_table
from pushfit.parameters import HALF_TURN, TINY

# Bins of equal weight of the angle, and of the reading along its widest and its second
# direction: noise blurs them. Twice as many move no ranking. The coarse ones are for
# screening hundreds of candidates, and for means over readings.
N_LABELS, N_FEW_LABELS = 16, 8
FULL, COARSE = (64, 12), (32, 6)
# Readings that are counted at once: arrays of more are slow to make.
N_AT_ONCE = 2**17
# Bins of the angle for its interval after a push.
N_FINE = 128
# Width of a bin where the angle has but one value: not 0 all the same [deg].
NARROWEST_BIN = 1e-9
# Readings so much less likely than the likeliest are left out of what is expected.
NEGLIGIBLE = 1e-3
# Nothing was counted where there is less: near the least number that single precision
# holds in full, 1.2e-38.
NO_COUNT = np.float32(1e-37)


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
    share = max(float(weights[known].sum()), TINY)
    found = np.empty(values.size, dtype=np.int64)
    found[order] = np.clip(n_labels * middle / share, 0, n_labels - 1)
    # Equal values share a bin, or the order of draws would be taken for knowledge.
    _, first, same = np.unique(values[known], return_index=True, return_inverse=True)
    found[known] = found[known][first][same]
    found[~known] = n_labels
    return found


@one_thread()
def information_gain(
    heights: Float[np.ndarray, "k c n"],
    angles: Sequence[Float[np.ndarray, " n"]],
    weights: Float[np.ndarray, " n"],
    *,
    sigma: Float[np.ndarray, " c"],
    is_coarse: bool = False,
) -> Float[np.ndarray, " k"]:
    """Sum of the expected information gains about angles, of each candidate push.

        EIG = Σ J ln J - Σ_y J_y ln J_y - Σ_q J_q ln J_q,   J[q, y]

    J is the joint probability of bin q of an angle and bin y of the noisy reading.
    Draws are finite, so J is only estimated and the sum is biased upwards; its bias of
    first order in the number of draws is taken off. Of several channels the two
    directions in which the readings vary most, in units of their noise, are counted.

    Args:
        heights: Noise-free readings of every candidate, channel and draw.
        angles: Each angle of every draw; NaN where undefined.
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
    joint = joint_table(
        heights, found, weights=weights, sigma=sigma, sizes=sizes, n_labels=ends[-1]
    )
    parts = [joint.of_labels(*pair) for pair in itertools.pairwise(ends)]
    # Each by itself: what one is short of nothing is no loss to the other.
    gains = [np.maximum(_plain(part) - _bias(part), 0.0) for part in parts]
    return np.sum(gains, axis=0)


@one_thread()
def outlook(
    heights: Float[np.ndarray, "c n"],
    target: AskedAngle,
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
        step = max(float(np.ptp(values[known])) / N_FINE, NARROWEST_BIN)
        bins = (values[known] - low) / step
    fine = np.full(values.size, N_FINE, dtype=np.int64)
    fine[known] = np.clip(bins, 0, N_FINE - 1)
    table = joint_table(
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


def _plain(joint: Joint) -> Float[np.ndarray, " k"]:
    """Mutual information of label and reading, as if the table were exact [nat]."""
    table = joint.table
    return (
        _whole(_entropy(table))
        - _whole(_entropy(by_label(table)))
        - _whole(_entropy(by_reading(table)))
    )


def _whole(table: Float[np.ndarray, "k ..."]) -> Float[np.ndarray, " k"]:
    return table.reshape(table.shape[0], -1).sum(axis=1, dtype=float)


def _entropy(p: Float[np.ndarray, "*s"]) -> Float[np.ndarray, "*s"]:
    """Terms p ln p of an entropy, 0 at 0."""
    return p * np.log(np.maximum(p, NO_COUNT))


def _bias(joint: Joint) -> Float[np.ndarray, " k"]:
    """Mean of `_plain` above the truth, to first order in the number of draws [nat].

        [Σ V/J - Σ_y V_y/J_y - Σ_q V_q/J_q + V_0] / 2n

    V is n times the variance of a cell: n times the sum of squares counted there.
    """
    table, variance = joint.table, joint.variance
    of_label = by_label(table)
    one = np.broadcast_to(joint.label_variance, of_label.shape)
    return (
        _whole(_ratio(variance, table))
        - _whole(_ratio(by_reading(variance), by_reading(table)))
        - _whole(_ratio(one, of_label))
        + joint.label_variance.sum()
    ) / (2 * joint.n_draws)


def _ratio(
    over: Float[np.ndarray, "*s"], under: Float[np.ndarray, "*s"]
) -> Float[np.ndarray, "*s"]:
    """Quotient, 0 where nothing was counted."""
    return np.where(under > NO_COUNT, over / np.maximum(under, NO_COUNT), 0.0)
