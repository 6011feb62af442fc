"""Whether two results hold the same numbers: a folder, and what was computed again.

Where versions and platform agree, numbers are reproduced if they are identical to the
last bit. Elsewhere sums round differently and a chain takes another path from the same
seed, so the answers are compared with what that can do to them, and numbers that
belong to one chain only (its diagnostics, its draws) are not compared at all. Excluded:
computing it again (`pushfit.cli.commands.verify`).
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeGuard, cast

import numpy as np

from pushfit.data.tables.peak_table import PeakTable, read_table
from pushfit.fit.results import Identification
from pushfit.parameters import HALF_TURN
from pushfit.report.json_values import Json, json_safe
from pushfit.report.store.archive import posterior_tree
from pushfit.report.store.read import BROKEN, not_whole
from pushfit.report.store.summary import summary_dict

if TYPE_CHECKING:
    from xarray import DataTree

Leaf = str | int | float | bool | None | np.ndarray
# Ends of an interval from 8000 draws scatter by 0.7 % of its width, those of a
# highest-density set by 2 %; two results differ by more than this once in 10^4.
SHARE_OF_WIDTH = 0.1
# The same for shares that draws estimate.
SHARE_OF_ONE = 0.05
# Least squares stops at 1e-10; its optimum is flat, and sums add their rounding.
RELATIVE = 1e-6
# What a rerun takes from the folder itself, or says of it.
NOT_COMPARED = frozenset({"config", "seed", "inputs", "recipe", "versions", "notes"})
# Parts that follow one chain, and sentences that repeat its numbers.
OF_ONE_CHAIN = frozenset(
    {"posterior", "correlations", "identifiability", "sentences", "warnings"}
)


@dataclass(frozen=True, slots=True, kw_only=True)
class Deviation:
    """One place where two results differ.

    Args:
        where: Dotted path into `summary.json`, or file and name of an array.
        recorded: What the folder says; of an array, its worst element.
        found: What was computed again.
        relative: Difference over the larger of the two; infinite unless both are
            numbers.
        is_tolerated: Whether another platform or version explains it.
    """

    where: str
    recorded: Json
    found: Json
    relative: float
    is_tolerated: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Reproduction:
    """How a result compares with the same computed again.

    Args:
        n_numbers: Numbers compared, those in arrays included.
        differences: Where they differ, what is not tolerated first, then by size.
        environment: Versions and platform that differ: as recorded, and here; None
            where only one of the two has it.
    """

    n_numbers: int
    differences: tuple[Deviation, ...]
    environment: Mapping[str, tuple[str | None, str | None]]

    @property
    def is_exact(self) -> bool:
        """Whether every number is identical."""
        return not self.differences

    @property
    def is_reproduced(self) -> bool:
        """Whether the numbers are as equal as versions and platform allow."""
        return all(difference.is_tolerated for difference in self.differences)


def compare_result(
    folder: Path, summary: Mapping[str, Json], again: Identification
) -> Reproduction:
    """Compare every number of a result folder, all files, with the same anew.

    Args:
        again: Identification of the same inputs with the same config, seed and engine.

    Raises:
        DataError: A file of the folder is missing or broken.
    """
    from xarray import open_datatree

    summary_again = summary_dict(again)
    environment = _environment(summary["versions"], summary_again["versions"])
    try:
        with open_datatree(folder / "result.nc", engine="h5netcdf") as tree:
            recorded = _entries(summary, read_table(folder / "peaks.csv"), tree)
    except BROKEN as error:
        raise not_whole(folder, error) from error
    found = _entries(summary_again, again.table, posterior_tree(again))
    nothing = Expected(value=None, allowed=0.0)
    differences = []
    for where in dict.fromkeys([*recorded, *found]):
        old, new = recorded.get(where, nothing), found.get(where, nothing)
        if not _is_same(old.value, new.value):
            allowed = max(old.allowed, new.allowed) if environment else 0.0
            differences.append(
                _difference(where, recorded=old.value, found=new.value, allowed=allowed)
            )
    differences.sort(key=lambda d: (d.is_tolerated, -d.relative))
    return Reproduction(
        n_numbers=sum(_n_numbers(entry.value) for entry in recorded.values()),
        differences=tuple(differences),
        environment=environment,
    )


def _environment(
    recorded: Json, found: Json
) -> dict[str, tuple[str | None, str | None]]:
    before = recorded if isinstance(recorded, dict) else {}
    now = found if isinstance(found, dict) else {}
    pairs = {n: (before.get(n), now.get(n)) for n in dict.fromkeys([*before, *now])}
    return {
        name: (None if old is None else str(old), None if new is None else str(new))
        for name, (old, new) in pairs.items()
        if old != new
    }


@dataclass(frozen=True, slots=True, kw_only=True)
class Expected:
    """One value of a result, and how far another platform or version may move it."""

    value: Leaf
    allowed: float


def _entries(
    summary: Mapping[str, Json], table: PeakTable, tree: "DataTree"
) -> dict[str, Expected]:
    """Everything that a rerun is to reproduce, by where it stands."""
    entries: dict[str, Expected] = {}
    for key, value in summary.items():
        if key not in NOT_COMPARED:
            allowed = math.inf if key in OF_ONE_CHAIN else None
            entries |= _walk(value, key, allowed)
    numbers = table.frame.select_dtypes("number")
    for name in numbers:
        heights = numbers[name].to_numpy(dtype=float)
        allowed = RELATIVE * float(np.max(np.abs(heights), initial=0.0))
        entries[f"peaks.csv: {name}"] = Expected(value=heights, allowed=allowed)
    for group in tree.children:
        for name, draws in tree[group].data_vars.items():
            where = f"result.nc: {group}/{name}"
            entries[where] = Expected(value=draws.to_numpy(), allowed=math.inf)
    return entries


def _walk(
    value: Json, where: str, allowed: float | None
) -> Iterator[tuple[str, Expected]]:
    """Leaves of a document; without a limit from above they have a relative one."""
    if isinstance(value, dict | list):
        pairs = enumerate(value) if isinstance(value, list) else value.items()
        items = {str(key): item for key, item in pairs}
        interval = items.get("interval")
        if isinstance(interval, list) and allowed is None:
            low, high = interval
            allowed = SHARE_OF_WIDTH * (high - low)  # pyright: ignore
        for key, item in items.items():
            limit = allowed
            if key in ("contraction", "predictive"):
                limit = SHARE_OF_ONE
            elif key == "sets" and not where.endswith("_deg"):
                # Into how many pieces a set that fills the prior falls is up to chance.
                limit = math.inf
            elif key == "sets" and limit is None and isinstance(item, list):
                # Of draws as well, where an angle that is open to a side has no more.
                limit = SHARE_OF_WIDTH * min(map(_width, item), default=0.0)
            yield from _walk(cast(Json, item), f"{where}.{key}", limit)
        return
    if allowed is None:
        allowed = RELATIVE * abs(value) if _is_number(value) else 0.0
    yield where, Expected(value=value, allowed=allowed)


def _width(piece: Json) -> float:
    """Width of a piece of an angle; of an open one to the next right angle [deg]."""
    low, high = cast(list[float | None], piece)
    if low is not None and high is not None:
        return high - low
    end = low if high is None else high
    return math.inf if end is None else abs(math.remainder(end, HALF_TURN / 2))


def _is_same(recorded: Leaf, found: Leaf) -> bool:
    if isinstance(recorded, np.ndarray) and isinstance(found, np.ndarray):
        return np.array_equal(recorded, found, equal_nan=True)
    return type(recorded) is type(found) and recorded == found


def _n_numbers(leaf: Leaf) -> int:
    return leaf.size if isinstance(leaf, np.ndarray) else int(_is_number(leaf))


def _is_number(leaf: Leaf) -> TypeGuard[float]:
    return isinstance(leaf, int | float) and not isinstance(leaf, bool)


def _difference(
    where: str, *, recorded: Leaf, found: Leaf, allowed: float
) -> Deviation:
    """The difference in one place, of arrays that at the worst element."""
    if isinstance(recorded, np.ndarray) and isinstance(found, np.ndarray):
        if recorded.shape == found.shape:
            one, two = recorded.ravel(), found.ravel()
            worst = int(np.argmax([_relative(*p) for p in zip(one, two, strict=True)]))
            recorded, found = one[worst].item(), two[worst].item()
        else:
            recorded, found = f"shape {recorded.shape}", f"shape {found.shape}"
    relative, is_tolerated = math.inf, math.isinf(allowed)
    if _is_number(recorded) and _is_number(found):
        relative, gap = _relative(recorded, found), abs(recorded - found)
        if where.startswith("alpha_star"):
            gap = min(gap % HALF_TURN, -gap % HALF_TURN)
        is_tolerated = is_tolerated or gap <= allowed
    return Deviation(
        where=where,
        recorded=json_safe(recorded),
        found=json_safe(found),
        relative=relative,
        is_tolerated=is_tolerated,
    )


def _relative(one: float, two: float) -> float:
    """Difference over the larger of the two; infinite where only one is finite."""
    if one == two or (math.isnan(one) and math.isnan(two)):
        return 0.0
    share = abs(one - two) / max(abs(one), abs(two))
    return share if math.isfinite(share) else math.inf
