"""Names that columns of a table may have, as messages ask for them.

Excluded: which column is what (`pushfit.data.tables.columns`).
"""

import difflib
from collections.abc import Collection, Mapping
from typing import Literal

from pushfit.data.recordings.recognise import units_of
from pushfit.data.text.faults import ALIKE
from pushfit.data.units import Unit

# What a column holds.
Holds = Literal["angle", "signal", "time", "bare"]
# Columns that a kind of table may have, without units, and what each one holds.
Known = Mapping[str, Holds]
# So many names are asked about.
_N_NEAR = 3


def any_name(stem: str, holds: Holds) -> str:
    """All names of a column."""
    names = _names(stem, holds)
    return (" or " if holds == "angle" else ", ").join(names)


def nearest_stem(name: str, known: Known, *, taken: Collection[str]) -> str | None:
    """Stem that a name without its unit looks like a slip of; None if it is none."""
    stem_of = {_sorted_words(stem): stem for stem in known}
    near = difflib.get_close_matches(
        _sorted_words(name), list(stem_of), n=1, cutoff=ALIKE
    )
    if not near:
        return None
    stem, _, end = name.rpartition("_")
    # What is no word of any name may be a unit that is not known.
    is_unit = all(end not in other.split("_") for other in known)
    is_meant = is_unit and stem in known and stem not in taken
    return stem if is_meant else stem_of[near[0]]


def near_names(name: str, unit: Unit | None, stem: str, *, holds: Holds) -> str:
    """Names that a column may have been meant to have.

    Args:
        name: The one that it has, without the unit.
        unit: The unit that it states; None for one that is not known, or none.
        stem: What it looks like a slip of.
    """
    names = _names(stem, holds)
    if unit is not None and f"{stem}_{unit.name}" in names:
        return f"{stem}_{unit.name}"
    if name == stem:
        return any_name(stem, holds)
    near = difflib.get_close_matches(name, names, n=_N_NEAR, cutoff=0.0)
    return " or ".join(filter(None, [", ".join(near[:-1]), near[-1]]))


def _sorted_words(name: str) -> str:
    """A name whose words may be in any order, as `height_sd_normal`."""
    return "_".join(sorted(name.split("_")))


def _names(stem: str, holds: Holds) -> list[str]:
    """A stem with the suffixes it may have."""
    match holds:
        case "bare":
            return [stem]
        case "angle":
            return [f"{stem}_deg", f"{stem}_rad"]
        case "time":
            return [f"{stem}_s"]
        case "signal":
            return [f"{stem}_{unit}" for unit in units_of("signal")]
