"""Whether an angle will be decided: by the pushes that are left, or by any number.

Truths are drawn from the belief; each is given all its pushes at once, and what it
would then leave of the belief is looked at. The pushes are spread over the reach, and
in a second reckoning kept to those that tell most now; the better one counts. Where so
many pushes leave weight on a handful of draws, the width is that of fewer pushes,
carried on at the rate at which it shrank: draws that ran out are no knowledge.
Excluded: which push is next (`pushfit.explore.decide.next_push`).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Float32, Int
from scipy.sparse import csr_array

from pushfit.explore.decide.gain import N_FINE, one_thread
from pushfit.explore.decide.intervals import AskedAngle, column_widths
from pushfit.parameters import HALF_TURN

# Truths: two decided ones of them are fewer than 5 %.
N_TRUTHS = 48
# More pushes than anybody makes, and fewer than make every noise vanish.
UNLIMITED = 2000
# Range of an angle that has but one value: bins have a width all the same [deg].
NARROWEST = 1e-9
# Effective draws that a width needs, and pushes by which it is taken with fewer.
ENOUGH, FEWER, MAX_ROUNDS = 40.0, 4.0, 8
# Directions that pushes are spread over, at most; more of them move no forecast. And
# those that tell most now, for the second reckoning.
N_SPREAD, N_BEST = 24, 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Imagined:
    """Pushes of several truths, seen by every draw.

    Args:
        distance: Squared distance of the predictions, in units of the noise.
        noise: What noise of one push adds to it.
        n_directions: Directions that pushes are made in, as many in each.
    """

    distance: Float32[np.ndarray, "n t"]
    noise: Float32[np.ndarray, "n t"]
    n_directions: int

    def after(
        self,
        weights: Float32[np.ndarray, " n"],
        n_each: float,
        columns: Int[np.ndarray, " r"],
    ) -> Float32[np.ndarray, "n r"]:
        """Weights after the mean of `n_each` pushes in every direction, up to a factor.

        The truth keeps its weight. A draw gains exp(z²/2) at most, where z is standard
        normal, and so none exceeds what can be represented.
        """
        distance, noise = self.distance, self.noise
        if columns.size < distance.shape[1]:
            distance, noise = (a.take(columns, axis=1) for a in (distance, noise))
        change = np.float32(-n_each / 2) * distance
        change -= np.float32(np.sqrt(n_each)) * noise
        after = np.exp(change, out=change)
        after *= weights[:, None]
        return after


@one_thread()
def imagine(
    heights: Float[np.ndarray, "k c n"],
    weights: Float[np.ndarray, " n"],
    sigma: Float[np.ndarray, " c"],
    *,
    rows: Int[np.ndarray, " r"],
    gains: Float[np.ndarray, " k"],
    rng: np.random.Generator,
) -> tuple[Imagined, ...]:
    """Plausible truths, and what pushes of each would say of every draw.

    Args:
        heights: Noise-free heights of the candidates, by channel and draw.
        weights: Weights of the draws, which sum to 1.
        sigma: Noise of a height by channel [as heights].
        gains: What each candidate tells now; picks those of the second reckoning.

    Returns:
        Pushes spread over the reach, and pushes that tell most now.
    """
    truths = rng.choice(weights.size, size=N_TRUTHS, p=weights)
    best = rows[np.argsort(-gains[rows], kind="stable")[:N_BEST]]
    n = min(rows.size, N_SPREAD)
    everywhere = rows[np.arange(n) * rows.size // n]
    return tuple(
        _imagined(
            heights[chosen] / sigma[None, :, None],
            truths,
            rng.standard_normal((chosen.size * heights.shape[1], N_TRUTHS)),
            n_directions=chosen.size,
        )
        for chosen in (everywhere, best)
    )


@one_thread()
def p_decided(
    imagined: tuple[Imagined, ...],
    weights: Float[np.ndarray, " n"],
    targets: tuple[AskedAngle, ...],
    *,
    n_pushes: int,
) -> float:
    """Share of plausible truths that some pushes would decide.

    Args:
        weights: Weights of the draws, which sum to 1.
        targets: The angles, all of which are to be decided.

    Returns:
        Probability in [0, 1], by the better way.
    """
    if n_pushes < 1:
        return 0.0
    bins = tuple(_Bins.of(target) for target in targets)
    own = weights.astype(np.float32)
    shares = []
    for way in imagined:
        found = _widths(way, own, bins, n_each=n_pushes / way.n_directions)
        wanted = np.array([target.width for target in targets])[:, None]
        shares.append(float(np.mean(np.all(found <= wanted, axis=0))))
    return max(shares)


def _imagined(
    scaled: Float[np.ndarray, "k c n"],
    truths: Int[np.ndarray, " t"],
    noise: Float[np.ndarray, "m t"],
    *,
    n_directions: int,
) -> Imagined:
    """Distances of all draws from the truths, and what noise makes of them.

    Single precision will do for them, but not for the terms that they are the
    differences of.
    """
    predicted = scaled.reshape(-1, scaled.shape[-1])
    seen = predicted[:, truths]
    both = predicted.T @ np.concatenate([seen, noise], axis=1)
    distance = -2 * both[:, : truths.size]
    distance += np.sum(seen**2, axis=0)
    distance += np.sum(predicted**2, axis=0)[:, None]
    added = np.sum(noise * seen, axis=0) - both[:, truths.size :]
    return Imagined(
        distance=distance.astype(np.float32),
        noise=added.astype(np.float32),
        n_directions=n_directions,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class _Bins:
    """Bins of an angle.

    Args:
        members: 1 where a draw lies in a bin, by bin and draw.
        step: Width of a bin [deg].
        target: The angle.
    """

    members: csr_array
    step: float
    target: AskedAngle

    @classmethod
    def of(cls, target: AskedAngle) -> "_Bins":
        """Bins of the range of an angle."""
        known = np.flatnonzero(np.isfinite(target.values))
        values = target.values[known]
        low, span = 0.0, NARROWEST
        if target.is_axis:
            values, span = np.mod(values, HALF_TURN), HALF_TURN
        elif values.size:
            low, span = float(values.min()), max(float(np.ptp(values)), NARROWEST)
        # Of a quarter of the width asked for, at most, or rounding would decide.
        n = max(N_FINE, int(np.ceil(4 * span / target.width)))
        found = np.clip((values - low) / span * n, 0, n - 1).astype(int)
        ones = np.ones(known.size, dtype=np.float32)
        members = csr_array((ones, (found, known)), shape=(n, target.values.size))
        return cls(members=members, step=span / n, target=target)


def _widths(
    imagined: Imagined,
    weights: Float32[np.ndarray, " n"],
    bins: tuple[_Bins, ...],
    *,
    n_each: float,
) -> Float[np.ndarray, "a t"]:
    """Width of the interval of every angle that the pushes leave of each truth [deg].

        w(n) = w(m) (m / n)^p,   p = ln[w(m / 4) / w(m)] / ln 4 in [0, 1/2]

    m is n, or fewer pushes where so many leave too few draws.
    """
    n_truths = imagined.distance.shape[1]
    widths = np.full((len(bins), n_truths), np.inf)
    columns, n = np.arange(n_truths), n_each
    for attempt in range(MAX_ROUNDS):
        after = imagined.after(weights, n, columns)
        is_enough = _sums(after) ** 2 / _sums(after**2) >= ENOUGH
        if attempt == MAX_ROUNDS - 1:
            is_enough[:] = True
        own = columns[is_enough]
        if own.size:
            found = _narrowest(bins, after.compress(is_enough, axis=1))
            if attempt:
                before = _narrowest(bins, imagined.after(weights, n / FEWER, own))
                # Where there is no interval yet there is no rate either.
                both = np.isfinite(before) & (found > 0) & np.isfinite(found)
                ratio = np.divide(before, found, out=np.ones_like(found), where=both)
                rate = np.clip(np.log(ratio) / np.log(FEWER), 0.0, 0.5)
                found = found * (n / n_each) ** rate
            widths[:, own] = found
        columns, n = columns[~is_enough], n / FEWER
        if not columns.size:
            break
    return widths


def _narrowest(
    bins: tuple[_Bins, ...], after: Float32[np.ndarray, "n t"]
) -> Float[np.ndarray, "a t"]:
    """Width of the shortest interval of every angle and posterior [deg]."""
    total = _sums(after)
    tables = [np.asarray(own.members @ after, dtype=float) / total for own in bins]
    return np.stack(
        [
            column_widths(
                table, own.target.prob, step=own.step, is_axis=own.target.is_axis
            )
            for own, table in zip(bins, tables, strict=True)
        ]
    )


def _sums(table: Float32[np.ndarray, "n t"]) -> Float32[np.ndarray, " t"]:
    """Sum of every column; by a product of matrices, which takes a fifth as long."""
    return np.ones(table.shape[0], table.dtype) @ table
