"""Whether an angle will be decided: by the pushes that are left, or by any number.

Truths are drawn from the belief; each is given all its pushes at once, and what it
would then leave of the belief is looked at. The pushes are spread over the reach, and
in a second reckoning kept to those that tell most now; the better one counts. Where so
many pushes leave weight on a handful of draws, the width is that of fewer pushes,
carried on at the rate at which it shrank: draws that ran out are no knowledge.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from pushfit.explore.decide.gain import N_FINE
from pushfit.explore.decide.intervals import HALF_TURN, Target, column_widths

# Truths: two decided ones of them are fewer than 5 %.
N_TRUTHS = 48
# More pushes than anybody makes, and fewer than make every noise vanish.
UNLIMITED = 2000
# Effective draws that a width needs, and pushes by which it is taken with fewer.
ENOUGH, FEWER, MAX_ROUNDS = 40.0, 4.0, 8
# Directions that pushes are spread over, at most; more of them move no forecast. And
# those that tell most now, for the second reckoning.
N_SPREAD, N_BEST = 48, 4


def p_decided(
    heights: Float[np.ndarray, "k c n"],
    weights: Float[np.ndarray, " n"],
    sigma: Float[np.ndarray, " c"],
    targets: tuple[Target, ...],
    *,
    n_pushes: int,
    gains: Float[np.ndarray, " k"],
    rng: np.random.Generator,
) -> float:
    """Share of plausible truths that some pushes would decide.

    Args:
        heights: Noise-free heights of the candidates, by channel and draw.
        weights: Weights of the draws, which sum to 1.
        sigma: Noise of a height by channel [as heights].
        targets: The angles, all of which are to be decided.
        n_pushes: Pushes to be made.
        gains: What each candidate tells now; picks those of the second reckoning.
        rng: Source of randomness.

    Returns:
        Probability in [0, 1].
    """
    if n_pushes < 1:
        return 0.0
    truths = rng.choice(weights.size, size=N_TRUTHS, p=weights)
    best = np.argsort(-gains, kind="stable")[:N_BEST]
    k = heights.shape[0]
    everywhere = np.arange(min(k, N_SPREAD)) * k // min(k, N_SPREAD)
    shares = []
    for chosen in (everywhere, best):
        imagined = _imagine(
            heights[chosen] / sigma[None, :, None],
            truths,
            rng.standard_normal((chosen.size * heights.shape[1], N_TRUTHS)),
        )
        is_decided = np.ones(N_TRUTHS, dtype=bool)
        for target in targets:
            found = _widths(imagined, weights, target, n_each=n_pushes / chosen.size)
            is_decided &= found <= target.width
        shares.append(float(np.mean(is_decided)))
    return max(shares)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Imagined:
    """Pushes of several truths, seen by every draw.

    Args:
        distance: Squared distance of the predictions, in units of the noise.
        noise: What noise of one push adds to it.
    """

    distance: Float[np.ndarray, "t n"]
    noise: Float[np.ndarray, "t n"]

    def after(
        self,
        weights: Float[np.ndarray, " n"],
        n_each: float,
        rows: Int[np.ndarray, " r"],
    ) -> Float[np.ndarray, "r n"]:
        """Weights after the mean of `n_each` pushes in every direction."""
        distance, noise = self.distance[rows], self.noise[rows]
        log_weights = -n_each / 2 * distance - np.sqrt(n_each) * noise
        log_weights -= log_weights.max(axis=1, keepdims=True)
        after = weights * np.exp(log_weights)
        return after / after.sum(axis=1, keepdims=True)


def _imagine(
    scaled: Float[np.ndarray, "k c n"],
    truths: Int[np.ndarray, " t"],
    noise: Float[np.ndarray, "m t"],
) -> _Imagined:
    """Distances of all draws from the truths, and what noise makes of them."""
    predicted = scaled.reshape(-1, scaled.shape[-1])
    seen = predicted[:, truths]
    distance = (
        np.sum(seen**2, axis=0)[:, None]
        - 2 * seen.T @ predicted
        + np.sum(predicted**2, axis=0)
    )
    added = np.sum(noise * seen, axis=0)[:, None] - noise.T @ predicted
    return _Imagined(distance=distance, noise=added)


def _widths(
    imagined: _Imagined,
    weights: Float[np.ndarray, " n"],
    target: Target,
    *,
    n_each: float,
) -> Float[np.ndarray, " t"]:
    """Width of the interval that the pushes leave of each truth [deg].

        w(n) = w(m) (m / n)^p,   p = ln[w(m / 4) / w(m)] / ln 4 in [0, 1/2]

    m is n, or fewer pushes where so many leave too few draws.
    """
    widths = np.full(imagined.distance.shape[0], np.inf)
    rows, n = np.arange(widths.size), n_each
    for attempt in range(MAX_ROUNDS):
        after = imagined.after(weights, n, rows)
        is_enough = 1 / np.sum(after**2, axis=1) >= ENOUGH
        if attempt == MAX_ROUNDS - 1:
            is_enough[:] = True
        own = rows[is_enough]
        if own.size:
            found = _narrowest(after[is_enough], target)
            if attempt:
                less = imagined.after(weights, n / FEWER, own)
                before = _narrowest(less, target)
                # Where there is no interval yet there is no rate either.
                both = np.isfinite(before) & (found > 0) & np.isfinite(found)
                ratio = np.divide(before, found, out=np.ones_like(found), where=both)
                rate = np.clip(np.log(ratio) / np.log(FEWER), 0.0, 0.5)
                found = found * (n / n_each) ** rate
            widths[own] = found
        rows, n = rows[~is_enough], n / FEWER
        if not rows.size:
            break
    return widths


def _narrowest(
    after: Float[np.ndarray, "t n"], target: Target
) -> Float[np.ndarray, " t"]:
    """Width of the shortest interval of each posterior [deg]."""
    known = np.isfinite(target.values)
    if not np.any(known):
        return np.full(after.shape[0], np.inf)
    values = target.values[known]
    low, span = float(values.min()), max(float(np.ptp(values)), 1e-9)
    if target.is_axis:
        values, low, span = np.mod(values, HALF_TURN), 0.0, HALF_TURN
    # Bins of a quarter of the width asked for, at most, or rounding would decide.
    n_bins = max(N_FINE, int(np.ceil(4 * span / target.width)))
    bins = np.clip((values - low) / span * n_bins, 0, n_bins - 1).astype(int)
    table = np.stack(
        [np.bincount(bins, row[known], minlength=n_bins) for row in after], axis=1
    )
    return column_widths(table, target.prob, step=span / n_bins, is_axis=target.is_axis)
