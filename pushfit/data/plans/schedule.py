"""The plan of an exploration: which pushes were asked for, in which order.

Excluded: finding the pushes in a recording (`pushfit.data.peaks.extract`) and pairing
them with the plan (`pushfit.data.plans.alignment`).
"""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float, Int

from pushfit.arguments import checked
from pushfit.atomic import atomic_path
from pushfit.data.recordings.recognise import RecordingColumns
from pushfit.data.rows import rows_of
from pushfit.data.tables.columns import COMMON, Known, Origin, read_columns, read_rows
from pushfit.data.tables.rules import CHANNELS, check_columns
from pushfit.data.text.faults import refuse
from pushfit.data.text.files import Source
from pushfit.data.units import in_degrees
from pushfit.mechanics.ranges import (
    LARGEST,
    check_angles,
    check_numbers,
    check_together,
)

KNOWN: Known = {**COMMON, "time": "time"}

# Angles that are equal but for rounding are one direction [decimals of a rad].
ANGLE_DECIMALS = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class PushSchedule:
    """Planned pushes in the order of their execution.

    Args:
        theta: Elevation of every push [rad].
        alpha: Azimuth of every push [rad].
        repeat: Repeat number of every push in its direction, from 1.
        push: Number of every push.
        time: When every push was planned, from any origin; None where unknown [s].
        source: File behind the plan.

    Raises:
        ConfigError: An elevation is beyond the normal, or an azimuth beyond a turn.
    """

    theta: Float[np.ndarray, " n"]
    alpha: Float[np.ndarray, " n"]
    repeat: Int[np.ndarray, " n"]
    push: Int[np.ndarray, " n"]
    time: Float[np.ndarray, " n"] | None = None
    source: Source | None = None

    def __post_init__(self) -> None:
        """Refuse what is no direction, such as degrees."""
        check_angles("PushSchedule: theta", self.theta, most=np.pi / 2)
        check_angles("PushSchedule: alpha", self.alpha, most=2 * np.pi)

    @property
    def n_pushes(self) -> int:
        """Number of planned pushes."""
        return len(self.push)

    @property
    def is_numbered_in_order(self) -> bool:
        """Whether the numbers of the pushes rise from row to row."""
        return bool(np.all(np.diff(self.push) > 0))

    @property
    def order(self) -> Int[np.ndarray, " n"]:
        """Rows in the order of their times; as they are where these are unknown."""
        if self.time is None:
            return np.arange(self.n_pushes)
        return np.argsort(self.time, kind="stable")

    @property
    def direction(self) -> Int[np.ndarray, " n"]:
        """Which of the directions each push has, in any order."""
        both = np.stack([self.theta, self.alpha], axis=1).round(ANGLE_DECIMALS)
        return np.unique(both, axis=0, return_inverse=True)[1].ravel()

    @property
    def is_jump(self) -> Bool[np.ndarray, " n"]:
        """Whether the direction changes by another angle than before most pushes.

        The first push is compared with the last, which it follows where a plan is
        repeated. Where no angle is that of most pushes there are no jumps.
        """
        both = np.stack([self.theta, self.alpha], axis=1)
        change = np.abs(both - np.roll(both, 1, axis=0)).round(ANGLE_DECIMALS)
        kind = np.unique(change, axis=0, return_inverse=True)[1].ravel()
        count = np.bincount(kind[1:], minlength=1)
        if count.max() < max(2, (self.n_pushes - 1) / 2):
            return np.zeros(self.n_pushes, dtype=bool)
        return kind != count.argmax()

    @classmethod
    def planned(
        cls,
        theta: Float[np.ndarray, "*n"] | float,
        alpha: Float[np.ndarray, "*n"] | float,
        *,
        repeats: int = 1,
    ) -> "PushSchedule":
        """Plan pushes direction by direction, each repeated in a row.

        Args:
            theta: Elevations [rad]; broadcast against `alpha`.
            alpha: Azimuths [rad].
            repeats: Pushes per direction.

        Raises:
            ConfigError: There is no push, or a direction that is none.

        Examples:
            >>> plan = PushSchedule.planned(np.array([0.2, 0.4]), 1.5, repeats=2)
            >>> plan.theta.tolist(), plan.repeat.tolist()
            ([0.2, 0.2, 0.4, 0.4], [1, 2, 1, 2])
        """
        check_numbers(
            "repeats",
            repeats,
            low=1.0,
            high=LARGEST,
            rule="a whole number, 1 or above",
        )
        check_together("PushSchedule", theta=theta, alpha=alpha)
        theta, alpha = (np.ravel(a) for a in np.broadcast_arrays(theta, alpha))
        return cls(
            theta=np.repeat(theta, repeats).astype(float),
            alpha=np.repeat(alpha, repeats).astype(float),
            repeat=np.tile(np.arange(1, repeats + 1), len(theta)),
            push=np.arange(1, repeats * len(theta) + 1),
        )

    def repeated(self, n_cycles: int) -> "PushSchedule":
        """The schedule run through several times, pushes and repeats counted on.

        Returns:
            The longer schedule; without planned times if it is longer.

        Examples:
            >>> plan = PushSchedule.planned(np.array([0.2, 0.4]), 1.5, repeats=1)
            >>> twice = plan.repeated(2)
            >>> twice.push.tolist(), twice.repeat.tolist()
            ([1, 2, 3, 4], [1, 1, 2, 2])
        """
        if n_cycles == 1:
            return self
        cycle = np.repeat(np.arange(n_cycles), self.n_pushes)
        return replace(
            rows_of(self, np.tile(np.arange(self.n_pushes), n_cycles)),
            push=np.tile(self.push, n_cycles) + cycle * self.push.max(),
            repeat=np.tile(self.repeat, n_cycles) + cycle * self.repeat.max(),
            time=None,
        )

    @classmethod
    def from_frame(
        cls,
        frame: pd.DataFrame,
        *,
        origin: Origin | None = None,
        source: Source | None = None,
    ) -> "PushSchedule":
        """Check and convert a frame whose columns state their units.

        Args:
            frame: `theta_deg`, `alpha_deg`, and where known `push`, `repeat`, `time_s`.
            origin: Places that messages name.
            source: File behind the plan.

        Returns:
            The schedule, its rows in the order given.

        Raises:
            DataError: A column or a cell breaks a rule.
        """
        origin = origin or Origin()
        columns = read_columns(frame, KNOWN, origin)
        check_columns(columns, origin)
        rows = columns.frame
        return cls(
            theta=np.radians(rows["theta_deg"].to_numpy(dtype=float)),
            alpha=np.radians(rows["alpha_deg"].to_numpy(dtype=float)),
            repeat=rows["repeat"].to_numpy(dtype=int),
            push=rows["push"].to_numpy(dtype=int),
            time=rows["time_s"].to_numpy(dtype=float) if "time_s" in rows else None,
            source=source,
        )


@checked
def read_schedule(path: str | Path) -> PushSchedule:
    """Read a schedule, CSV or Parquet by its suffix.

    Args:
        path: File with columns `theta_deg`, `alpha_deg` and, where they are not simply
            counted, `push` and `repeat`; `time_s` if the pushes were timed.

    Returns:
        The pushes in the order of the rows.

    Raises:
        DataError: The file cannot be read, is a table of peak heights (`wrong_kind`) or
            breaks a rule.
    """
    rows = read_rows(path, KNOWN)
    if not {*RecordingColumns([str(name) for name in rows.frame]).stems}.isdisjoint(
        CHANNELS
    ):
        raise refuse(
            "wrong_kind",
            "is a table of peak heights, no schedule; `pushfit fit` takes it by "
            "itself, and its columns push, theta_deg, alpha_deg and repeat alone are "
            "a schedule",
            path=str(path),
        )
    return PushSchedule.from_frame(
        rows.frame, origin=rows.origin, source=rows.sources[-1]
    )


def write_schedule(schedule: PushSchedule, path: str | Path) -> None:
    """Write a schedule as CSV; the file is complete or absent."""
    columns = {
        "push": schedule.push,
        "theta_deg": in_degrees(schedule.theta),
        "alpha_deg": in_degrees(schedule.alpha),
        "repeat": schedule.repeat,
    }
    if schedule.time is not None:
        columns["time_s"] = schedule.time
    with atomic_path(path) as temporary:
        pd.DataFrame(columns).to_csv(temporary, index=False, lineterminator="\n")
