"""Pushes that cannot show anything of a contact: refused, with those that could.

Excluded: pushes that show little, of which a result says what they leave open.
"""

import numpy as np

from pushfit.config import GraspConfig
from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import DataError


def check_informative(table: PeakTable, config: GraspConfig) -> None:
    """Refuse pushes at which the model says nothing of the contact.

    Args:
        table: Peak heights, of which at least one is used.

    Raises:
        DataError: If all heights of a channel are 0 (`no_height`), or all pushes go
            along the surface of a contact without a preload (`no_elevation`).
    """
    used = table.is_used
    for channel in table.channels:
        if not np.any(table.heights(channel)[used]):
            raise DataError(
                f"{table.place}: the column {channel} holds only zeros, which show no "
                "stiffness and no critical angle; push further or with a more "
                "sensitive sensor, until the heights rise above their noise, or leave "
                "the column out",
                code="no_height",
            )
    value, _ = config.grasp.preload
    if value == 0 and not np.any(table.theta[used]):
        raise DataError(
            f"{table.place}: all pushes go along the surface (θ = 0°), where a contact "
            "without a preload carries no force: they show neither A, B nor C_rr, and "
            "so no θ_c; push at several elevations, such as 15°, 30°, 45°, 60° and "
            "75°, or state [grasp] preload_n if the finger was pressed on before",
            code="no_elevation",
        )
