"""Humps of a recording, and what is left aside of them.

Excluded: the search for them (`pushfit.data.pushes.humps`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

from pushfit.data.pushes.feet import Feet
from pushfit.data.pushes.running_means import RunningMeans


@dataclass(frozen=True, slots=True, kw_only=True)
class Extent:
    """Where one push lies.

    Args:
        start: First sample above the foot.
        end: One past the last sample above the foot.
        feet: Its course in time [s].
        is_brush: Whether it is so small among the others, or so brief beside one, that
            it may be no push, or but the return from a dip to rest.
        is_cut: Whether the signal begins or ends inside the push.
        is_low: Whether it is lower than the smallest push asked for.
        contact: Level that it holds on the way up, below which its rest is, as a share
            of its height; 0 where there is none.
        shelf: Level that it holds both before and after its top, in the same way.
        sign: 1 where the signal rises from rest, -1 where it falls.
    """

    start: int
    end: int
    feet: Feet[float]
    is_brush: bool
    is_cut: bool
    is_low: bool = False
    contact: float = 0.0
    shelf: float = 0.0
    sign: int = 1

    @property
    def t_start(self) -> float:
        """Start [s]."""
        return self.feet.start

    @property
    def t_end(self) -> float:
        """End [s]."""
        return self.feet.end

    @property
    def t_peak(self) -> float:
        """Time of the highest smoothed reading [s]."""
        return self.feet.peak

    @property
    def middle(self) -> float:
        """Middle of the time above half of the height, wherever a plateau peaks [s]."""
        return (self.feet.half_up + self.feet.half_down) / 2

    @property
    def width(self) -> float:
        """Time above half of the height [s]."""
        return self.feet.width

    @property
    def window(self) -> tuple[float, float]:
        """Begin and end, as settings take them [s]."""
        return round(float(self.t_start), 2), round(float(self.t_end), 2)

    @property
    def height(self) -> float:
        """Top over the higher of the two feet, smoothed [unit]."""
        return self.feet.height


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundHumps:
    """Humps of a recording, and what is left aside.

    Args:
        extents: The humps in order; brushes are marked.
        course: Running means of the signal that was searched [unit].
        dips: Dips that are not asked for; only where all humps go up.
        excluded: Humps that the user left out, by their time or their height.
        idle: Windows of the user's in which no hump has its top [s].
        jerks: What was far briefer than any push; its samples were left out before
            these were found.
        notches: When the signal was far lower for less than any push lasts; these
            samples were left out as well [s].
    """

    extents: tuple[Extent, ...]
    course: RunningMeans
    dips: tuple[Extent, ...] = ()
    excluded: tuple[Extent, ...] = ()
    idle: tuple[tuple[float, float], ...] = ()
    jerks: tuple[Extent, ...] = ()
    notches: tuple[float, ...] = ()

    def beside(self, taken: Sequence[Extent]) -> tuple[Extent, ...]:
        """Humps besides some of them, also those that the user left out."""
        known = set(taken)
        return tuple(e for e in (*self.extents, *self.excluded) if e not in known)


def is_in(moments: Sequence[float], windows: Sequence[tuple[float, float]]) -> bool:
    """Whether one of some times lies in one of some windows, from first to last [s]."""
    return any(first <= when <= last for when in moments for first, last in windows)
