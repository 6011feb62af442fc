"""The level under each push, and how far the rests beside it keep off that.

Excluded: finding the rests and their levels (`pushfit.data.peaks.rests`). What
constants do was seen in the recordings of `benchmarks.recordings.real_recordings`, and
in pushes of `benchmarks.recordings.peak_accuracy`.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from pushfit.data.peaks.blocks import N_PARTS, RestNoise, part_means
from pushfit.data.pushes.feet import SHORTEST, PerPush
from pushfit.parameters import TINY

# What parts of a rest do by more than so many sd is no chance. At two thirds chance
# makes sds of a few pushes of fifty times their noise ten times too large.
_BEYOND = 3.0
# Mean square of so many parts over that of noise.
_BY_CHANCE = 1 + _BEYOND * (2 / N_PARTS) ** 0.5
# The farthest of a wave is so many times as far off as the half beside the push. At two
# thirds, errors on slow waves grow from 1.9 to 2.3 sd. Of the smaller half of all parts
# they were 13 where four lay on the line by chance.
_FARTHEST = 3.0
# A cubic between two levels keeps off the line by this share of the time between them,
# times the difference of its slopes there.
_CUBIC = 8.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Baselines:
    """Rest level under each push, from the rests beside it and from nothing else.

        level(t) = level + slope (t - time)

    Args:
        level: Mean of the rest before the push; of that after it where the samples
            show none before, NaN where they show neither [unit].
        time: Middle of that rest [s].
        slope: Drift to the rest after the push [unit/s].
        doubt: Drift that may be a shift instead [unit/s].
        sd: Standard deviation of `level` [unit].
        sd_after: Standard deviation of the level that `slope` leads to [unit].
        time_after: Its time; NaN where there is none [s].
        bend: Standard deviation of what the level does under the push besides [unit].
        step: Level after the push, or all pushes without a rest between them, over that
            before [unit].
    """

    level: Float[np.ndarray, " p"]
    time: Float[np.ndarray, " p"]
    slope: Float[np.ndarray, " p"]
    doubt: Float[np.ndarray, " p"]
    sd: Float[np.ndarray, " p"]
    sd_after: Float[np.ndarray, " p"]
    time_after: Float[np.ndarray, " p"]
    bend: Float[np.ndarray, " p"]
    step: Float[np.ndarray, " p"]

    def drift(self, when: Float[np.ndarray, "*m p"]) -> Float[np.ndarray, "*m p"]:
        """Change of the level since `time`, at a time [s] for each push [unit]."""
        return self.slope * (when - self.time)

    def sd_at(self, when: Float[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
        """Standard deviation of the level at a time [s] for each push [unit]."""
        since = when - self.time
        share = np.where(
            self.slope == 0.0,
            0.0,
            since / np.maximum(self.time_after - self.time, SHORTEST),
        )
        own, after = (1 - share) * self.sd, share * np.nan_to_num(self.sd_after)
        return np.sqrt(own**2 + after**2 + (self.doubt * since) ** 2 + self.bend**2)


@dataclass(frozen=True, slots=True, kw_only=True)
class Off:
    """How far parts of the rests beside pushes keep off their lines.

    Args:
        square: Mean square [unit²].
        chance: That by noise [unit²].
        seen: Length of the rest [s].
        tilt: As far as they lie on another line, its slope against theirs [unit/s].
        tilt_variance: By noise; infinite where there are too few samples.
        weight: 1, or 0 there.
    """

    square: PerPush
    chance: PerPush
    seen: PerPush
    tilt: PerPush
    tilt_variance: PerPush
    weight: PerPush


@dataclass(frozen=True, slots=True)
class Parts:
    """Means of equal parts of rests, their times [s] and their numbers of samples."""

    level: Float[np.ndarray, "m p"]
    time: Float[np.ndarray, "m p"]
    n: Int[np.ndarray, "m p"]

    @classmethod
    def of(
        cls,
        time: Float[np.ndarray, " n"],
        signal: Float[np.ndarray, " n"],
        windows: Int[np.ndarray, "p 2"],
    ) -> "Parts":
        """Those of the rests before or after pushes, given by their samples."""
        level, n = part_means(signal, windows)
        return cls(level, part_means(time, windows)[0], n)

    @property
    def are_shown(self) -> Bool[np.ndarray, " p"]:
        """Whether there are as many samples as parts: fewer show nothing."""
        return self.n.min(axis=0) > 0

    def unsettled(self, rate: PerPush, noise: RestNoise) -> PerPush:
        """How far rests move, from half to half, besides their drift [sd]."""
        halves = 2, N_PARTS // 2, -1
        n = self.n.reshape(halves).sum(axis=1)
        level, when = (
            (self.n * own).reshape(halves).sum(axis=1) / np.maximum(n, 1)
            for own in (self.level, self.time)
        )
        moved = level[1] - level[0] - np.nan_to_num(rate) * (when[1] - when[0])
        chance = np.sqrt(2.0) * noise.of_part(n.min(axis=0))
        return np.where(self.are_shown, moved / (chance + TINY), 0.0)

    def off(self, base: Baselines, noise: RestNoise, side: int) -> Off:
        """How far the rests before (-1) or after pushes (1) keep off their lines."""
        is_shown, when = self.are_shown, self.time
        off = np.where(is_shown, self.level - base.level - base.drift(when), 0.0)
        # What is beyond the half beside the push may be something else, as a dip.
        near = off[N_PARTS // 2 :] if side < 0 else off[: N_PARTS // 2]
        farthest = _FARTHEST * np.sqrt((near**2).mean(axis=0))
        off = np.clip(off, -farthest, farthest)
        # Without correlation, which would hold the waves themselves.
        chance = noise.of_part(self.n) ** 2
        since = when - when.mean(axis=0)
        squares = np.maximum((since**2).sum(axis=0), SHORTEST**2)
        slopes = since / squares
        tilt = (slopes * off).sum(axis=0)
        # A wave is no tilt: what leads to another level lies on a line.
        line = tilt**2 * squares / np.maximum(off.var(axis=0) * N_PARTS, TINY)
        return Off(
            square=(off**2).mean(axis=0),
            chance=chance.mean(axis=0),
            seen=np.ptp(when, axis=0) * N_PARTS / (N_PARTS - 1),
            tilt=tilt * np.sqrt(np.minimum(line, 1.0)),
            tilt_variance=np.where(is_shown, (slopes**2 * chance).sum(axis=0), np.inf),
            weight=is_shown.astype(float),
        )


def with_waves(
    base: Baselines, before: Off, after: Off, *, own: PerPush, trust: PerPush
) -> Baselines:
    """Rest levels whose sd hold that rests wave, and bend under the pushes.

    As far as means of their parts are off the line by more than noise, and farther
    between rests that are far apart. Rests that are tilted against it bend between
    them, as a cubic would.

    Args:
        before: How far the rests before pushes keep off their lines.
        after: Those after them.
        own: 1 where the level is that of the rest before the push, else 0.
        trust: How far the rest after it shows a drift.
    """
    weights = before.weight * own, after.weight * np.where(own > 0, trust, 1.0)
    n_rests = weights[0] + weights[1]
    sums = sum(
        weight * np.stack([rest.square, rest.chance, rest.seen])
        for weight, rest in zip(weights, (before, after), strict=True)
    )
    square, chance, seen = sums / np.maximum(n_rests, TINY)
    waves = np.minimum(n_rests, 1.0) * np.maximum(square - _BY_CHANCE * chance, 0.0)
    tilt = (after.tilt - before.tilt) ** 2
    tilt -= _BEYOND**2 * (after.tilt_variance + before.tilt_variance)
    between = np.nan_to_num(own * (base.time_after - base.time))
    bend = np.maximum(tilt, 0.0) * (between / _CUBIC) ** 2
    # By the time itself as a walk, and not at all as short waves: between the two.
    longer = np.sqrt(np.maximum(between / np.maximum(seen, SHORTEST), 1.0))
    return replace(
        base,
        sd=np.sqrt(base.sd**2 + waves),
        sd_after=np.sqrt(base.sd_after**2 + waves),
        bend=np.sqrt(waves * longer + bend),
    )
