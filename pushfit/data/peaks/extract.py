"""From a recording to the table of peak heights.

Pushes are found in one channel, paired with a schedule or given the recorded angles,
and measured. What was found, doubted or left out is told in notes or refused in words.
Excluded: the ways of finding, pairing and measuring, each in its own module.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
from jaxtyping import Float

from pushfit.arguments import checked
from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.chosen_humps import (
    DEFAULTS,
    find,
    no_pushes,
    search,
)
from pushfit.data.peaks.components import (
    component_traces,
    in_signal_unit,
    looked_at,
    measure_components,
    push_signal,
    signal_name,
    stated_unit,
)
from pushfit.data.peaks.directions import off_plan, recorded_directions, turning
from pushfit.data.peaks.heights import Height, measure_heights
from pushfit.data.peaks.notes import brushes_left_out, extraction_notes
from pushfit.data.plans.pairing import Paired, pair
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.pushes.found_humps import Extent, FoundHumps
from pushfit.data.recordings.records import Recording
from pushfit.data.rows import rows_of
from pushfit.data.tables.peak_table import PeakTable
from pushfit.data.tables.traces import MAX_KEPT, ComponentTrace, Trace, envelope
from pushfit.data.units import DECIMALS, Unit
from pushfit.errors import DataError, placed_in

HeightColumns = dict[str, Sequence[float] | Sequence[str]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Heights:
    """Heights and times of pushes whose directions are not known.

    Args:
        frame: One row per push, as in a peak table but for the angles.
        notes: What there is to be told.
        cautions: Those of the notes that the user should not overlook.
        trace: The signal that they were measured in.
    """

    frame: pd.DataFrame
    notes: tuple[str, ...]
    cautions: tuple[str, ...]
    trace: Trace


@checked
def extract_peaks(
    recording: Recording,
    schedule: PushSchedule | None = None,
    *,
    settings: PeakSettings = DEFAULTS,
) -> PeakTable:
    """Measure the pushes of a recording.

    Args:
        recording: Samples, with the angles of the push where there is no schedule.
        schedule: Planned pushes; a recording of k cycles may have a schedule of one.
        settings: Where and how to look, as `[peaks]` of the settings.

    Returns:
        One row per push, flagged where the height is not to be trusted. A planned push
        that is missing has a row as well.

    Raises:
        ConfigError: The channel to look in is not named, or not there.
        DataError: There are no pushes (`no_pushes`), no directions (`no_directions`),
            or two assignments to the schedule are nearly as good (`push_mismatch`).
    """
    look = _Look.at(recording, settings)
    recording = look.recording
    paired = look.paired(schedule)
    plan = paired.plan
    if plan is None:
        n_dips = len(paired.found.dips)
        plan = recorded_directions(recording, paired.chosen, n_dips=n_dips)
        doubts = turning(recording, paired.chosen, plan)
    else:
        there = np.flatnonzero(~np.array(paired.is_missing, dtype=bool))
        shown = [paired.chosen[k] for k in there]
        doubts = off_plan(recording, shown, rows_of(plan, there))
    columns, trace = look.measured(paired)
    frame = pd.DataFrame(
        {
            "push": plan.push,
            "theta_deg": np.degrees(plan.theta).round(DECIMALS),
            "alpha_deg": np.degrees(plan.alpha).round(DECIMALS),
            "repeat": plan.repeat,
            **columns,
        }
    )
    notes, cautions = extraction_notes(paired, frame, look.settings, unit=look.unit)
    cautions = (*recording.cautions, *cautions, *doubts)
    sources = recording.sources
    if schedule is not None and schedule.source is not None:
        sources = (*sources, schedule.source)
    table = PeakTable.from_frame(
        frame, sources=sources, notes=(*recording.notes, *cautions, *notes)
    )
    return replace(table, traces=(trace,), cautions=cautions)


def measure_pushes(
    recording: Recording, *, settings: PeakSettings = DEFAULTS
) -> Heights:
    """Heights and times of the pushes of a recording whose directions are not known.

    Raises:
        ConfigError: The channel to look in is not named, or not there.
        DataError: There are no pushes (`no_pushes`).
    """
    look = _Look.at(recording, settings)
    paired = look.paired(None)
    push = np.arange(1, len(paired.chosen) + 1)
    columns, trace = look.measured(paired)
    frame = pd.DataFrame({"push": push, **columns})
    notes, cautions = extraction_notes(paired, frame, look.settings, unit=look.unit)
    cautions = (*look.recording.cautions, *cautions)
    told = (*cautions, *notes)
    return Heights(frame=frame, notes=told, cautions=cautions, trace=trace)


def within(time: Float[np.ndarray, " n"], moments: Sequence[float]) -> list[float]:
    """Moments of pushes as a table has them: none lies outside of the samples.

    Of a push that is cut or missing, feet and tops are where they would be [s].
    """
    return np.clip(moments, time[0], time[-1]).tolist()


@dataclass(frozen=True, slots=True)
class _Look:
    """A part of a recording, its signal, the humps in it, and how they were found.

    `span` is from begin to end of all that was recorded, and `whole` has the jerks.
    """

    span: tuple[float, float]
    whole: Recording
    recording: Recording
    settings: PeakSettings
    time: Float[np.ndarray, " n"]
    signal: Float[np.ndarray, " n"]
    found: FoundHumps

    @classmethod
    def at(cls, recording: Recording, settings: PeakSettings) -> "_Look":
        """Take the part and the channel that are to be looked at."""
        with placed_in(recording.place):
            whole = recording.between(settings.begin, settings.end)
            part = looked_at(recording, settings)
            settings = in_signal_unit(part, settings)
            searched = search(*push_signal(part, settings), settings)
        span = (float(recording.time[0]), float(recording.time[-1]))
        return cls(span, whole, part, settings, *searched)

    @property
    def unit(self) -> Unit:
        """Unit that the recording has the signal in: that of messages."""
        return stated_unit(self.recording, self.settings)

    def _trace(self, n_rows: int, components: tuple[ComponentTrace, ...]) -> Trace:
        """The signal that all rows were measured in."""
        time, signal = envelope(self.time, self.signal, max_points=MAX_KEPT)
        return Trace(
            path=self.recording.sources[0].path if self.recording.sources else "",
            name=signal_name(self.recording, self.settings),
            unit=self.unit.canonical,
            time=time,
            signal=signal,
            first_row=0,
            n_rows=n_rows,
            sign=-1 if self.settings.invert else 1,
            components=components,
        )

    def paired(self, schedule: PushSchedule | None) -> Paired:
        """Humps, and which of them are the planned pushes."""
        time, signal, settings = self.time, self.signal, self.settings
        paired = pair(self.found, schedule, settings, span=self.span)
        goes_down = schedule is not None and np.any(schedule.theta < 0)
        if goes_down and settings.signed is None and paired.n_odd > 0:
            both = find(time, signal, settings, signed=True)
            own = self.found
            both = replace(both, jerks=own.jerks, notches=own.notches)
            better = pair(both, schedule, settings, span=self.span)
            paired = better if paired.n_odd > better.n_odd else paired
        try:
            if all(extent.is_brush for extent in paired.found.extents):
                raise no_pushes(signal, settings, paired.found, unit=self.unit)
            paired.refuse_doubt(settings)
        except DataError as error:
            place = self.recording.place
            # What a wrong unit of the time makes of the pushes looks like none.
            told = [f"{place}: {error}" if place else str(error)]
            told += self.recording.cautions
            if error.code == "push_mismatch":
                # One of them may be what a plan is found to lack.
                told += brushes_left_out(paired, self.unit)
            error.args = ("; ".join(told),)
            raise
        return paired

    def measured(self, paired: Paired) -> tuple[HeightColumns, Trace]:
        """Height columns of a table, with what each height is, and their signal."""
        time, signal, settings = self.time, self.signal, self.settings
        chosen = paired.chosen
        turned = -1.0 if settings.invert else 1.0
        is_force = settings.normal is not None
        limit = settings.limit
        if limit is not None:
            # It is that of channels, not of their picture: a length of forces has none.
            limit = np.inf if is_force else turned * limit
        # What is left out may show where the sensor ends.
        humps = [*chosen, *paired.left_out]
        measured = measure_heights(
            time,
            signal,
            humps,
            definition=settings.height,
            limit=limit,
            is_missing=[*paired.is_missing, *[False] * len(paired.left_out)],
            course=paired.found.course,
        )
        heights = measured[: len(chosen)]
        words = [set(h.flags) for h in heights]
        if settings.use_missing:
            # What the user leaves out is no reading of a push that felt nothing.
            words = [
                own if is_excluded else own - {"missing"}
                for own, is_excluded in zip(words, paired.is_excluded, strict=True)
            ]
        times: HeightColumns = {
            "t_peak_s": within(time, [h.t_peak for h in heights]),
            "t_start_s": within(time, [e.t_start for e in chosen]),
            "t_end_s": within(time, [e.t_end for e in chosen]),
            "definition": [h.definition for h in heights],
        }
        components: tuple[ComponentTrace, ...] = ()
        if is_force:
            columns, components = self._of_components(humps, measured, words)
        else:
            unit = self.unit.canonical
            columns = {
                f"height_{unit}": [h.height for h in heights],
                f"height_sd_{unit}": [h.sd for h in heights],
                f"baseline_{unit}": [turned * h.baseline for h in heights],
            }
        flags = [";".join(sorted(own)) for own in words]
        columns = {**columns, **times, "flags": flags}
        return columns, self._trace(len(chosen), components)

    def _of_components(
        self,
        humps: Sequence[Extent],
        measured: Sequence[Height],
        words: Sequence[set[str]],
    ) -> tuple[HeightColumns, tuple[ComponentTrace, ...]]:
        """Heights of the normal and the tangential force of the first of the humps.

        Args:
            measured: Heights of all humps in the length of the force.
            words: Flags of the first, to which saturation is added.
        """
        forces = measure_components(
            self.recording,
            humps,
            measured,
            settings=self.settings,
            time=self.time,
            length=self.signal,
        )
        for own, cut in zip(words, forces.is_cut, strict=False):
            own |= {"saturated"} if cut else set()
        rows = slice(len(words))
        signed = {c: rows_of(own, rows) for c, own in forces.signed.items()}
        columns: HeightColumns = {c: v[rows] for c, v in forces.columns.items()}
        return columns, component_traces(self.whole, self.recording, signed)
