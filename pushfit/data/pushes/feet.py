"""What is known of the course of a push in time: its rests, and whether it is cut.

Excluded: how it is traced (`pushfit.data.pushes.tracing`) and the levels of the rests
(`pushfit.data.peaks.rests`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Generic, TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int

from pushfit.data.pushes.course import View

# Level of the foot, where a push begins and ends, as a share of its height.
FOOT = 0.05
# Smoothing by a tenth of the width at half height lowers the top of a triangle by 2 %.
WIDTH_PER_SMOOTHING = 10.0
# The signal is on its way before it passes the foot: by a ninth of the way to half
# height on a straight flank, by more on a curved one.
_GUARD = 0.35
# A rest is looked at for this share of the width, at most for so long [s]: an old
# baseline is no better than a fresh one, and the next push may be near.
_SPAN, LONGEST = 0.6, 1.0
_FEWEST = 8
# What is lower than this share of a push is rest to it, found or not.
_WIGGLE = 0.1
# Sensors recover after a release.
_SETTLING = 0.4
# Less of a rest than this share of what is wanted shows no level.
LEAST = 0.25
# Share of the height by which drift may move a rest; sensors and grasps are shifted by
# more.
SHIFT = 0.08
# Height over the noise that makes feet clear, and the share of the width that may be
# smoothed over to get there.
CLEAR, _MOST_SMOOTHING = 30.0, 3.0
# So many times the noise is no foot; at most this share of a height is hidden by it.
SIGMAS, _MOST_HIDDEN = 3.0, 0.75
# A push begins a ninth of the way to half height before it passes the foot; so many
# samples of rest show that it had not begun.
_BEGINS, _SHOWN = 0.11, 3

Number = TypeVar("Number", float, np.ndarray)
Numbers = Float[np.ndarray, " p"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Feet(Generic[Number]):
    """The course of one push in time, or of many at once [s].

    Args:
        start: Passes the foot on the way up.
        half_up: Passes half of the height on the way up.
        peak: Is highest, smoothed.
        half_down: Passes half of the height on the way down.
        end: Passes the foot on the way down.
        height: Smoothed top over the higher of the two rests [unit].
        moved: Rest after it over the rest before it, where both are seen [unit].
        step: Usual sampling step around it [s].
        sigma: Noise of a sample in it [unit].
    """

    start: Number
    half_up: Number
    peak: Number
    half_down: Number
    end: Number
    height: Number
    moved: Number
    step: Number
    sigma: Number

    @staticmethod
    def together(feet: "Sequence[Feet[float]]") -> "Feet[np.ndarray]":
        """Courses of several pushes as arrays."""
        return Feet(**{n: np.array([getattr(own, n) for own in feet]) for n in _NAMES})

    def apart(self: "Feet[np.ndarray]") -> "tuple[Feet[float], ...]":
        """Courses of several pushes one by one."""
        rows = zip(*(getattr(self, n).tolist() for n in _NAMES), strict=True)
        return tuple(Feet(**dict(zip(_NAMES, row, strict=True))) for row in rows)

    def where(
        self: "Feet[np.ndarray]",
        kept: Bool[np.ndarray, " p"],
        other: "Feet[np.ndarray]",
    ) -> "Feet[np.ndarray]":
        """Courses of some pushes, and of the rest from another record."""
        rows = ((getattr(self, n), getattr(other, n)) for n in _NAMES)
        both = (np.where(kept, *row) for row in rows)
        return Feet(**dict(zip(_NAMES, both, strict=True)))

    @property
    def width(self) -> Number:
        """Time above half of the height [s]."""
        return self.half_down - self.half_up

    def rows(
        self: "Feet[np.ndarray]", some: Int[np.ndarray, " q"]
    ) -> "Feet[np.ndarray]":
        """Courses of some pushes."""
        return Feet(**{n: getattr(self, n)[some] for n in _NAMES})

    def averaging(self: "Feet[np.ndarray]", view: View) -> Numbers:
        """Times to average over: a share of the width, and more to rise from noise [s].

        An averaging time that is asked for takes their place.
        """
        if view.smoothing is not None:
            return np.full(len(self.start), view.smoothing)
        blurred = np.minimum(CLEAR * self.sigma / np.maximum(self.height, 1e-300), 1e6)
        least = np.minimum(self.step * blurred**2, self.width / _MOST_SMOOTHING)
        return np.maximum.reduce([self.width / WIDTH_PER_SMOOTHING, least, self.step])

    def noise(self: "Feet[np.ndarray]", tau: Numbers) -> Numbers:
        """Noise of means over times [s] [unit]."""
        return self.sigma * np.sqrt(np.minimum(1.0, self.step / tau))

    def room(
        self: "Feet[np.ndarray]", time: Float[np.ndarray, " n"]
    ) -> tuple[Numbers, Numbers]:
        """Halves of rests beside pushes in order: a cut between takes nothing [s]."""
        n = len(self.start)
        end, start = np.append(self.end, np.nan), np.append(self.start, np.nan)
        earlier, later = self._neighbours(-1), self._neighbours(1)
        lowest = np.where(earlier < 0, time[0], (end[earlier] + self.start) / 2)
        highest = np.where(later == n, time[-1], (self.end + start[later]) / 2)
        return np.minimum(lowest, self.start), np.maximum(highest, self.end)

    def _neighbours(self: "Feet[np.ndarray]", step: int) -> Int[np.ndarray, " p"]:
        """Next pushes in one direction; what is far lower is but a wiggle of a rest."""
        found = np.arange(len(self.start)) + step
        height = np.concatenate([self.height, [np.inf]])
        while (is_wiggle := height[found] < _WIGGLE * self.height).any():
            found[is_wiggle] += step
        return found

    def before(self: "Feet[np.ndarray]", lowest: Numbers) -> tuple[Numbers, Numbers]:
        """Stretches whose level is the rest before the pushes, in their room [s]."""
        # In a short rest a part of it has to do.
        guard = np.minimum(
            _GUARD * (self.half_up - self.start), (self.start - lowest) / 2
        )
        last = self.start - guard
        return np.minimum(np.maximum(last - self.span, lowest), last), last

    def after(
        self: "Feet[np.ndarray]", highest: Numbers, *, waited: float = 0.5
    ) -> tuple[Numbers, Numbers]:
        """Stretches whose level is the rest after the pushes [s].

        Args:
            highest: Ends of their room [s].
            waited: Share of a short room that sensors may take to recover.
        """
        wait = np.maximum(_GUARD * (self.end - self.half_down), self.settling)
        first = self.end + np.minimum(wait, waited * (highest - self.end))
        return first, np.maximum(np.minimum(first + self.span, highest), first)

    @property
    def settling(self: "Feet[np.ndarray]") -> Numbers:
        """Times that a sensor takes to recover after the pushes [s]."""
        return _SETTLING * np.minimum(self.width, LONGEST)

    @property
    def span(self: "Feet[np.ndarray]") -> Numbers:
        """Times that rests are looked at for [s]."""
        return np.maximum(_SPAN * np.minimum(self.width, LONGEST), _FEWEST * self.step)


_NAMES = tuple(field.name for field in fields(Feet))


def likeness(moved: Numbers, far: Numbers | float) -> Numbers:
    """Whether moves of rests may be drift: 1 for small ones, 0 for those too `far`."""
    return 1 / (1 + np.clip(moved / np.maximum(far, 1e-300), -1e3, 1e3) ** 4)


def are_cut(view: View, feet: Feet[np.ndarray]) -> Bool[np.ndarray, " p"]:
    """Whether the samples begin or end before a rest is seen beside each push.

    The pushes are all there are, in order.
    """
    time = view.time
    # Noise hides more of a flank than what lies below the foot.
    noise = SIGMAS * feet.noise(feet.averaging(view))
    hidden = np.clip(noise / np.maximum(feet.height, 1e-300), FOOT, _MOST_HIDDEN)
    more = (hidden - FOOT) / (1 - hidden)
    early = feet.start - _BEGINS * (feet.half_up - feet.start)
    early -= more * (feet.peak - feet.start)
    late = feet.end + _BEGINS * (feet.end - feet.half_down)
    late += more * (feet.end - feet.peak)
    shown = np.searchsorted(time, [early, late])
    lowest, highest = feet.room(time)
    is_first, is_last = lowest <= time[0], highest >= time[-1]
    # A level over that of the other rest is one on the way, unless drift leads there
    # or it is held for as long as the push.
    length = np.maximum(feet.end - feet.start, feet.step)
    drift = length * _usual_rate(feet.rows(np.flatnonzero(~(is_first | is_last))))
    high = FOOT * feet.height
    is_high = np.stack([drift - feet.moved > high, feet.moved - drift > high])
    is_high &= np.stack([feet.start - time[0], time[-1] - feet.end]) < feet.width
    begins = (shown[0] < _SHOWN) | is_high[0] | (feet.start >= feet.half_up)
    ends = (len(time) - shown[1] < _SHOWN) | is_high[1] | (feet.end <= feet.half_down)
    return (is_first & begins) | (is_last & ends)


def _usual_rate(feet: Feet[np.ndarray]) -> float:
    """Drift of the rests beside pushes: a median, a long push for more [unit/s]."""
    length = np.maximum(feet.end - feet.start, feet.step)
    if length.size == 0:
        return 0.0
    rates = feet.moved / length
    order = np.argsort(rates)
    up_to = np.cumsum(length[order])
    return float(rates[order][np.searchsorted(up_to, up_to[-1] / 2)])
