"""Whether a table makes more sense when its columns mean something else.

Elevations are often counted from the normal of a surface, and channels are exchanged by
a slip; with noise of a few percent the model may still describe what comes out, by
numbers that no contact has together. Asked where the result looks wrong already, or
where nothing tells how far heights may be off. Excluded: what a table shows without a
fit (`pushfit.fit.checks.table_checks`).
"""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import PushfitError
from pushfit.fit.checks.model_checking import LEVEL
from pushfit.fit.identify.fit_table import fit_table, log_bayes_factor
from pushfit.fit.identify.fitted import Fitted, is_comparable, sweep
from pushfit.fit.results import ResultWarning

NORMAL, TANGENTIAL = "height_normal", "height_tangential"
# Words of a reading, and the table by it.
Reading = tuple[str, PeakTable]


def other_reading(fitted: Fitted, *, seed: int) -> ResultWarning | None:
    """The reading that heights speak for by 1 / `LEVEL` or more, if there is one.

    Evidences are of the same heights with the same noise, priors and mechanics.

    Args:
        fitted: The table as it was read.
    """
    here, gain, said = sweep(fitted, seed), np.log(1 / LEVEL), ""
    for words, table in _readings(fitted.table):
        try:
            other = fit_table(table, fitted.config)
            if is_comparable(fitted, other):
                found = log_bayes_factor(here, sweep(other, seed))
                gain, said = (found, words) if found > gain else (gain, said)
        except PushfitError:
            continue
    if not said:
        return None
    return ResultWarning(
        code="other_reading",
        text=f"heights are far more probable (by {gain:.0f} in log evidence) if "
        f"{said}: look how the table was made",
    )


def _readings(table: PeakTable) -> Iterator[Reading]:
    """Every other reading that the table allows."""
    frame, unit = table.frame, table.unit
    theta = frame["theta_deg"]
    if theta.between(0.0, 90.0).all():
        words = "theta_deg is counted from the normal of the surface, 90° - θ"
        yield words, replace(table, frame=frame.assign(theta_deg=90.0 - theta))
    if {NORMAL, TANGENTIAL} <= set(table.channels):
        ends = (f"_{unit}", f"_sd_{unit}")
        pairs = [(NORMAL + end, TANGENTIAL + end) for end in ends]
        names = dict(pairs) | {second: first for first, second in pairs}
        words = f"{NORMAL} and {TANGENTIAL} are exchanged"
        yield words, replace(table, frame=frame.rename(columns=names))
