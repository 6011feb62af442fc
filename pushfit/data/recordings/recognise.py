"""What the columns of a file are by their names and units: one recogniser for all.

Recordings, plans and peak tables differ in which columns they have, not in how a name
is read. A unit comes from the name's suffix, a row of units, or what the user states;
all that is stated must agree. Excluded: which columns a kind of file needs
(`pushfit.data.recordings.roles`, `pushfit.data.tables.columns`).
"""

from collections.abc import Mapping, Sequence
from types import MappingProxyType

from pushfit.data.text.faults import listed
from pushfit.data.units import (
    UNITS,
    Dimension,
    Unit,
    find_unit,
    parse_unit,
    split_unit,
    volts_of,
)
from pushfit.errors import ConfigError, stated

DIRECTION_COLUMNS = ("theta", "alpha")
_NOTHING: Mapping[str, str] = MappingProxyType({})


class RecordingColumns:
    """The columns of one file with what is stated about them.

    Attributes:
        names: As in the file; empty where a column has none.
        stems: Names without their units, lower case, to compare.
        position: Where each name is.
    """

    def __init__(
        self,
        names: Sequence[str],
        *,
        path: str = "table",
        unit_row: Sequence[str] = (),
        units: Mapping[str, str] = _NOTHING,
    ) -> None:
        """Read the names.

        Args:
            unit_row: Cells of a row of units below the header; empty without one.
            units: Unit by column name or by what a column is for, as the user states.
        """
        self.names = tuple(names)
        self.stems = tuple(split_unit(name)[0].strip().lower() for name in names)
        self.position = {name: i for i, name in enumerate(names) if name}
        self.path, self.unit_row, self.units = path, unit_row, units

    def unit(self, i: int, *keys: str) -> Unit | None:
        """Unit of a column, if all that is stated about it agrees.

        A gain is that for the volts of the column.

        Args:
            *keys: Names of what it is for.

        Returns:
            The unit; None where none is stated, or one that is not known.

        Raises:
            ConfigError: If units contradict each other (`unit_conflict`).
        """
        name = self.names[i]
        stem, suffix = split_unit(name)
        said = [(suffix, "by its name")]
        said += [(split_unit(key)[1], f"by the name {key!r}") for key in keys]
        if self.unit_row:
            said.append((find_unit(self.unit_row[i]), "by the file itself"))
        said += [
            (parse_unit(self.units[key]), f"by {stated(units={key: self.units[key]})}")
            for key in dict.fromkeys((name, stem, *keys))
            if key in self.units
        ]
        volts = self.volts(i, *keys)
        known = [(unit.of_volts(volts or unit.volts), by) for unit, by in said if unit]
        others = [(unit, by) for unit, by in known if not unit.equals(known[0][0])]
        if others:
            (first, by), (other, by_other) = known[0], others[0]
            raise ConfigError(
                f"{self.path}, column {name}: the unit is {first.name} {by}, but "
                f"{other.name} {by_other}; mend or leave out the one that is wrong",
                code="unit_conflict",
            )
        return known[0][0] if known else None

    def volts(self, i: int, *keys: str) -> str:
        """Volts that a column is in, as `mv`; empty where none are stated.

        Args:
            *keys: Names of what it is for.
        """
        row = self.unit_row[i : i + 1]
        return next(filter(None, map(volts_of, (*row, self.names[i], *keys))), "")

    def called(self, *stems: str) -> list[int]:
        """Positions of the columns of some names, as `stems` has them."""
        return [i for i, stem in enumerate(self.stems) if stem in stems]

    def measuring(self, quantity: Dimension) -> list[int]:
        """Positions of the columns in a unit of a quantity."""
        return [
            i
            for i, name in enumerate(self.names)
            if name and (unit := self.unit(i)) and unit.quantity == quantity
        ]


def units_of(quantity: Dimension) -> list[str]:
    """Names of the units of a quantity."""
    return [unit.name for unit in UNITS.values() if unit.quantity == quantity]


def if_in(unit: str, quantity: Dimension) -> str:
    """End of an example: its unit is but one of those that may be meant."""
    known = listed(units_of(quantity))
    return f" (if it is in {unit}; known are {known}: convert others)"
