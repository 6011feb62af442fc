"""Repeats of a direction that share the errors of its angles, as one push each.

An arm that repeats a command misses it alike each time. What repeats scatter is then
the noise of heights alone, and their mean, with the noise of a mean, has one error of
each angle: all that its repeats tell of the model, where their noise is known.
Excluded: pooling that leaves the likelihood as it is
(`pushfit.fit.problem.repeats.pooling`).
"""

from dataclasses import replace

import numpy as np

from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import SettingsError
from pushfit.fit.results import ResultWarning

# A pooled sd from 20 degrees of freedom is known to 16 %, and a 90 % interval that
# takes it as exact covers 88.4 %; with fewer, sigma is sampled instead.
MIN_POOLED_DOF = 20


def averaged(table: PeakTable, sigma: str) -> PeakTable:
    """The table with one row for each direction, at the mean of its heights.

        mean = Σ h / s² / Σ 1 / s²,   sd² = 1 / Σ 1 / s²

    Args:
        sigma: `[noise] sigma`: standard deviations s are those that the table states,
            or, where it states none or "pooled" is asked for, the scatter of repeats.

    Returns:
        A table with standard deviations; unchanged if no direction was pushed twice.
        A mean stands in the row of its first push; the others are flagged `averaged`.

    Raises:
        SettingsError: Repeats are too few to tell their scatter.
    """
    used = np.flatnonzero(table.is_used)
    _, first, direction = np.unique(
        table.groups[used], return_index=True, return_inverse=True
    )
    if first.size == used.size:
        return table
    columns = {}
    for channel in table.channels:
        sd = table.sd(channel)
        if sd is None or sigma == "pooled":
            scatter, dof = table.pooled_sd(channel)
            # Hardly any repeat tells it, and it was not asked for.
            if dof < MIN_POOLED_DOF and sigma != "pooled":
                raise SettingsError(
                    '[noise] angle_errors = "shared" needs the noise of heights: '
                    f"{dof} repeats beyond the first are fewer than {MIN_POOLED_DOF}; "
                    f"add the column {channel}_sd_{table.unit}, or take their scatter "
                    'as known by sigma = "pooled"',
                    code="no_given_sigma",
                )
            sd = np.full(table.n_pushes, scatter)
        heights, weight = table.heights(channel).copy(), sd[used] ** -2.0
        total = np.bincount(direction, weight)
        heights[used[first]] = np.bincount(direction, weight * heights[used]) / total
        sd = sd.copy()
        sd[used[first]] = total**-0.5
        columns[f"{channel}_{table.unit}"] = heights
        columns[f"{channel}_sd_{table.unit}"] = sd
    averages = replace(table, frame=table.frame.assign(**columns))
    return averages.with_flag(np.delete(used, first).tolist(), "averaged")


def averaging_warning(before: PeakTable, after: PeakTable) -> ResultWarning:
    """Say that repeats became one push."""
    return ResultWarning(
        code="repeats_averaged",
        text=f"{before.is_used.sum()} pushes were averaged to {after.is_used.sum()} "
        "directions, as the repeats of one share the errors of its angles; "
        '[noise] angle_errors = "each" has each err on its own',
    )
