"""Between pushes as they are told and tables of peak heights.

Excluded: the records of pushes (`pushfit.explore.records`).
"""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float

from pushfit.data.tables.peak_table import PeakTable
from pushfit.errors import DataError
from pushfit.explore.belief.belief import Question
from pushfit.explore.records import ToldPush


def table_of(told: Sequence[ToldPush], question: Question) -> PeakTable | None:
    """Pushes of full length as a table.

    Returns:
        The table, with standard deviations where every push has them; None without a
        push.
    """
    rows = [row for row in told if not row.is_short]
    if not rows:
        return None
    channels = question.channels
    heights = {c: np.array([row.heights[c] for row in rows]) for c in channels}
    sds = [sd_of(row, question) for row in rows]
    stated = np.array([sd for sd in sds if sd is not None], dtype=float)
    return PeakTable.from_arrays(
        theta=np.array([row.theta for row in rows]),
        alpha=np.array([row.alpha for row in rows]),
        heights=heights,
        unit=question.unit,
        sd=dict(zip(channels, stated.T, strict=True))
        if len(stated) == len(rows)
        else None,
        flags=tuple(row.flags for row in rows),
    )


def check_told(row: ToldPush, question: Question) -> None:
    """Refuse a push that could be in no table, before it is taken in.

    Raises:
        DataError: One of its angles, numbers or flags breaks a rule.
    """
    if not 0.0 < row.length_share <= 1.0:
        raise DataError(
            f"length_share = {row.length_share:g}: a push has a share of the push "
            "length above 0 and at most 1; tell a longer one of an exploration whose "
            "push length it has",
            code="length_share",
        )
    PeakTable.from_arrays(
        theta=np.array([row.theta]),
        alpha=np.array([row.alpha]),
        heights={name: np.array([value]) for name, value in row.heights.items()},
        unit=question.unit,
        sd={name: np.array([sd]) for name, sd in (row.sd or {}).items()},
        flags=(row.flags,),
    )


def noise_is_known(told: Sequence[ToldPush], question: Question) -> bool:
    """Whether scatter is stated in advance, or with every push of full length."""
    stated = [row.sd is not None for row in told if not row.is_short]
    return question.sigma is not None or (bool(stated) and all(stated))


def told_rows(table: PeakTable) -> tuple[ToldPush, ...]:
    """Pushes of a table that was made before."""
    theta, alpha = table.theta, table.alpha
    heights = {c: table.heights(c) for c in table.channels}
    sds = {c: table.sd(c) for c in table.channels}
    stated = {c: sd for c, sd in sds.items() if sd is not None}
    has_sd = len(stated) == len(sds)
    return tuple(
        ToldPush(
            theta=float(theta[i]),
            alpha=float(alpha[i]),
            heights={c: float(h[i]) for c, h in heights.items()},
            sd={c: float(sd[i]) for c, sd in stated.items()} if has_sd else None,
            flags=";".join(sorted(table.flags[i])),
            is_attached=True,
        )
        for i in range(table.n_pushes)
    )


def check_sensor(table: PeakTable, question: Question) -> None:
    """Refuse a table of another sensor.

    Raises:
        DataError: They are not those of the table.
    """
    if table.unit != question.unit or table.channels != question.channels:
        raise DataError(
            f"the table has {', '.join(table.channels)} in {table.unit}, the "
            f"exploration {', '.join(question.channels)} in {question.unit}; explore "
            "with channels and unit of the table",
            code="other_sensor",
        )


def by_channel(
    values: Mapping[str, float] | float, channels: tuple[str, ...]
) -> dict[str, float]:
    """One number for every channel, as plain floats.

    Args:
        values: By channel, or that of the only one.

    Raises:
        DataError: A channel is missing or too many, or a number is none.
    """
    given = values if isinstance(values, Mapping) else {channels[0]: values}
    if set(given) != set(channels):
        raise DataError(
            f"numbers for {', '.join(sorted(map(str, given)))} were told; the "
            f"exploration has {', '.join(channels)}",
            code="other_sensor",
        )
    return {name: number_of(name, given[name]) for name in channels}


def number_of(name: str, value: object) -> float:
    """A number that was told, as a plain float.

    Raises:
        DataError: It is none, or not finite.
    """
    try:
        # Of text too Python would make a number.
        number = np.nan if isinstance(value, str) else float(value)  # pyright: ignore
    except (TypeError, ValueError, OverflowError):
        number = np.nan
    if not np.isfinite(number):
        raise DataError(
            f"{name} = {value!r} is no finite number; tell what was measured, and a "
            "push without a height by `fail()`",
            code="no_height",
        )
    return number


def sd_of(row: ToldPush, question: Question) -> Float[np.ndarray, " c"] | None:
    """Noise of the heights of a push: what repeats scatter by is the least it can be.

    Returns:
        Standard deviations by channel; None where none is stated [table unit].
    """
    sigma, channels = question.sigma, question.channels
    if row.sd is None:
        return None if sigma is None else np.full(len(channels), sigma)
    return np.maximum([row.sd[channel] for channel in channels], sigma or 0.0)
