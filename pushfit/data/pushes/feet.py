"""Where one push begins, is half up, and ends, by its own course alone.

The coarse search sees a recording as a whole. What is measured afterwards must not: a
push has the same feet whatever else the file holds. So each is traced again on its own
samples, smoothed by a share of its own width, over its own rests. Excluded: finding the
pushes (`pushfit.data.pushes.detection`) and the levels of their rests
(`pushfit.data.peaks.rests`).
"""

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from typing import Generic, TypeVar

import numpy as np
from jaxtyping import Bool, Float, Int

from pushfit.data.pushes.course import Course

# Level of the foot, where a push begins and ends, as a share of its height.
FOOT = 0.05
# Smoothing by a tenth of the width at half height lowers the top of a triangle by 2 %.
WIDTH_PER_SMOOTHING = 10.0
# The signal is on its way before it passes the foot: by a ninth of the way to half
# height on a straight flank, by more on a curved one.
_GUARD = 0.35
# A rest is looked at for this share of the width, at most for so long [s]: an old
# baseline is no better than a fresh one, and the next push may be near.
_SPAN, _LONGEST = 0.6, 1.0
_FEWEST = 8
# Sensors recover after a release.
_SETTLING = 0.4
# Less of a rest than this share of what is wanted shows no level.
LEAST = 0.25
# Share of the height by which drift may move a rest; sensors and grasps are shifted by
# more.
SHIFT = 0.08
# A hump that is lower than this share of the step below it is an overshoot.
ON_STEP = 0.33
_GRID, _FINE = 240, 17
_ROUNDS, _SAME, _REACH = 12, 1e-5, 2.0
# Times that the integral is kept at, for each smoothing time; and steps that the usual
# one is judged by. More would only cost time.
_KNOTS, _STEPS = 16, 250
_UNIT = np.linspace(0.0, 1.0, _FINE)
_SIGMAS = 3.0
# Height over the noise that makes feet clear, that which makes a top, and the share of
# the width that may be smoothed over to get there.
_CLEAR, _SEEN, _MOST_SMOOTHING = 30.0, 9.0, 3.0


Number = TypeVar("Number", float, np.ndarray)
Numbers = Float[np.ndarray, " p"]
Smooth = Callable[[Float[np.ndarray, "p m"]], Float[np.ndarray, "p m"]]


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
    """

    start: Number
    half_up: Number
    peak: Number
    half_down: Number
    end: Number
    height: Number
    moved: Number
    step: Number

    @staticmethod
    def together(feet: "Sequence[Feet[float]]") -> "Feet[np.ndarray]":
        """Courses of several pushes as arrays.

        Args:
            feet: One by one.
        """
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
        """Courses of some pushes, and of the rest from another record.

        Args:
            kept: Which stay.
            other: The same pushes.
        """
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
        """Courses of some pushes.

        Args:
            some: Their places.
        """
        return Feet(**{n: getattr(self, n)[some] for n in _NAMES})

    def averaging(
        self: "Feet[np.ndarray]", sigma: float, smoothing: float | None
    ) -> Numbers:
        """Times to average over: a share of the width, and more to rise from noise [s].

        Args:
            sigma: Noise of a sample [unit].
            smoothing: What is asked for; None for that of each push [s].
        """
        if smoothing is not None:
            return np.full(len(self.start), smoothing)
        blurred = np.minimum(_CLEAR * sigma / np.maximum(self.height, 1e-300), 1e6)
        least = np.minimum(self.step * blurred**2, self.width / _MOST_SMOOTHING)
        return np.maximum.reduce([self.width / WIDTH_PER_SMOOTHING, least, self.step])

    def room(
        self: "Feet[np.ndarray]", time: Float[np.ndarray, " n"]
    ) -> tuple[Numbers, Numbers]:
        """Halves of the rests beside pushes in order: a cut between takes nothing [s].

        Args:
            time: Sample times [s].
        """
        n = len(self.start)
        end, start = np.append(self.end, np.nan), np.append(self.start, np.nan)
        earlier, later = self._neighbours(-1), self._neighbours(1)
        lowest = np.where(earlier < 0, time[0], (end[earlier] + self.start) / 2)
        highest = np.where(later == n, time[-1], (self.end + start[later]) / 2)
        return np.minimum(lowest, self.start), np.maximum(highest, self.end)

    def _neighbours(self: "Feet[np.ndarray]", step: int) -> Int[np.ndarray, " p"]:
        """Next pushes in one direction; what is lower than a foot is but a wiggle."""
        found = np.arange(len(self.start)) + step
        height = np.concatenate([self.height, [np.inf]])
        while (is_wiggle := height[found] < FOOT * self.height).any():
            found[is_wiggle] += step
        return found

    def before(self: "Feet[np.ndarray]", lowest: Numbers) -> tuple[Numbers, Numbers]:
        """Stretches whose level is the rest before the pushes [s].

        Args:
            lowest: Begins of their room [s].
        """
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
        return _SETTLING * np.minimum(self.width, _LONGEST)

    @property
    def span(self: "Feet[np.ndarray]") -> Numbers:
        """Times that rests are looked at for [s]."""
        return np.maximum(_SPAN * np.minimum(self.width, _LONGEST), _FEWEST * self.step)


_NAMES = tuple(field.name for field in fields(Feet))


def trace_feet(
    time: Float[np.ndarray, " n"],
    course: Course,
    coarse: Feet[np.ndarray],
    *,
    sigma: float,
    smoothing: float | None,
) -> Feet[np.ndarray]:
    """Trace the feet of pushes from their own samples.

    Feet depend on the levels of the rests, and rests lie beyond the feet: both are
    found in turns, until nothing changes: where the search began must not matter.

    Args:
        time: Sample times [s].
        course: Running means of the samples [unit].
        coarse: Where all of their pushes are, in order, roughly.
        sigma: Noise of a sample [unit].
        smoothing: Averaging time; None takes a share of each width [s].

    Returns:
        The feet.
    """
    reach = 2 * _reach(coarse)
    lowest, highest = coarse.room(time)
    lowest = np.maximum(lowest, coarse.start - reach)
    highest = np.minimum(highest, coarse.end + reach)
    ends = np.searchsorted(time, [lowest, highest])
    feet = replace(coarse, step=_usual_steps(time, ends))
    finest = smoothing or coarse.width.min() / WIDTH_PER_SMOOTHING
    stride = int(finest / _KNOTS / feet.step.max())
    course = course.thinned(max(1, stride))
    for _ in range(_ROUNDS):
        tau = feet.averaging(sigma, smoothing)
        was = feet
        seen = _trace(course, feet, feet.room(time), tau=tau, sigma=sigma)
        # What shrinks until it is as low as noise is held where it was more.
        is_more = seen.height >= _SEEN * sigma * np.minimum(1, feet.step / tau) ** 0.5
        feet = seen.where(is_more, feet)
        off = np.maximum(np.abs(feet.start - was.start), np.abs(feet.end - was.end))
        if np.all(off <= _SAME * feet.step):
            break
    return feet


def _usual_steps(
    time: Float[np.ndarray, " n"], ends: Int[np.ndarray, "2 p"]
) -> Numbers:
    """Median sampling steps of stretches, by the first of their steps [s]."""
    if np.diff(ends, axis=0).min() >= _STEPS:
        return np.median(np.diff(time[ends[0][:, None] + np.arange(_STEPS)]), axis=1)
    return np.array([np.median(np.diff(time[a : b + 1][:_STEPS])) for a, b in ends.T])


def _reach(feet: Feet[np.ndarray]) -> Numbers:
    """Time around pushes that their rests lie in [s]."""
    width = np.maximum(np.minimum(feet.width, 2 * _LONGEST), 4 * feet.step)
    return _REACH * width + feet.half_up - feet.start + feet.end - feet.half_down


def _trace(
    course: Course,
    feet: Feet[np.ndarray],
    ends: tuple[Numbers, Numbers],
    *,
    tau: Numbers,
    sigma: float,
) -> Feet[np.ndarray]:
    """One round: levels of the rests by the feet, then the feet by the levels."""
    reach = _reach(feet)
    lowest = np.maximum(ends[0], feet.start - reach)
    highest = np.minimum(ends[1], feet.end + reach)
    # Not beyond the room of each push: a neighbour is no part of its course.
    smooth = functools.partial(
        course.smooth, tau=tau[:, None], ends=(ends[0][:, None], ends[1][:, None])
    )
    spacing = (highest - lowest) / (_GRID - 1)
    index = np.arange(_GRID)
    when = lowest[:, None] + spacing[:, None] * index
    y = smooth(when)
    off = np.abs(when - (feet.start + feet.end)[:, None] / 2)
    # At least one point, the nearest, is inside.
    inside = off <= np.maximum((feet.end - feet.start) / 2, off.min(axis=1))[:, None]
    peak = np.argmax(np.where(inside, y, -np.inf), axis=1)
    t_peak, top = _tops(smooth, when, peak)
    before, after = _rests(course, feet, ends, y, peak, top=top, sigma=sigma)
    rises = [np.maximum(top - rest, 1e-300) for rest in (before, after)]
    noise = _SIGMAS * sigma * np.minimum(1.0, (feet.step / tau) ** 0.5)
    feet_up, feet_down = (np.maximum(FOOT * rise, noise) for rise in rises)
    is_up, is_down = index <= peak[:, None], index >= peak[:, None]
    back = when[:, ::-1], y[:, ::-1]

    start = _falls(smooth, *back, is_up[:, ::-1], before + feet_up)
    end = _falls(smooth, when, y, is_down, after + feet_down)
    # The last times below half of the height are the first ones from the foot.
    is_up &= when >= start[:, None]
    is_down &= when <= end[:, None]
    half_up = _falls(smooth, when, -y, is_up, -before - rises[0] / 2, -1)
    half_down = _falls(
        smooth, back[0], -back[1], is_down[:, ::-1], -after - rises[1] / 2, -1
    )
    return Feet(
        start=start,
        half_up=half_up,
        peak=t_peak,
        half_down=half_down,
        end=end,
        height=np.minimum(*rises),
        moved=after - before,
        step=feet.step,
    )


def _rests(
    course: Course,
    feet: Feet[np.ndarray],
    ends: tuple[Numbers, Numbers],
    y: Float[np.ndarray, "p m"],
    peak: Int[np.ndarray, " p"],
    *,
    top: Numbers,
    sigma: float,
) -> tuple[Numbers, Numbers]:
    """Levels before and after pushes, each in place of the other if that is unseen."""
    first, last = feet.before(ends[0])
    part = np.minimum(LEAST * feet.span, last - first)
    noise = sigma * np.sqrt(feet.step / np.maximum(part, feet.step))
    far = np.maximum(FOOT * feet.height, _SIGMAS * noise)
    before = _level(course, (first, last), (last - part, last), feet.span, far)
    first, last = feet.after(ends[1])
    part = np.minimum(LEAST * feet.span, last - first)
    after = _level(course, (first, last), (first, first + part), feet.span, far)
    # What the samples begin or end with is a rest only if a push stands on it.
    is_first, is_last = ends[0] <= course.time[0], ends[1] >= course.time[-1]
    no_before = is_first & _is_top(before, after, top)
    no_after = is_last & _is_top(after, before, top)
    before = np.where(no_before, np.nan, before)
    after = np.where(no_after, np.nan, after)
    # Beside a neighbour the course goes down as far as it ever does.
    index = np.arange(_GRID)
    low_before = np.where(index <= peak[:, None], y, np.inf).min(axis=1)
    low_after = np.where(index >= peak[:, None], y, np.inf).min(axis=1)
    other = np.minimum(y[:, 0], y[:, -1])
    low_before = np.where(
        is_first, np.where(np.isnan(after), other, -np.inf), low_before
    )
    low_after = np.where(is_last, np.where(np.isnan(before), other, -np.inf), low_after)
    other_before = np.fmax(after, low_before)
    other_after = np.fmax(before, low_after)
    return (
        np.where(np.isnan(before), other_before, before),
        np.where(np.isnan(after), other_after, after),
    )


def _is_top(level: Numbers, other: Numbers, top: Numbers) -> Bool[np.ndarray, " p"]:
    """Whether a level at an end of the samples is that of the push itself."""
    return top - level < ON_STEP * (level - other)


def _tops(
    smooth: Smooth, when: Float[np.ndarray, "p m"], peak: Int[np.ndarray, " p"]
) -> tuple[Numbers, Numbers]:
    """Times and heights of the highest running means beside points of a grid."""
    rows = np.arange(len(peak))
    first = when[rows, np.maximum(peak - 1, 0)]
    last = when[rows, np.minimum(peak + 1, _GRID - 1)]
    fine = first[:, None] + (last - first)[:, None] * _UNIT
    own = smooth(fine)
    k = np.argmax(own, axis=1)
    return fine[rows, k], own[rows, k]


def _level(
    course: Course,
    window: tuple[Numbers, Numbers],
    part: tuple[Numbers, Numbers],
    span: Numbers,
    far: Numbers,
) -> Numbers:
    """Means of rests, NaN where too little is there to show them.

    That of the part beside the push where the rest has another level: it has stepped.
    """
    near = course.mean(*part)
    off = course.mean(*window) - near
    level = near + likeness(off, far) * off
    return np.where(window[1] - window[0] >= LEAST * span, level, np.nan)


def likeness(moved: Numbers, far: Numbers | float) -> Numbers:
    """Whether moves of rests may be drift: 1 for small ones, 0 for large ones.

    Args:
        moved: How far rests have moved.
        far: What is too far, in the same unit.
    """
    return 1 / (1 + np.clip(moved / np.maximum(far, 1e-300), -1e3, 1e3) ** 4)


def _falls(
    smooth: Smooth,
    when: Float[np.ndarray, "p m"],
    y: Float[np.ndarray, "p m"],
    searched: Bool[np.ndarray, "p m"],
    level: Numbers,
    sign: int = 1,
) -> Numbers:
    """Where courses first fall below levels, or the last times if they never do.

    Args:
        smooth: Running means.
        when: Times, in either direction [s].
        y: Running means at `when`, times `sign`.
        searched: Where to look.
        level: Levels to pass, times `sign`.
        sign: -1 to see courses upside down.
    """
    rows = np.arange(len(level))
    below = searched & (y < level[:, None])
    first = np.argmax(searched, axis=1)
    final = len(y[0]) - 1 - np.argmax(searched[:, ::-1], axis=1)
    k = np.where(below.any(axis=1), np.argmax(below, axis=1), final)
    # Between two points of the grid, so that the grid itself does not matter.
    a, b = when[rows, np.maximum(k - 1, first)], when[rows, k]
    fine = a[:, None] + (b - a)[:, None] * _UNIT
    off = sign * smooth(fine) - level[:, None]
    j = np.maximum(np.argmax(off < 0, axis=1), 1)
    high, low = off[rows, j - 1], off[rows, j]
    share = np.clip(high / np.maximum(high - low, 1e-300), 0.0, 1.0)
    passed = fine[rows, j - 1] + share * (fine[rows, j] - fine[rows, j - 1])
    return np.where(below.any(axis=1) & (k > first), passed, b)
