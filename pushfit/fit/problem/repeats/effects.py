"""An offset or a gain that all heights of one repeat share: found, and how large it is.

A sensor that drifts, or a hand that presses anew, moves a whole repeat. Directions and
repeats are the two ways of a table: least squares of both effects tell one repeat from
another, and what is left is the noise of each push. How much repeats differ says how
far all of them together may be off, which none of them shows. Excluded: one effect for
several recordings, each of which has repeats of its own.
"""

from dataclasses import replace

import numpy as np
import scipy
from jaxtyping import Float, Int

from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import SettingsError
from pushfit.fit.results import ResultWarning
from pushfit.parameters import TINY

ARTICLES = {"offset": "an", "gain": "a"}
# A gain is one whose chance is at most this share of that of an offset.
PLAINLY_LIKELIER = 0.1
# Rounds of least squares for gains, each of which squares the share that is left.
N_ROUNDS = 8
# What is smaller, against the heights or their effects, is rounding.
ROUNDING = 1e-9


def without_repeat_effects(table: PeakTable, kind: str) -> PeakTable:
    """The table with heights as if all repeats had been alike.

        h = m + o,   or   h = g m,   m by direction, o and g by repeat

    Args:
        kind: "offset" or "gain".

    Raises:
        SettingsError: If no two repeats share a direction.
    """
    used = table.is_used
    direction, repeat = both_ways(table)
    if not is_crossed(direction, repeat):
        raise SettingsError(
            f'[noise] repeats = "{kind}", but no direction was pushed in two repeats; '
            f"push every direction again, state how much repeats differ ({kind}_sd), "
            'or set repeats = "alike"',
            code="no_repeats",
        )
    columns = {}
    for channel in table.channels:
        heights = table.heights(channel).copy()
        if kind == "offset":
            heights[used] -= offsets(heights[used], direction, repeat)[repeat]
        else:
            heights[used] /= gains(heights[used], direction, repeat)[repeat]
        columns[f"{channel}_{table.unit}"] = heights
    return replace(table, frame=table.frame.assign(**columns))


def effect_sds(
    before: PeakTable, after: PeakTable, kind: str, *, stated: float | None = None
) -> dict[str, Float[np.ndarray, "r n"]]:
    """Standard deviations of what heights of each repeat have in common, by channel.

        v = s,   or   v = s m,   0 in other repeats;   s² = Σ o² / ν  or  Σ (g - 1)² / ν

    Sums are over repeats, ν of which are free. So few tell s badly: it is wider by the
    ratio of the quantiles of Student-t and normal distributions, so that intervals of
    90 % for an effect hold it as often.

    Args:
        after: The same table without the effects of repeats.
        kind: "offset" or "gain".
        stated: s where it is known [table unit, or a share].
    """
    direction, repeat = both_ways(before)
    n_effects = _n_effects(direction, repeat)
    tail = float(scipy.special.stdtrit(n_effects, 0.95) / scipy.special.ndtri(0.95))
    used, found = before.is_used, {}
    is_own = np.arange(repeat.max() + 1)[:, None] == repeat
    for channel in before.channels:
        heights = after.heights(channel)[used]
        size = np.bincount(direction, heights) / np.bincount(direction)
        size = np.ones(repeat.size) if kind == "offset" else size[direction]
        s = stated
        if s is None:
            effects = _effects(before, after, channel, kind)
            s = tail * float(np.sqrt(np.sum(effects**2) / n_effects))
        found[channel] = np.zeros((len(is_own), before.n_pushes))
        found[channel][:, used] = s * size * is_own
    return found


def _effects(
    before: PeakTable, after: PeakTable, channel: str, kind: str
) -> Float[np.ndarray, " r"]:
    """What each repeat was moved by, or its factor less 1."""
    used, (_, repeat) = before.is_used, both_ways(before)
    old, new = (table.heights(channel)[used] for table in (before, after))
    size = np.ones(new.size) if kind == "offset" else new
    # Components have either sign, and may add up to nothing.
    moved = np.bincount(repeat, size * (old - new))
    return moved / np.maximum(np.bincount(repeat, size**2), TINY)


def repeat_warning(before: PeakTable, after: PeakTable, kind: str) -> ResultWarning:
    """Say how repeats differ.

    Args:
        after: The same without the effects of repeats.
        kind: "offset" or "gain".
    """
    labels = np.unique(before.frame["repeat"].to_numpy()[before.is_used])
    said = []
    for channel in before.channels:
        effects = _effects(before, after, channel, kind)
        words = (
            f"{e:+.2g}" if kind == "offset" else f"a factor of {1 + e:.3g}"
            for e in effects
        )
        each = (f"{word} ({label})" for label, word in zip(labels, words, strict=True))
        said.append(f"{channel}_{before.unit} by {', '.join(each)}")
    return ResultWarning(
        code=f"repeat_{kind}s",
        text=f"whole repeats differ, {'; '.join(said)}: each was given "
        f"{ARTICLES[kind]} {kind} of its own, and intervals allow for what all share; "
        '[noise] repeats = "alike" takes this for noise of each push',
    )


def scatter_beside_effects(table: PeakTable, channel: str) -> tuple[float, int]:
    """Scatter of repeats whose effects were taken out; see `PeakTable.pooled_sd`.

    Each effect that repeats show was fitted to the same heights, and costs a degree of
    freedom.
    """
    scatter, dof = table.pooled_sd(channel)
    left = dof - _n_effects(*both_ways(table))
    if left < 1:
        return np.nan, 0
    return float(scatter * np.sqrt(dof / left)), left


def both_ways(
    table: PeakTable,
) -> tuple[Int[np.ndarray, " n"], Int[np.ndarray, " n"]]:
    """Number of direction and of repeat of every push that is used, from 0."""
    used = table.is_used
    repeats = table.frame["repeat"].to_numpy()[used]
    _, direction = np.unique(table.groups[used], return_inverse=True)
    return direction, np.unique(repeats, return_inverse=True)[1]


def is_crossed(direction: Int[np.ndarray, " n"], repeat: Int[np.ndarray, " n"]) -> bool:
    """Whether any direction was pushed in two repeats."""
    pairs = np.unique(np.stack([direction, repeat]), axis=1)
    return bool(pairs.shape[1] > direction.max(initial=-1) + 1)


def offsets(
    heights: Float[np.ndarray, " n"],
    direction: Int[np.ndarray, " n"],
    repeat: Int[np.ndarray, " n"],
) -> Float[np.ndarray, " r"]:
    """Effects of repeats beside directions by least squares, 0 on average over all."""
    n_directions, n_repeats = direction.max() + 1, repeat.max() + 1
    rows = np.arange(heights.size)
    design = np.zeros((heights.size, n_directions + n_repeats))
    design[rows, direction] = 1.0
    design[rows, n_directions + repeat] = 1.0
    found, *_ = np.linalg.lstsq(design, heights, rcond=None)
    of_repeats = found[n_directions:]
    return of_repeats - _usual(of_repeats, direction, repeat)


def gains(
    heights: Float[np.ndarray, " n"],
    direction: Int[np.ndarray, " n"],
    repeat: Int[np.ndarray, " n"],
) -> Float[np.ndarray, " r"]:
    """Gains of repeats of the heights of directions, 1 on average over all."""
    gain, n_directions = np.ones(repeat.max() + 1), direction.max() + 1
    rows = np.arange(heights.size)
    design = np.zeros((heights.size, n_directions + len(gain)))
    for _ in range(N_ROUNDS):
        own = gain[repeat]
        mean = np.bincount(direction, own * heights) / np.bincount(direction, own**2)
        # Of both at once: in turns, what few directions connect hardly moves.
        design[rows, direction] = own
        design[rows, n_directions + repeat] = mean[direction]
        left = heights - own * mean[direction]
        gain = gain + np.linalg.lstsq(design, left, rcond=None)[0][n_directions:]
        gain = gain / _usual(gain, direction, repeat)
    return gain


def _n_effects(direction: Int[np.ndarray, " n"], repeat: Int[np.ndarray, " n"]) -> int:
    """Effects that repeats show: one of each connected part has nothing beside it."""
    return int(repeat.max() - _parts(direction, repeat).max())


def _usual(
    effect: Float[np.ndarray, " r"],
    direction: Int[np.ndarray, " n"],
    repeat: Int[np.ndarray, " n"],
) -> Float[np.ndarray, " r"]:
    """Mean of the effects over all heights connected with each repeat.

    Connected is what shares a direction or a repeat, and what is connected with that.
    """
    part = _parts(direction, repeat)
    own = part[direction]
    means = np.bincount(own, effect[repeat]) / np.maximum(np.bincount(own), 1)
    return means[part[direction.max() + 1 :]]


def _parts(
    direction: Int[np.ndarray, " n"], repeat: Int[np.ndarray, " n"]
) -> Int[np.ndarray, " k"]:
    """Number of the connected part of every direction, then of every repeat."""
    n_directions = direction.max() + 1
    n = n_directions + repeat.max() + 1
    pairs = direction, n_directions + repeat
    shared = scipy.sparse.coo_array((np.ones(repeat.size), pairs), shape=(n, n))
    return scipy.sparse.csgraph.connected_components(shared, directed=False)[1]


def repeat_effect(table: PeakTable) -> tuple[str, float]:
    """Which effect tells repeats apart, and the chance of as much where none does.

    One F test of both: twice the chance of each. An offset of all heights moves θ_c and
    a gain does not: where both tell about as much it is an offset.

    Returns:
        "offset" or "gain", and its p-value; NaN where repeats are the same, or too few.
    """
    direction, repeat = both_ways(table)
    if not is_crossed(direction, repeat):
        return "offset", np.nan
    used, n = table.is_used, table.n_pushes
    heights, noise, means = [], [], []
    for channel in table.channels:
        height, sd = table.heights(channel)[used], table.sd(channel)
        scatter = np.full(n, table.pooled_sd(channel)[0]) if sd is None else sd
        heights.append(height)
        noise.append(scatter[used])
        means.append(
            (np.bincount(direction, height) / np.bincount(direction))[direction]
        )
    # Every channel has directions and effects of its own.
    numbers = np.arange(len(heights))[:, None]
    ways = {
        name: (way + numbers * (way.max() + 1)).ravel()
        for name, way in {"direction": direction, "repeat": repeat}.items()
    }
    height, sd, mean = (np.concatenate(one) for one in (heights, noise, means))
    if not np.all(sd > 0):  # repeats are the same
        return "offset", np.nan
    chances = {
        "offset": repeat_p_value(height, np.ones(height.size), sd, **ways),
        "gain": repeat_p_value(height, mean, sd, **ways),
    }
    is_gain = chances["gain"] < PLAINLY_LIKELIER * chances["offset"]
    kind = "gain" if is_gain else "offset"
    return kind, float(np.minimum(1.0, 2 * chances[kind]))


def repeat_p_value(
    heights: Float[np.ndarray, " n"],
    size: Float[np.ndarray, " n"],
    noise: Float[np.ndarray, " n"],
    *,
    direction: Int[np.ndarray, " n"],
    repeat: Int[np.ndarray, " n"],
) -> float:
    """F test of one coefficient of a size for each repeat, within directions.

    Args:
        size: What an effect of a repeat is in proportion to: 1 for an offset, the
            height of the direction for a gain.
        noise: Standard deviations, known but for a common factor.

    Returns:
        Chance of as much where repeats are alike; NaN where there are too few, or
        nothing but rounding tells them apart.
    """
    weight = np.bincount(direction, noise**-2)

    def within(values: Float[np.ndarray, "n k"]) -> Float[np.ndarray, "n k"]:
        """What is left beside a mean for each direction, in units of the noise."""
        total = np.zeros((weight.size, values.shape[1]))
        np.add.at(total, direction, values / noise[:, None] ** 2)
        return (values - (total / weight[:, None])[direction]) / noise[:, None]

    left = within(heights[:, None])[:, 0]
    effects = size[:, None] * np.eye(repeat.max() + 1)[repeat]
    basis, scale, _ = np.linalg.svd(within(effects), full_matrices=False)
    # Repeats without a common direction cannot differ: only those that may are counted.
    whole = np.linalg.norm(effects / noise[:, None])
    basis = basis[:, scale > ROUNDING * whole]
    alone, taken = float(left @ left), float(np.sum((left @ basis) ** 2))
    n_free = basis.shape[1]
    dof = heights.size - weight.size - n_free
    is_rounding = alone <= (ROUNDING * np.linalg.norm(heights / noise)) ** 2
    if n_free < 1 or dof < 1 or is_rounding:
        return np.nan
    ratio = taken / n_free / max((alone - taken) / dof, TINY)
    return float(scipy.special.fdtrc(n_free, dof, ratio))
