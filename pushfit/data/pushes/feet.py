"""What is known of the course of a push in time: its rests, and whether it is cut.

Excluded: how it is traced (`pushfit.data.pushes.tracing`) and the levels of the rests
(`pushfit.data.peaks.rests`). What constants do at half and at twice was seen in the
recordings of `benchmarks.recordings.real_recordings`, and in pushes of
`benchmarks.recordings.peak_accuracy`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Generic, TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int

from pushfit.data.pushes.running_means import View
from pushfit.data.rows import rows_of
from pushfit.parameters import TINY

# Level of the foot, where a push begins and ends, as a share of its height. At half one
# of 5 pushes of `short_dropouts` is lost; at twice one of `trial2` looks held.
FOOT = 0.05
# Smoothing by a tenth of the width at half height lowers the top of a triangle by
# 2.5 %. By a fifth, one push too many is found in `trial2`.
WIDTH_PER_SMOOTHING = 10.0
# The signal is on its way before it passes the foot: by a ninth of the way to half
# height on a straight flank, by more on a curved one; `trial2` shows it.
GUARD = 0.35
# A rest is looked at for this share of the width, at most for so long [s]: an old
# baseline is no better than a fresh one, and the next push may be near.
_SPAN, LONGEST = 0.6, 1.0
# But for so many samples at least: half or twice moves heights of `short_dropouts`.
_FEWEST = 8
# What is lower than this share of a push is rest to it, found or not. At half, wiggles
# move 8 of 18 heights of the soft skin at 0.5 N; at twice, low pushes become rests.
_WIGGLE = 0.1
# What is briefer than this share of it may be so many times as high. At half of the
# first, bumps of the soft skin are pushes in some cuts; at twice a push of
# `short_dropouts` is a bump. The second at 1.2 or 3 changes no real recording.
_BRIEF, _HIGHER = 0.25, 1.5
# So it rises beside a neighbour: by more than a foot, which is counted from the mean of
# a rest instead of its lowest. Seen where recordings are cut.
_RISES = 0.07
# What is seen of a neighbour for so many times as long as its way to half of its height
# is more than that flank. Half or twice changes no real recording.
_FLANKS = 2.0
# Sensors recover after a release, a BioTac for about a second: this share of the width,
# up to that of `LONGEST`, is left out of the rest. Half moves `p1_Pa`, twice `trial2`.
_SETTLING = 0.4
# Less of a rest than this share of what is wanted shows no level. At twice, a whole
# push of `testing_step` counts as cut.
LEAST = 0.25
# Stands for 0 below a fraction, or as a width, where two times are one [s]: a
# nanosecond, the finest unit that a column of time may have. Not tuned.
SHORTEST = 1e-9
# Share of the height by which drift may move a rest; sensors and grasps are shifted by
# more. Of the barometer a few heights move by up to 0.5 sd at half, 0.2 at twice.
SHIFT = 0.08
# Height over the noise that makes feet clear, and the part of the width, a third, that
# may be smoothed over to get there. At half of the first triangles of five times their
# noise are read too low by 0.22 instead of 0.09 σ; at twice a press of `p2_Pa` is lost.
CLEAR, _MOST_SMOOTHING = 30.0, 3.0
# So many times the noise is no foot: at twice, triangles of ten times their noise are
# low by 0.17 instead of 0.07 σ. At most this share of a height is hidden by it: a press
# of 72 Pa in noise of 15 Pa was lost where a recording ended 65 ms after it.
SIGMAS, _MOST_HIDDEN = 3.0, 0.75
# Height over the noise of a mean that makes a top. At half, noise is a 16th press of
# `p0_Pa`; at twice heights of `short_dropouts` move by 2.8 sd.
SEEN = 6.0
# Where a course is looked at for a neighbour, as shares of the time that may hold one.
_OUTWARD = np.linspace(0.0, 1.0, 240)
# On a straight flank a push begins (0.05 to 0.5, so) a ninth of the way to half height
# before it passes the foot; so many samples of rest show that it had not begun. Twice
# either calls a whole press of `testing_step` cut.
_BEGINS, _SHOWN = 0.11, 3
# What has this share of the slope of a flank is one: the guard takes the bend of its
# foot. Half or twice changes a cut or two of the soft skin and of `ur5_honeycomb`.
_STEEP = 1 / 3

OneOrMany = TypeVar("OneOrMany", float, np.ndarray)
PerPush = Float[np.ndarray, " p"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Feet(Generic[OneOrMany]):
    """The course of one push in time, or of many at once [s].

    Args:
        start: Passes the foot on the way up.
        half_up: Passes half of the height on the way up.
        peak: Is highest, smoothed.
        half_down: Passes half of the height on the way down.
        end: Passes the foot on the way down.
        lowest: Begin of the room before it, in which there is nothing else.
        highest: End of the room after it.
        height: Smoothed top over the higher of the two rests [unit].
        moved: Rest after it over the rest before it, where both are seen [unit].
        step: Usual sampling step in it [s].
        sigma: Noise of a sample in it [unit].
    """

    start: OneOrMany
    half_up: OneOrMany
    peak: OneOrMany
    half_down: OneOrMany
    end: OneOrMany
    lowest: OneOrMany
    highest: OneOrMany
    height: OneOrMany
    moved: OneOrMany
    step: OneOrMany
    sigma: OneOrMany

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
    def width(self) -> OneOrMany:
        """Time above half of the height [s]."""
        return self.half_down - self.half_up

    def averaging(self: "Feet[np.ndarray]", view: View) -> PerPush:
        """Times to average over: a share of the width, and more to rise from noise [s].

        An averaging time that is asked for takes their place.
        """
        if view.smoothing is not None:
            return np.full(len(self.start), view.smoothing)
        blurred = np.minimum(CLEAR * self.sigma / np.maximum(self.height, TINY), 1e6)
        least = np.minimum(self.step * blurred**2, self.width / _MOST_SMOOTHING)
        return np.maximum.reduce([self.width / WIDTH_PER_SMOOTHING, least, self.step])

    def noise(self: "Feet[np.ndarray]", tau: PerPush) -> PerPush:
        """Noise of means over times [s] [unit]."""
        return self.sigma * np.sqrt(np.minimum(1.0, self.step / tau))

    def alone(self: "Feet[np.ndarray]", view: View) -> "Feet[np.ndarray]":
        """The same, of all pushes in order, with halves of the rests beside them.

        So a cut in the middle of a rest takes nothing from either push.
        """
        lowest, highest = (self._room(view, sign) for sign in (-1, 1))
        return replace(
            self,
            lowest=np.minimum(lowest, self.start),
            highest=np.maximum(highest, self.end),
        )

    def _room(self: "Feet[np.ndarray]", view: View, sign: int) -> PerPush:
        """Ends of the rooms before pushes (-1) or after them (1) [s].

        What an end of the samples leaves of the flank of a neighbour has another foot:
        there the room ends half way to where the course rises for the push itself,
        unless that is something else that rises in between. Where more of a neighbour
        is left, it ends half way to the nearer of the two.
        """
        own, foot, half, far = (
            (self.end, self.start, self.half_up, self.end)
            if sign > 0
            else (self.start, self.end, self.half_down, self.start)
        )
        place, end = self._neighbours(sign), float(view.time[-1 if sign > 0 else 0])
        is_outer = (place < 0) | (place == len(own))
        flank = np.append(np.abs(half - foot), 0.0)[place]
        foot, half, far = (np.append(at, end)[place] for at in (foot, half, far))
        room = np.where(is_outer, end, (own + foot) / 2)
        rows = np.flatnonzero(sign * (end - far) <= self.step)
        risen = rows_of(self, rows)._risen(view, sign)
        nearer = sign * np.fmin(sign * risen, sign * foot[rows])
        is_flank = (sign * (end - half) <= _FLANKS * flank)[rows]
        risen = np.where(is_flank, risen, nearer)
        own, flank, foot = own[rows], flank[rows], foot[rows]
        most = np.maximum(np.abs(risen - own) / 2, flank)
        is_its = sign * (foot - risen) < most
        room[rows] = np.where(is_its, (own + risen) / 2, room[rows])
        return room

    def _risen(self: "Feet[np.ndarray]", view: View, sign: int) -> PerPush:
        """Where courses rise again before pushes (-1) or after them (1); NaN never."""
        own, tau = self.end if sign > 0 else self.start, self.averaging(view)
        level = np.maximum(_RISES * self.height, SEEN * self.noise(tau))
        flank = np.maximum(self.half_up - self.start, self.end - self.half_down)
        reach = 2 * (flank + self.settling + 4 * self.span + self.width)
        ends = view.time[[0, -1]]
        when = np.clip(own[:, None] + sign * reach[:, None] * _OUTWARD, *ends)
        first, last = ends[:, None, None]
        y = view.course.smooth(when, tau=tau[:, None], ends=(first, last))
        rise = y - np.minimum.accumulate(y, axis=1) - level[:, None]
        rows, k = np.arange(len(own)), np.argmax(rise > 0, axis=1)
        low, high = rise[rows, k - 1], rise[rows, k]
        share = low / np.where(k > 0, low - high, -1.0)
        passed = when[rows, k - 1] + share * (when[rows, k] - when[rows, k - 1])
        return np.where(k > 0, passed, np.nan)

    def _neighbours(self: "Feet[np.ndarray]", step: int) -> Int[np.ndarray, " p"]:
        """Next pushes in one direction; what is far lower is but a wiggle of a rest."""
        found = np.arange(len(self.start)) + step
        # What an end of the samples cuts before its top has passed has any width.
        flanks = np.stack([self.half_up - self.start, self.end - self.half_down])
        passed = np.stack([self.peak - self.start, self.end - self.peak])
        is_seen = (flanks > 0) | (passed > self.width / 2)
        width = np.where(is_seen.all(axis=0), self.width, np.inf)
        height, width = (np.append(all_, np.inf) for all_ in (self.height, width))
        least, brief = _WIGGLE * self.height, _BRIEF * self.width

        def are_wiggles() -> Bool[np.ndarray, " p"]:
            return height[found] < np.where(width[found] < brief, _HIGHER, 1) * least

        while (is_wiggle := are_wiggles()).any():
            found[is_wiggle] += step
        return found

    @property
    def are_outer(
        self: "Feet[np.ndarray]",
    ) -> tuple[Bool[np.ndarray, " p"], Bool[np.ndarray, " p"]]:
        """Whether each of all pushes in order is the first, and whether the last."""
        return self._neighbours(-1) < 0, self._neighbours(1) == len(self.start)

    @property
    def before(self: "Feet[np.ndarray]") -> tuple[PerPush, PerPush]:
        """Stretches whose level is the rest before the pushes, in their room [s]."""
        # Where the room ends the rest moves no more than it must; half of it has to do.
        room = self.start - self.lowest
        most = np.maximum(room - self.span, room / 2)
        last = self.start - np.minimum(GUARD * (self.half_up - self.start), most)
        return np.minimum(np.maximum(last - self.span, self.lowest), last), last

    def after(
        self: "Feet[np.ndarray]", *, waited: float = 0.5
    ) -> tuple[PerPush, PerPush]:
        """Stretches whose level is the rest after the pushes [s].

        Args:
            waited: Share of a short room that sensors may take to recover.
        """
        wait = np.maximum(GUARD * (self.end - self.half_down), self.settling)
        room = self.highest - self.end
        first = self.end + np.minimum(wait, np.maximum(room - self.span, waited * room))
        return first, np.maximum(np.minimum(first + self.span, self.highest), first)

    @property
    def settling(self: "Feet[np.ndarray]") -> PerPush:
        """Times that a sensor takes to recover after the pushes [s]."""
        return _SETTLING * np.minimum(self.width, LONGEST)

    @property
    def span(self: "Feet[np.ndarray]") -> PerPush:
        """Times that rests are looked at for [s]."""
        return np.maximum(_SPAN * np.minimum(self.width, LONGEST), _FEWEST * self.step)


_NAMES = tuple(field.name for field in fields(Feet))


def likeness(moved: PerPush, far: PerPush | float) -> PerPush:
    """Whether moves of rests may be drift: 1 for small ones, 0 for those too `far`."""
    return 1 / (1 + np.clip(moved / np.maximum(far, TINY), -1e3, 1e3) ** 4)


def are_cut(view: View, feet: Feet[np.ndarray]) -> Bool[np.ndarray, " p"]:
    """Whether the samples begin or end before a rest is seen beside each push.

    The pushes are all there are, in order.
    """
    time = view.time
    # Noise hides more of a flank than what lies below the foot.
    noise = SIGMAS * feet.noise(feet.averaging(view))
    hidden = np.clip(noise / np.maximum(feet.height, TINY), FOOT, _MOST_HIDDEN)
    more = (hidden - FOOT) / (1 - hidden)
    early = feet.start - _BEGINS * (feet.half_up - feet.start)
    early -= more * (feet.peak - feet.start)
    late = feet.end + _BEGINS * (feet.end - feet.half_down)
    late += more * (feet.end - feet.peak)
    shown = np.searchsorted(time, [early, late])
    is_first, is_last = feet.are_outer
    # A level over that of the other rest is one on the way, unless drift leads there
    # or it is held for as long as the push.
    length = np.maximum(feet.end - feet.start, feet.step)
    # What is beside no push is a wiggle.
    beside = [feet._neighbours(sign) for sign in (-1, 1)]
    is_push = np.isin(np.arange(len(is_first)), beside)
    inner = rows_of(feet, np.flatnonzero(is_push & ~(is_first | is_last)))
    drift = _usual_drift(inner, length)
    high = FOOT * feet.height
    is_high = np.stack([drift - feet.moved > high, feet.moved - drift > high])
    is_high &= np.stack([feet.start - time[0], time[-1] - feet.end]) < feet.width
    # So is what is too short for a rest and far from the level of the other one.
    beside = np.array([feet.before, feet.after()])
    before, after = (view.course.mean(*stretch) for stretch in beside)
    length = np.diff(beside, axis=1)[:, 0]
    is_short = length < LEAST * feet.span
    noise = SIGMAS * feet.noise(np.maximum(length.min(axis=0), feet.step))
    is_far = np.abs(after - before - drift) > np.maximum(high, noise)
    is_way = is_short & (length < length[::-1]) & is_far
    # So is what the samples leave of a rest where it is as steep as a flank.
    is_way |= (length < feet.span) & _are_steep(view, feet, beside)
    begins = (shown[0] < _SHOWN) | is_high[0] | is_way[0] | (feet.start >= feet.half_up)
    ends = (len(time) - shown[1] < _SHOWN) | is_high[1] | is_way[1]
    ends |= feet.end <= feet.half_down
    return (is_first & begins) | (is_last & ends)


def _are_steep(
    view: View, feet: Feet[np.ndarray], beside: Float[np.ndarray, "2 2 p"]
) -> Bool[np.ndarray, "2 p"]:
    """Whether the course has a flank where rests are looked for beside pushes.

    Args:
        beside: First and last times before the pushes, and after them [s].
    """
    first, last = beside[:, 0], beside[:, 1]
    third = np.maximum((last - first) / 3, feet.step)
    edges = np.linspace(first, last, 4, axis=-1)
    levels = np.stack([view.course.parts(own) for own in edges])
    rise = (levels[..., -1] - levels[..., 0]) * np.array([[1.0], [-1.0]])
    flank = np.stack([feet.half_up - feet.start, feet.end - feet.half_down])
    slope = (0.5 - FOOT) * feet.height / np.maximum(flank, feet.step)
    noise = SIGMAS * np.sqrt(2.0) * np.stack([feet.noise(own) for own in third])
    return rise > np.maximum(_STEEP * slope * 2 * third, noise)


def _usual_drift(feet: Feet[np.ndarray], over: PerPush) -> PerPush:
    """Drift of the rests over times [s], by a median rate, a long push for more [unit].

    It says nothing of times that are longer than the pushes that show it.
    """
    length = np.maximum(feet.end - feet.start, feet.step)
    if length.size == 0:
        return np.zeros_like(over)
    rates = feet.moved / length
    order = np.argsort(rates)
    up_to = np.cumsum(length[order])
    rate = rates[order][np.searchsorted(up_to, up_to[-1] / 2)]
    return rate * np.minimum(over, up_to[-1])
