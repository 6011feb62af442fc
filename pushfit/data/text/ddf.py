"""What the preamble of an Aurora indenter log (`.ddf`) says of its columns.

The program writes volts, and above them the unit and the scale of each channel and the
samples per second: all that it takes to read the file as it is. Excluded: the columns
themselves (`pushfit.data.text.csv_reader`).
"""

import math
from dataclasses import dataclass

_FIRST = "DMCv"
_RATE = "Sample Frequency (Hz)"
_IN_VOLTS = "Test Data in Volts"
# What was commanded; nothing of it is measured.
_OUTPUT = "AO"


@dataclass(frozen=True, slots=True, kw_only=True)
class Preamble:
    """What a preamble states.

    Args:
        rate: Samples per second; None where no positive number is stated [Hz].
        units: Unit of each column, as `500 mN/V`; empty where there is none, and of
            outputs.
    """

    rate: float | None
    units: tuple[str, ...]


def read_preamble(lines: list[str], names: tuple[str, ...]) -> Preamble | None:
    """Read what stands above the columns; None if the file is no such log."""
    if not lines or not lines[0].startswith(_FIRST):
        return None
    in_volts = any(line.startswith(_IN_VOLTS) for line in lines)
    rows = {
        cells[0].partition(" (")[0].strip(): [cell.strip() for cell in cells[1:]]
        for line in lines
        if len(cells := line.split("\t")) > 2
    }
    channels, units = rows.get("Channel", []), rows.get("Units", [])
    stated = {
        channel: f"{scale} {unit}/V" if in_volts else unit
        for channel, unit, scale in zip(
            channels, units, rows.get("Scale", []), strict=False
        )
        if unit and not channel.startswith(_OUTPUT)
    }
    rate = next(
        (line.partition(":")[2].strip() for line in lines if line.startswith(_RATE)), ""
    )
    return Preamble(
        rate=_positive(rate),
        units=tuple(stated.get(name, "") for name in names),
    )


def _positive(word: str) -> float | None:
    """A number above 0; None where it is none."""
    try:
        number = float(word)
    except ValueError:
        return None
    return number if 0 < number < math.inf else None
