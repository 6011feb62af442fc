"""What the page on a recording shows and its reader decides, without the page.

Humps come from the search of all commands, heights from their measurement, and both see
the very schedule and windows that are going to be saved. Excluded: drawing and serving
(`pushfit.cli.look.page`), and files.
"""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from pushfit.config import GraspConfig
from pushfit.config.inputs import PeakSettings
from pushfit.data.peaks.chosen_humps import find, no_pushes, tops
from pushfit.data.peaks.components import (
    component_traces,
    in_signal_unit,
    looked_at,
    push_signal,
    signal_name,
    stated_unit,
)
from pushfit.data.peaks.extract import Heights, extract_peaks, measure_pushes, within
from pushfit.data.plans.schedule import PushSchedule
from pushfit.data.pushes.found_humps import Extent, is_in
from pushfit.data.recordings.records import Recording
from pushfit.data.tables.columns import Origin
from pushfit.data.tables.traces import ComponentTrace, SignedHeights
from pushfit.data.units import DECIMALS
from pushfit.errors import ConfigError, DataError

# Windows are read by people; a push lasts many of these [s].
WINDOW_DECIMALS = 3
# More in one plan are a slip of the finger.
MAX_ANGLES = 1000

Window = tuple[float, float]


class Look:
    """The humps of one recording, which of them are pushes, and their directions.

    Args:
        config: Settings in force. Their windows say what counts to begin with.
        schedule: Directions to begin with; None takes those of the recording, if any.

    Attributes:
        humps: All that stand out, in order.
        counts: Whether each is a push.
        theta_deg: Elevation of each; NaN where not said [deg].
        alpha_deg: Azimuth of each; NaN where not said [deg].
        components: Force components as they were recorded, without heights; none of a
            single channel.
        notes: What became of the schedule to begin with.

    Raises:
        ConfigError: The channel to look in is not named, or not there.
        DataError: Nothing stands out (`no_pushes`), or the schedule names pushes that
            cannot be told apart from those that are missing.
    """

    def __init__(
        self,
        recording: Recording,
        config: GraspConfig,
        schedule: PushSchedule | None = None,
    ) -> None:
        """Find the humps, and give them the directions that are known."""
        self.recording, self.config = recording, config
        peaks = config.peaks
        part = looked_at(recording, peaks)
        self.time, self.signal = push_signal(part, peaks)
        self.name = signal_name(part, peaks)
        self.unit = stated_unit(part, peaks).canonical
        self.components: tuple[ComponentTrace, ...] = ()
        if peaks.normal is not None:
            whole = recording.between(peaks.begin, peaks.end)
            none = dict.fromkeys(("start", "end", "baseline", "height"), np.empty(0))
            unmeasured = dict.fromkeys(part.channels, SignedHeights(**none))
            self.components = component_traces(whole, part, unmeasured)
        self.notes: tuple[str, ...] = ()
        self.search(signed=bool(peaks.signed))
        is_recorded = recording.theta is not None and recording.alpha is not None
        if schedule is not None or is_recorded:
            self._take_directions(schedule)

    def search(self, signed: bool) -> None:
        """Find all humps anew; what was said of those before is gone."""
        told = in_signal_unit(self.recording, self.config.peaks)
        every = told.model_copy(update={"exclude": (), "include": ()})
        found = find(self.time, self.signal, every, signed=signed)
        if not found.extents:
            raise no_pushes(
                self.signal, every, found, unit=stated_unit(self.recording, told)
            )
        as_told = find(self.time, self.signal, told, signed=signed)
        pushes = {hump.t_peak for hump in as_told.extents if not hump.is_brush}
        self.signed: bool = signed
        self.humps: tuple[Extent, ...] = found.extents
        self._tops = tops(self.time, self.signal, found, settings=told)
        self.counts: list[bool] = [hump.t_peak in pushes for hump in self.humps]
        self.theta_deg: list[float] = [np.nan] * len(self.humps)
        self.alpha_deg: list[float] = [np.nan] * len(self.humps)

    def _take_directions(self, schedule: PushSchedule | None) -> None:
        """Begin with the pushes and directions that the commands would see."""
        lenient = self.config.peaks.model_copy(update={"allow_missing": True})
        table = extract_peaks(self.recording, schedule, settings=lenient)
        is_missing = np.array(["missing" in flags for flags in table.flags], dtype=bool)
        there = table.frame[~is_missing]
        if not set(self.starts).issuperset(there["t_start_s"]):
            self.search(signed=True)
        rows = there.set_index("t_start_s")[["theta_deg", "alpha_deg"]]
        for k, start in enumerate(self.starts):
            self.counts[k] = start in rows.index
            if self.counts[k]:
                theta, alpha = rows.loc[start]
                self.theta_deg[k], self.alpha_deg[k] = float(theta), float(alpha)
        self.notes = tuple(
            f"push {number} of the schedule has no hump, and is not going to be saved"
            for number in table.frame["push"][is_missing]
        )

    @property
    def heights(self) -> tuple[str, ...]:
        """Columns of the heights in what `measure` returns, without their unit."""
        if self.config.peaks.normal is None:
            return ("height",)
        return ("height_normal", "height_tangential")

    @property
    def starts(self) -> list[float]:
        """Where each hump begins, by which tables know it [s]."""
        return within(self.time, [hump.t_start for hump in self.humps])

    @property
    def pushes(self) -> list[int]:
        """Positions of the humps that count."""
        return [k for k, is_push in enumerate(self.counts) if is_push]

    def is_directed(self, hump: int) -> bool:
        """Whether both angles of a hump are known."""
        return bool(np.isfinite(self.theta_deg[hump] + self.alpha_deg[hump]))

    def at(self, when: float) -> int | None:
        """Position of the nearest hump at or a little beside a time; None at rest."""
        away = [abs(hump.t_peak - when) for hump in self.humps]
        k = int(np.argmin(away))
        hump = self.humps[k]
        first, last = hump.t_start - hump.width, hump.t_end + hump.width
        return k if first <= when <= last else None

    def toggle(self, hump: int) -> None:
        """Leave a hump out, or take it in; its angles stay."""
        self.counts[hump] = not self.counts[hump]

    def direct(self, hump: int, theta: str, alpha: str) -> None:
        """Take the angles of one hump as typed.

        Args:
            theta: Elevation, empty where unknown [deg].
            alpha: Azimuth [deg].
        """
        both = [
            angles_of(text, name)[0] if text.strip() else np.nan
            for text, name in ((theta, "theta"), (alpha, "alpha"))
        ]
        self.theta_deg[hump], self.alpha_deg[hump] = both

    def fill(
        self, theta: str, alpha: str, repeats: int, *, by_theta: bool = False
    ) -> str:
        """Give the pushes the directions of a plan, in order.

        Every azimuth in turn is pushed at all elevations, each so often in a row. A
        recording may run through the plan several times.

        Args:
            theta: Elevations, as `angles_of` reads them [deg].
            by_theta: Whether every elevation in turn is pushed at all azimuths instead.

        Raises:
            ConfigError: The texts are no angles (`angles`), or the plan has another
                number of pushes (`push_mismatch`).
        """
        azimuth, elevation = np.meshgrid(
            np.radians(angles_of(alpha, "alpha")),
            np.radians(angles_of(theta, "theta")),
            indexing="xy" if by_theta else "ij",
        )
        plan = PushSchedule.planned(elevation.ravel(), azimuth.ravel(), repeats=repeats)
        n_cycles, left = divmod(len(self.pushes), plan.n_pushes)
        if n_cycles == 0 or left:
            raise ConfigError(
                f"the plan has {plan.n_pushes} pushes and {len(self.pushes)} count; "
                "leave out or take in humps, or change the plan",
                code="push_mismatch",
            )
        plan = plan.repeated(n_cycles)
        rows = zip(self.pushes, plan.theta, plan.alpha, strict=True)
        for k, theta_rad, alpha_rad in rows:
            self.theta_deg[k] = float(np.degrees(theta_rad).round(DECIMALS))
            self.alpha_deg[k] = float(np.degrees(alpha_rad).round(DECIMALS))
        times = "once" if n_cycles == 1 else f"{n_cycles} times"
        return f"{plan.n_pushes} pushes run {times} through the plan"

    def schedule(self) -> PushSchedule:
        """Directions of the pushes as a plan, with their times.

        The times leave no doubt about which hump is which push.
        """
        rows = self.pushes
        theta = np.array([self.theta_deg[k] for k in rows])
        alpha = np.array([self.alpha_deg[k] for k in rows])
        unknown = np.flatnonzero(~np.isfinite(theta + alpha))
        if unknown.size or not rows:
            n = len(rows)
            first = f", push {unknown[0] + 1} is the first" if unknown.size else ""
            raise DataError(
                f"{unknown.size} of {n} pushes have no angles{first}; type theta and "
                "alpha, or fill them in from a plan",
                code="no_directions",
            )
        frame = pd.DataFrame({"theta_deg": theta, "alpha_deg": alpha})
        number = np.arange(1, len(rows) + 1)
        frame["push"] = number
        frame["repeat"] = frame.groupby(["theta_deg", "alpha_deg"]).cumcount() + 1
        frame["time_s"] = [self.humps[k].t_peak for k in rows]
        origin = Origin(path="pushes", lines=number)
        return PushSchedule.from_frame(frame, origin=origin)

    def settled(self) -> GraspConfig:
        """Settings by which every command finds these pushes and no others."""
        out = [not counts for counts in self.counts]
        small = [
            hump.is_brush and not o for hump, o in zip(self.humps, out, strict=True)
        ]
        windows = {
            "exclude": self._windows("exclude", out),
            "include": self._windows("include", small),
        }
        update: dict[str, object] = {key: own for key, own in windows.items() if own}
        # Windows that are not needed any more must not come back from the file.
        stated = self.config.peaks.model_fields_set & windows.keys()
        update |= {key: windows[key] for key in stated}
        if self.signed != bool(self.config.peaks.signed):
            update["signed"] = self.signed
        return self.config.with_keys("peaks", **update)

    def _windows(self, key: str, chosen: Sequence[bool]) -> tuple[Window, ...]:
        """Windows around some humps, with those of the settings in which none is."""
        kept = [
            window
            for window in getattr(self.config.peaks, key)
            if not any(is_in(own, [window]) for own in self._tops)
        ]
        own = [self._window(k) for k, is_chosen in enumerate(chosen) if is_chosen]
        return tuple(sorted([*kept, *own]))

    def _window(self, k: int) -> Window:
        """Times around the top of a hump that hold no other top."""
        hump = self.humps[k]
        first, last = hump.t_start, hump.t_end
        if k > 0:
            first = max(first, (self.humps[k - 1].t_peak + hump.t_peak) / 2)
        if k + 1 < len(self.humps):
            last = min(last, (self.humps[k + 1].t_peak + hump.t_peak) / 2)
        return round(first, WINDOW_DECIMALS), round(last, WINDOW_DECIMALS)

    def measure(self) -> Heights:
        """Heights of the pushes as the commands give them, and what they would say.

        Returns:
            One row per push, with directions as soon as all are known.
        """
        peaks: PeakSettings = self.settled().peaks
        if self.pushes and all(self.is_directed(k) for k in self.pushes):
            table = extract_peaks(self.recording, self.schedule(), settings=peaks)
            return Heights(
                frame=table.frame,
                notes=table.notes,
                cautions=table.cautions,
                trace=table.traces[0],
            )
        return measure_pushes(self.recording, settings=peaks)


def angles_of(text: str, name: str) -> Sequence[float]:
    """Angles from what somebody typed: "15", "0, 30, 60" or "0:90:15".

    Args:
        text: Numbers, or first, last (which is one of them) and step.
    """
    try:
        if ":" in text:
            first, last, step = (float(part) for part in text.split(":"))
            n = round((last - first) / step) + 1
            angles = [first + i * step for i in range(min(n, MAX_ANGLES + 1))]
        else:
            angles = [float(part) for part in text.replace(",", " ").split()]
    except (ValueError, ZeroDivisionError, OverflowError):
        angles = []
    if not 0 < len(angles) <= MAX_ANGLES or not np.isfinite(angles).all():
        raise ConfigError(
            f"{name} = {text!r} is no list of angles; write 0, 30, 60 or, as first, "
            "last and step, 0:90:15",
            code="angles",
        )
    return angles
