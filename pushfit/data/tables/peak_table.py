"""The table of peak heights: one row per push, what every estimator starts from.

It is made by peak extraction, by simulation, or read from a file; in all three cases
the same rules have been checked (`pushfit.data.tables.rules`). Excluded: how heights
are measured (`pushfit.data.peaks.extract`) and what they mean (`pushfit.fit`).
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Bool, Float, Int

from pushfit.arguments import checked
from pushfit.atomic import atomic_path, check_file
from pushfit.data.tables.columns import Origin, is_parquet, no_parquet, read_rows
from pushfit.data.tables.rules import CHANNELS, EXCLUDING_FLAGS, KNOWN, canonical_frame
from pushfit.data.tables.traces import Trace
from pushfit.data.text.files import Source, check_csv_name
from pushfit.data.units import in_degrees
from pushfit.errors import DataError


@dataclass(frozen=True, kw_only=True)
class PeakTable:
    """Heights of the pushes of one exploration, with their directions.

    Make one by `from_frame`, `from_arrays` or `read_table`, which check the rows. Its
    arrays are made once, when they are first asked for, so it has no slots.

    Args:
        frame: One row per push: `push`, `theta_deg`, `alpha_deg`, `repeat`, heights as
            `height_<unit>` with `height_sd_<unit>` (also `height_normal`,
            `height_tangential`), and where known `baseline_<unit>`, `t_start_s`,
            `t_peak_s`, `t_end_s`, and `flags`, words joined by ";".
        unit: Unit of all heights: `n`, `kpa`, `counts` or `au`.
        sources: Files behind the rows.
        notes: What was recognised, left out or filled in, for the user.
        traces: Signals that the heights were measured in, where there were any.
        cautions: Notes that the user should not overlook.
        left_out: Columns of the user's that are not used.
    """

    frame: pd.DataFrame
    unit: str
    sources: tuple[Source, ...] = ()
    notes: tuple[str, ...] = ()
    traces: tuple[Trace, ...] = ()
    cautions: tuple[str, ...] = ()
    left_out: tuple[str, ...] = ()

    @classmethod
    @checked
    def from_frame(
        cls,
        frame: pd.DataFrame,
        *,
        origin: Origin | None = None,
        sources: tuple[Source, ...] = (),
        notes: tuple[str, ...] = (),
    ) -> "PeakTable":
        """Check and complete a frame whose columns state their units.

        Args:
            frame: Rows; see `PeakTable.frame` for the columns. `push` and `repeat` are
                numbered where they are absent, other columns are left out with a note.
            origin: Places that messages name.
            sources: Files behind the rows.
            notes: Notes to begin with, for the user.

        Raises:
            DataError: A column or a cell breaks a rule, or a column `grasp` names
                several.
        """
        checked, unit, columns = canonical_frame(frame, origin or Origin())
        return cls(
            frame=checked,
            unit=unit,
            sources=sources,
            notes=(*notes, *columns.notes),
            left_out=columns.left_out,
        )

    @classmethod
    def from_arrays(
        cls,
        *,
        theta: Float[np.ndarray, " n"],
        alpha: Float[np.ndarray, " n"],
        heights: Mapping[str, Float[np.ndarray, " n"]],
        unit: str,
        sd: Mapping[str, Float[np.ndarray, " n"]] | None = None,
        repeat: Int[np.ndarray, " n"] | None = None,
        flags: tuple[str, ...] | None = None,
    ) -> "PeakTable":
        """Make a table from arrays.

        Args:
            theta: Elevation of every push [rad].
            alpha: Azimuth of every push [rad].
            heights: Heights by channel name [table unit].
            unit: Unit of all heights: `n`, `kpa`, `counts` or `au`.
            sd: Standard deviations by channel name [table unit].
            repeat: Repeat number of every push; None numbers equal directions.
            flags: Flag words of every push, joined by ";".

        Raises:
            DataError: A value breaks a rule, or the arrays have several lengths.
        """
        if unknown := set(sd or {}) - set(heights):
            raise DataError(
                f"standard deviations of {', '.join(sorted(unknown))} are given, but "
                f"no heights; name them by channel: {', '.join(heights)}",
                code="unknown_channel",
            )
        if np.any(np.abs(theta) > np.pi):
            raise DataError(
                f"theta: {np.max(np.abs(theta)):g} rad is no elevation, which lies in "
                "[-π/2, π/2]; if it is in degrees, take np.radians() of it",
                code="theta_range",
            )
        columns: dict[str, np.ndarray | list[str]] = {
            "theta_deg": in_degrees(theta),
            "alpha_deg": in_degrees(alpha),
        }
        if repeat is not None:
            columns["repeat"] = repeat
        columns |= {f"{name}_{unit}": values for name, values in heights.items()}
        columns |= {f"{name}_sd_{unit}": values for name, values in (sd or {}).items()}
        if flags is not None:
            columns["flags"] = list(flags)
        shapes = {name: np.shape(values) for name, values in columns.items()}
        if set(shapes.values()) - {(len(theta),), ()}:
            found = ", ".join(f"{name} {shape}" for name, shape in shapes.items())
            raise DataError(
                f"arrays have the shapes {found}; give one number for each push",
                code="lengths",
            )
        return cls.from_frame(pd.DataFrame(columns))

    @property
    def place(self) -> str:
        """What messages call it: the files behind the rows, as the user named them."""
        return ", ".join(source.path for source in self.sources) or "table"

    @property
    def n_pushes(self) -> int:
        """Number of rows, used or not."""
        return len(self.frame)

    @cached_property
    def theta(self) -> Float[np.ndarray, " n"]:
        """Elevation of every push [rad]."""
        return _kept(np.radians(self.frame["theta_deg"].to_numpy(dtype=float)))

    @cached_property
    def alpha(self) -> Float[np.ndarray, " n"]:
        """Azimuth of every push [rad]."""
        return _kept(np.radians(self.frame["alpha_deg"].to_numpy(dtype=float)))

    @cached_property
    def channels(self) -> tuple[str, ...]:
        """Names of the height channels that the table has."""
        return tuple(c for c in CHANNELS if f"{c}_{self.unit}" in self.frame)

    def heights(self, channel: str) -> Float[np.ndarray, " n"]:
        """Heights of a channel [table unit].

        Args:
            channel: `height`, `height_normal` or `height_tangential`.

        Raises:
            DataError: The table lacks the channel.
        """
        if channel not in self.channels:
            raise DataError(
                f"the table has no channel {channel!r}; take one that it has: "
                f"{', '.join(self.channels)}",
                code="unknown_channel",
            )
        return self.frame[f"{channel}_{self.unit}"].to_numpy(dtype=float)

    def sd(self, channel: str) -> Float[np.ndarray, " n"] | None:
        """Standard deviations of a channel's heights; None if absent [table unit]."""
        name = f"{channel}_sd_{self.unit}"
        return self.frame[name].to_numpy(dtype=float) if name in self.frame else None

    @cached_property
    def flags(self) -> tuple[frozenset[str], ...]:
        """Flag words of every push."""
        texts = self.frame["flags"].tolist()
        words = {t: frozenset(filter(None, str(t).split(";"))) for t in set(texts)}
        return tuple(words[text] for text in texts)

    @cached_property
    def is_used(self) -> Bool[np.ndarray, " n"]:
        """Whether a push goes into a fit: no flag of it excludes it."""
        return _kept(np.array([not (w & EXCLUDING_FLAGS) for w in self.flags]))

    @cached_property
    def groups(self) -> Int[np.ndarray, " n"]:
        """Number of each push's direction, counted from 0 by first appearance."""
        # Whole nanodegrees: directions equal on paper stay equal after a unit change.
        theta, alpha = (
            np.rint(self.frame[name].to_numpy(float) * 1e9)
            for name in ("theta_deg", "alpha_deg")
        )
        # A complex number is a pair that pandas can count.
        return _kept(pd.factorize(theta + 1j * (alpha % 360e9))[0])

    def with_flag(self, rows: Sequence[int], flag: str) -> "PeakTable":
        """The table with one more flag on some rows.

        Args:
            rows: Numbers of the rows, from 0.
            flag: A word; some exclude a push from fits.
        """
        words = [
            ";".join(sorted(w | {flag} if i in rows else w))
            for i, w in enumerate(self.flags)
        ]
        return replace(self, frame=self.frame.assign(flags=words))

    def pooled_sd(self, channel: str) -> tuple[float, int]:
        """Scatter of repeated pushes about the mean of their direction.

            s² = Σ_g Σ_i (h_gi - mean_g)² / Σ_g (n_g - 1)

        Returns:
            s, NaN without repeats [table unit], and its degrees of freedom. Only pushes
            that are used count.

        Examples:
            >>> heights = {"height": np.array([1.0, 1.2, 3.0])}
            >>> angles = {"theta": np.array([0.2, 0.2, 0.4]), "alpha": np.zeros(3)}
            >>> table = PeakTable.from_arrays(**angles, heights=heights, unit="n")
            >>> sd, dof = table.pooled_sd("height")
            >>> round(sd, 4), dof
            (0.1414, 1)

        Raises:
            DataError: The table lacks the channel.
        """
        used = self.is_used
        heights = pd.Series(self.heights(channel)[used])
        if heights.empty:
            return np.nan, 0
        groups = heights.groupby(self.groups[used])
        dof = len(heights) - groups.ngroups
        if dof == 0:
            return np.nan, 0
        residuals = (heights - groups.transform("mean")).to_numpy()
        return float(np.sqrt(residuals @ residuals / dof)), dof


@checked
def read_table(path: str | Path) -> PeakTable:
    """Read a table of peak heights, CSV or Parquet by its suffix.

    Args:
        path: File with columns `theta_deg`, `alpha_deg` and `height_<unit>`; see
            `PeakTable.frame` for the others.

    Returns:
        The rows in their order; notes say what was numbered or left out.

    Examples:
        >>> import tempfile
        >>> push = {"theta_deg": [30.0], "alpha_deg": [0.0], "height_n": [2.0]}
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     table = PeakTable.from_frame(pd.DataFrame(push))
        ...     write_table(table, f"{folder}/peaks.csv")
        ...     table = read_table(f"{folder}/peaks.csv")
        >>> table.unit, table.heights("height").tolist()
        ('n', [2.0])

    Raises:
        DataError: The file cannot be read or breaks a rule.
        ConfigError: Parquet is asked for and its library is not installed.
    """
    rows = read_rows(path, KNOWN)
    return PeakTable.from_frame(
        rows.frame, origin=rows.origin, sources=rows.sources, notes=rows.notes
    )


@checked
def write_table(table: PeakTable, path: str | Path) -> None:
    """Write a table of peak heights, CSV or Parquet by its suffix.

    The file is complete or absent. Parquet keeps sources and notes, CSV the rows only.

    Args:
        table: Pushes, all of them.
        path: File, replaced if it is there; `.parquet` or `.pq` for Parquet.

    Raises:
        ConfigError: Parquet is asked for and its library is not installed, the name is
            that of another format, or the folder of the file does not exist.
    """
    check_file(path)
    if not is_parquet(path):
        check_csv_name(path)
    with atomic_path(path) as temporary:
        if not is_parquet(path):
            table.frame.to_csv(temporary, index=False, lineterminator="\n")
            return
        frame = table.frame.copy()
        # pandas keeps attrs in the file's own metadata.
        frame.attrs["pushfit"] = json.dumps(
            {"sources": [asdict(s) for s in table.sources], "notes": list(table.notes)}
        )
        try:
            frame.to_parquet(temporary, index=False, engine="pyarrow")
        except ImportError as error:
            raise no_parquet(path) from error


def _kept(values: np.ndarray) -> np.ndarray:
    """An array that others see as well, which nobody may change."""
    values.setflags(write=False)
    return values
