"""Humps of a recording, and what is left aside of them.

Excluded: the search for them (`pushfit.data.pushes.humps`).
"""

from collections.abc import Sequence
from dataclasses import dataclass

from pushfit.data.pushes.detection import Extent
from pushfit.data.pushes.running_means import RunningMeans


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
    """

    extents: tuple[Extent, ...]
    course: RunningMeans
    dips: tuple[Extent, ...] = ()
    excluded: tuple[Extent, ...] = ()
    idle: tuple[tuple[float, float], ...] = ()
    jerks: tuple[Extent, ...] = ()

    def beside(self, taken: Sequence[Extent]) -> tuple[Extent, ...]:
        """Humps besides some of them, also those that the user left out."""
        known = set(taken)
        return tuple(e for e in (*self.extents, *self.excluded) if e not in known)


def is_in(moments: Sequence[float], windows: Sequence[tuple[float, float]]) -> bool:
    """Whether one of some times lies in one of some windows, from first to last [s]."""
    return any(first <= when <= last for when in moments for first, last in windows)
