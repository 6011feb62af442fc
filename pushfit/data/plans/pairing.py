"""Humps of a recording as the pushes of a plan, also those that are missing.

A push that the plan has and the recording does not show is measured where it was to be:
that it felt next to nothing is a result. Excluded: which hump is which push
(`pushfit.data.plans.alignment`) and how a mismatch is put into words
(`pushfit.data.plans.mismatch`).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pushfit.config.inputs import PeakSettings
from pushfit.data.plans.alignment import Alignment, align
from pushfit.data.plans.mismatch import mismatch_error, push_name
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.pushes.feet import Feet
from pushfit.data.pushes.found_humps import Extent, FoundHumps, is_in
from pushfit.data.rows import rows_of
from pushfit.data.text.faults import listed
from pushfit.data.units import Unit
from pushfit.errors import stated

# A hump so many times briefer than most is told of: of hands and robots none is.
_BRIEF = 4.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Paired:
    """Pushes in the order of the rows of a table, which is that of the schedule.

    Args:
        found: All humps.
        chosen: Extents of the rows, those of missing pushes where they were to be.
        is_missing: Whether each row has no hump.
        is_excluded: Whether each row was to be in a window that the user leaves out.
        plan: Directions of the rows; None where no schedule was given.
        schedule: What was given, in the order of its times.
        alignment: Pairs of humps and planned pushes of that order.
    """

    found: FoundHumps
    chosen: tuple[Extent, ...]
    is_missing: tuple[bool, ...]
    is_excluded: tuple[bool, ...]
    plan: PushSchedule | None
    schedule: PushSchedule | None
    alignment: Alignment | None

    @property
    def left_out(self) -> tuple[Extent, ...]:
        """Humps that are no rows."""
        return self.found.beside(self.chosen)

    @property
    def n_odd(self) -> float:
        """Pushes missing or too many; infinite where nothing was paired."""
        return np.inf if self.alignment is None else float(self.alignment.n_odd)

    def refuse_doubt(self, settings: PeakSettings) -> None:
        """Refuse an assignment that is not the only one, or by another's schedule.

        Args:
            settings: Whether the user wants the likeliest one all the same.

        Raises:
            DataError: Another assignment is nearly as good, or several runs through
                the schedule leave the pushes of one missing or over (`push_mismatch`).
        """
        if self.schedule is None or self.alignment is None or settings.allow_missing:
            return
        if self.alignment.is_in_doubt:
            raise mismatch_error(self.schedule, self.alignment, self.found.extents)

    def notes(self) -> list[str]:
        """What the pairing took for granted."""
        notes = []
        if self.alignment is not None and self.alignment.n_cycles > 1:
            n = self.alignment.n_cycles
            notes.append(f"the recording runs {n} times through the schedule")
        if any(extent.sign < 0 for extent in self.found.extents):
            notes.append("pushes go both ways from rest; heights of dips are negative")
        return notes

    def cautions(self, unit: Unit) -> list[str]:
        """What is missing, too many, out of order, or so small as to be no push."""
        if self.schedule is None or self.alignment is None:
            return []
        error = mismatch_error(self.schedule, self.alignment, self.found.extents)
        lines = [problem.message for problem in error.problems]
        if not self.schedule.is_numbered_in_order and self.schedule.time is None:
            lines.append(
                "the rows of the schedule are not in the order of their push numbers; "
                "pushes are paired in the order of the rows: sort them by push if they "
                "were made in that order, or state time_s"
            )
        bumps = [self.found.extents[j] for j in self.alignment.off_beat]
        if bumps:
            when = listed([f"{bump.t_peak:.2f} s" for bump in bumps])
            lines.append(
                "as many humps as planned are paired in order, but the rhythm would "
                f"be more even without those at {when}. Look whether they are "
                "pushes; leave out what is none, where another one is missing, by "
                f"{stated(exclude=[bump.window for bump in bumps])}"
            )
        plan = self.schedule.repeated(self.alignment.n_cycles)
        taken = [self.found.extents[j] for j in self.alignment.hump if j >= 0]
        usual = float(np.median([extent.width for extent in taken])) if taken else 0.0
        for i, j in enumerate(self.alignment.hump):
            if j < 0:
                continue
            extent = self.found.extents[j]
            if _BRIEF * extent.width < usual:
                lines.append(
                    f"{push_name(plan, i)} is taken to be the hump at "
                    f"{extent.t_peak:.2f} s, which lasts {extent.width:.2g} s at half "
                    f"its height where most last {usual:.2g} s; leave it out, if it is "
                    f"no push, by {stated(exclude=[extent.window])}"
                )
            elif extent.is_brush:
                lines.append(
                    f"{push_name(plan, i)} is taken to be the hump of only "
                    f"{unit.shown(extent.height)} at {extent.t_peak:.2f} s, far "
                    "smaller than the others; leave it out by "
                    f"{stated(exclude=[extent.window])}"
                )
        return lines


def pair(
    found: FoundHumps,
    schedule: PushSchedule | None,
    settings: PeakSettings,
    *,
    span: tuple[float, float],
) -> Paired:
    """Give the humps their planned pushes.

    Args:
        schedule: Planned pushes; None where directions are recorded or not known.
        span: Begin and end of the recording, also where humps of but a part of it are
            looked for: a plan is one of the whole [s].
    """
    pushes = [k for k, e in enumerate(found.extents) if not e.is_brush]
    if schedule is None or not pushes:
        return Paired(
            found=found,
            chosen=tuple(found.extents[k] for k in pushes),
            is_missing=(False,) * len(pushes),
            is_excluded=(False,) * len(pushes),
            plan=None,
            schedule=schedule,
            alignment=None,
        )
    order = schedule.order
    schedule = rows_of(schedule, order)
    alignment = _aligned(found, schedule, span)
    plan = schedule.repeated(alignment.n_cycles)
    left_out = found.beside([found.extents[j] for j in alignment.hump if j >= 0])
    rows, extents, is_excluded = [], [], []
    seen = found.course.time
    first = schedule.n_pushes * np.arange(alignment.n_cycles)
    for i in (first[:, None] + np.argsort(order)).ravel().tolist():
        hump, when = int(alignment.hump[i]), float(alignment.expected[i])
        if hump >= 0:
            extents.append(found.extents[hump])
            is_excluded.append(False)
        elif seen[0] < when < seen[-1]:
            there = _where_it_was_to_be(when, found, pushes, left_out)
            extents.append(there)
            is_out = there in found.excluded and not there.is_low
            times = (when, there.t_peak)
            is_excluded.append(is_out or is_in(times, settings.exclude))
        else:
            continue
        rows.append(i)
    index = np.array(rows, dtype=int)
    return Paired(
        found=found,
        chosen=tuple(extents),
        is_missing=tuple(bool(alignment.hump[i] < 0) for i in rows),
        is_excluded=tuple(is_excluded),
        plan=rows_of(plan, index),
        schedule=schedule,
        alignment=alignment,
    )


def _aligned(
    found: FoundHumps, schedule: PushSchedule, span: tuple[float, float]
) -> Alignment:
    """Which humps are which pushes; what the recording cuts may be none of them."""

    def alignment(humps: Sequence[Extent]) -> Alignment:
        return align(
            np.array([extent.middle for extent in humps]),
            [extent.is_brush for extent in humps],
            plan=schedule,
            span=span,
            begin=float(found.course.time[0]),
            left_out=[extent.middle for extent in found.excluded],
            heights=np.array([extent.height for extent in humps]),
            starts=np.array([extent.t_start for extent in humps]),
        )

    humps = found.extents
    cut = [k for k, e in enumerate(humps) if e.is_cut and not e.is_brush]
    whole = [k for k in range(len(humps)) if k not in cut]
    if cut and sum(not humps[k].is_brush for k in whole) == schedule.n_pushes:
        pairs = alignment([humps[k] for k in whole])
        if pairs.n_odd == 0 and pairs.other is None and not pairs.off_beat:
            # As where a step of the rest level ends a recording of whole pushes.
            return replace(pairs, hump=np.array(whole)[pairs.hump], extra=tuple(cut))
    return alignment(humps)


def _where_it_was_to_be(
    when: float, found: FoundHumps, pushes: list[int], left_out: Sequence[Extent]
) -> Extent:
    """Extent of a push that is missing: of what is left out there, or as the others."""
    others = [found.extents[k] for k in pushes]
    before = float(np.median([e.middle - e.t_start for e in others]))
    after = float(np.median([e.t_end - e.middle for e in others]))
    there = [e for e in left_out if when - before < e.middle < when + after]
    if there:
        return min(there, key=lambda e: abs(e.middle - when))
    half = float(np.median([e.width for e in others])) / 2
    start, end = when - before, when + after
    humps = (*found.extents, *found.excluded)
    last = max((e.t_end for e in humps if e.t_peak < when), default=-np.inf)
    first = min((e.t_start for e in humps if e.t_peak >= when), default=np.inf)
    feet = Feet(
        start=start,
        half_up=max(when - half, start),
        peak=when,
        half_down=min(when + half, end),
        end=end,
        lowest=min(start, (start + last) / 2),
        highest=max(end, (end + first) / 2),
        height=float(np.median([e.height for e in others])),
        moved=0.0,
        step=others[0].feet.step,
        sigma=others[0].feet.sigma,
    )
    return Extent(start=0, end=1, feet=feet, is_brush=False, is_cut=False)
